"""pzctl: complex material constants of an ultrasound transducer, right after each gluing step.

The names below are looked up on first use (PEP 562), so that `import pzctl` and `pzctl --help` cost nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .daemon.client.async_client import connect_async as connect_async
    from .daemon.client.client import connect as connect
    from .daemon.files.builds.build_file import read_build as read_build
    from .daemon.report.analysis import compare as compare
    from .daemon.report.analysis import diagnose as diagnose
    from .daemon.report.analysis import fit as fit
    from .daemon.report.analysis import model as model
    from .daemon.report.analysis import read as read
    from .daemon.samples.constant_table import constants as constants
    from .daemon.samples.sweep_table import sweeps as sweeps
    from .fitters.population.trend import trend as trend
    from .models.build import Build as Build
    from .models.stack import AIR as AIR
    from .models.stack import Elastic as Elastic
    from .models.stack import HalfSpace as HalfSpace
    from .models.stack import Piezo as Piezo
    from .models.stack import Stack as Stack
    from .models.sweep import Sweep as Sweep
    from .models.sweep_plan import Segment as Segment
    from .models.sweep_plan import SweepPlan as SweepPlan

_HOME = {
    "AIR": ".models.stack",
    "Build": ".models.build",
    "Elastic": ".models.stack",
    "HalfSpace": ".models.stack",
    "Piezo": ".models.stack",
    "Segment": ".models.sweep_plan",
    "Stack": ".models.stack",
    "Sweep": ".models.sweep",
    "SweepPlan": ".models.sweep_plan",
    "compare": ".daemon.report.analysis",
    "connect": ".daemon.client.client",
    "connect_async": ".daemon.client.async_client",
    "constants": ".daemon.samples.constant_table",
    "diagnose": ".daemon.report.analysis",
    "fit": ".daemon.report.analysis",
    "model": ".daemon.report.analysis",
    "read": ".daemon.report.analysis",
    "read_build": ".daemon.files.builds.build_file",
    "sweeps": ".daemon.samples.sweep_table",
    "trend": ".fitters.population.trend",
}
__all__ = [
    "AIR",
    "Build",
    "Elastic",
    "HalfSpace",
    "Piezo",
    "Segment",
    "Stack",
    "Sweep",
    "SweepPlan",
    "compare",
    "connect",
    "connect_async",
    "constants",
    "diagnose",
    "fit",
    "model",
    "read",
    "read_build",
    "sweeps",
    "trend",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
