"""The options that a daemon is started with."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .analyzer_options import ONLY, AnalyzerOptions
from .auto_diagnosis import AUTO
from .backup_plan import BackupPlan
from .worker_limits import Limits


@dataclass(frozen=True)
class DaemonOptions:
    """The options that a daemon is started with."""

    resource: str | None = None
    """VISA resource of the analyzer; None starts a simulated 4294A."""
    events: str = "tcp://127.0.0.1:*"
    requests: str = "tcp://127.0.0.1:*"
    fitters: tuple[str, ...] = ("mason", "mason-nelder-mead")
    """Fitters that the daemon keeps running: entry points of `pzctl.fitters`, or `module:Class`."""
    journal: str | None = None
    """URL of a PostgreSQL database; None keeps the journal in the data folder."""
    station: str = ""
    """Name of this bench in a journal that several daemons write."""
    bench: str | None = None
    """`host:port` of the simulator's bench, if the resource is a simulated instrument."""
    simulator: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Fields of `SimOptions` for the simulated 4294A, such as `{"time_scale": 0}`."""
    limits: Limits = field(default_factory=Limits)
    """Limits of each fitter's process."""
    max_bias_V: float | None = None
    max_oscillator_V: float | None = None
    """Highest bias, and highest test signal (rms), that this bench allows in addition to the analyzer's limits."""
    compensation_days: float | None = None
    """Days that a compensation is valid; a sweep under an older one says so."""
    backup: BackupPlan | None = None
    """Where the journal is copied to, and how often; None: nowhere."""
    diagnose: str = AUTO
    """`auto`: diagnose every fit of the first fitter with a significant misfit; `asked`: only on request."""
    analyzers: Mapping[str, AnalyzerOptions] = field(default_factory=dict[str, AnalyzerOptions])
    """Analyzers by name, in place of `resource`, `bench` and the limits of the only one."""

    @property
    def every_analyzer(self) -> dict[str, AnalyzerOptions]:
        """The analyzers by name."""
        only = AnalyzerOptions(self.resource, self.max_bias_V, self.max_oscillator_V, self.bench)
        return dict(self.analyzers) or {ONLY: only}
