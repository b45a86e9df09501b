"""How a daemon is started."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .auto_diagnosis import AUTO
from .worker_limits import Limits


@dataclass(frozen=True)
class DaemonOptions:
    """How a daemon is started."""

    resource: str | None = None
    """VISA resource of the analyzer; None starts a simulated 4294A."""
    events: str = "tcp://127.0.0.1:*"
    requests: str = "tcp://127.0.0.1:*"
    fitters: tuple[str, ...] = ("mason", "mason-nelder-mead")
    """Those the daemon keeps: entry points of `pzctl.fitters`, or `module:Class`."""
    journal: str | None = None
    """URL of a PostgreSQL database; None keeps the journal in the data folder."""
    station: str = ""
    """What this daemon is called in a journal that several write."""
    bench: str | None = None
    """`host:port` of the simulator's bench, where the resource is a simulated instrument."""
    simulator: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Fields of `SimOptions` for the simulated 4294A, such as `{"time_scale": 0}`."""
    limits: Limits = field(default_factory=Limits)
    """What each fitter may use."""
    max_bias_V: float | None = None
    max_oscillator_V: float | None = None
    """The most that this bench allows, besides the analyzer's own limits."""
    compensation_days: float | None = None
    """How long a compensation is good for; a sweep under an older one says so."""
    diagnose: str = AUTO
    """`auto`: a diagnosis follows a fit of the first fitter that leaves a mismatch; `asked`: only a request."""
