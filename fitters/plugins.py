"""Finding and loading fitters: those of the entry point group `pzctl.fitters`, and those that settings name."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, entry_points

import numpy as np

from ..models.base.errors import PzctlError
from ..models.base.names import among
from .interface import FitResult, FitTask, Fitter
from .polarity import put_right, turned_says

GROUP = "pzctl.fitters"
DEFAULT = "mason"


class PluginError(PzctlError):
    """A fitter that is not installed, does not load, or fails otherwise than with a FitError."""


@dataclass(frozen=True)
class Listed:
    """An installed fitter as `pzctl fitters` shows it."""

    name: str
    package: str
    version: str
    summary: str
    """One line; for a fitter that does not load, what went wrong."""
    works: bool


def _points() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


def installed(name: str) -> EntryPoint:
    """Return where a fitter is. Raises PluginError where none of this name is installed."""
    points = _points()
    if name not in points:
        raise PluginError(f"no fitter {name!r} is installed; {among(name, sorted(points))}")
    return points[name]


def installed_names() -> frozenset[str]:
    """Return the names of the installed fitters."""
    return frozenset(_points())


def load_fitter(name: str) -> Fitter:
    """Return a new fitter. Raises PluginError where none of this name is installed or it does not load."""
    point = installed(name)
    return _new(point, f"fitter {name!r} of {_package(point)}")


def load_configured(name: str) -> Fitter:
    """Return a new fitter of what settings or a command line name: an installed one, or `module:Class`.

    Not for names that came in a message: a module is run as soon as it is imported. Raises PluginError.
    """
    return _new(EntryPoint(name, name, GROUP), f"fitter {name!r}") if ":" in name else load_fitter(name)


def run(fitter: Fitter, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
    """Fit recordings, with the polarity of inverted and conjugated ones corrected; the result says so.

    Whatever a third party's fitter raises becomes a PluginError with one sentence. Raises PzctlError.
    """
    right, turned = put_right(task.sweeps)
    try:
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # a warning is no answer for a user
            result = fitter.fit(replace(task, sweeps=right) if turned else task, progress)
    except (PzctlError, MemoryError):
        raise
    except Exception as error:
        raise PluginError(f"fitter {fitter.name!r} failed: {type(error).__name__}: {error}") from error
    says = tuple(turned_says(step, how) for step, how in turned.items())
    return replace(result, says=(*says, *result.says)) if says else result


def _new(point: EntryPoint, what: str) -> Fitter:
    try:
        return point.load()()
    except Exception as error:  # whatever a third party's package does when it is loaded
        raise PluginError(f"{what} does not load: {type(error).__name__}: {error}") from error


def list_fitters() -> list[Listed]:
    """Return all installed fitters; a broken one is listed as broken and the rest go on."""
    listed: list[Listed] = []
    for name, point in sorted(_points().items()):
        try:
            fitter = load_fitter(name)
            listed.append(Listed(name, _package(point), fitter.version, fitter.summary, works=True))
        except PluginError as error:
            listed.append(Listed(name, _package(point), "-", str(error), works=False))
    return listed


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else "an unknown package"
