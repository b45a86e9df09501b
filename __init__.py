"""pzctl: complex material constants of an ultrasound transducer, right after each gluing step.

The names below are looked up on first use (PEP 562), so that `import pzctl` and `pzctl --help` cost nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .daemon.aio import connect_async as connect_async
    from .daemon.client import connect as connect
    from .models.build import Build as Build
    from .models.plan import Segment as Segment
    from .models.plan import SweepPlan as SweepPlan
    from .models.sweep import Sweep as Sweep

_HOME = {
    "Build": ".models.build",
    "Segment": ".models.plan",
    "Sweep": ".models.sweep",
    "SweepPlan": ".models.plan",
    "connect": ".daemon.client",
    "connect_async": ".daemon.aio",
}
__all__ = ["Build", "Segment", "Sweep", "SweepPlan", "connect", "connect_async"]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
