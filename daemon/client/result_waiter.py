"""Waiting for a measurement to end, and for what a fitter, or a diagnosis, answers to it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ...fitters.interface import FitError, FitResult
from ...models.sweep import Sweep
from ..wire.events import DiagnosisEvent, FitEvent, ProgressEvent, ReceivedEvent, StateEvent, SweepEvent
from ..wire.replies import FitterState
from ..wire.result_messages import curves_of, result_of
from .connection import DaemonError


@dataclass(frozen=True, eq=False)
class Measurement:
    """What was measured at one step."""

    id: str
    sweeps: tuple[Sweep, ...]
    """One for each segment of the plan."""


class MeasurementWaiter:
    """Takes what is heard until a measurement has ended."""

    def __init__(self, measurement: str, progress: Callable[[ProgressEvent], None]) -> None:
        self._id = measurement
        self._progress = progress
        self._sweeps: list[Sweep] = []

    def take(self, heard: ReceivedEvent) -> Measurement | None:
        """Return the measurement once it is complete. Raises DaemonError where it ended without sweeps."""
        match heard.event:
            case ProgressEvent(measurement=m) as event if m == self._id:
                self._progress(event)
            case SweepEvent(measurement=m) if m == self._id:
                self._sweeps.append(heard.sweep())
            case StateEvent(measurement=m, state="measured" | "measured-aside") if m == self._id:
                return Measurement(self._id, tuple(self._sweeps))
            case StateEvent(measurement=m, state="failed" | "cancelled" | "abandoned" as state, says=says) if (
                m == self._id
            ):
                raise DaemonError(says or f"the measurement was {state}", state)
            case _:
                pass
        return None


class Answers:
    """The answers heard so far, the latest of each kept: for whoever waits for them later."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str | None], ReceivedEvent] = {}

    def note(self, heard: Iterable[ReceivedEvent]) -> None:
        """Keep those that are answers."""
        for one in heard:
            event = one.event
            if isinstance(event, FitEvent | DiagnosisEvent):
                for version in (event.version, None):
                    self._found[event.measurement, event.fitter, version] = one

    def find(self, measurement: str, fitter: str, version: str | None = None) -> ReceivedEvent | None:
        """Return the latest answer; of this version where one is given."""
        return self._found.get((measurement, fitter, version))

    def forget_given_up(self, measurement: str, fitter: str) -> None:
        """Forget that the daemon answered in a fitter's place: it is asked once more."""
        for key in [(measurement, fitter, ""), (measurement, fitter, None)]:
            one = self._found.get(key)
            if one is not None and is_given_up(one):
                del self._found[key]


def require(fitter: str, states: Iterable[FitterState]) -> None:
    """Raise DaemonError where waiting for a fitter that the daemon keeps is of no use."""
    known = {state.name: state for state in states}
    if fitter not in known:
        raise DaemonError(
            f"fitter {fitter!r}: this daemon does not run it; it runs {', '.join(known) or 'none'}", "no-such-fitter"
        )
    if known[fitter].state == "broken":
        raise DaemonError(f"fitter {fitter!r}: it cannot run: {known[fitter].says}", "broken-fitter")


def is_given_up(heard: ReceivedEvent) -> bool:
    """Return whether the daemon answered in the place of a fitter that died or hung."""
    return isinstance(heard.event, FitEvent) and heard.event.version == ""


def fit_of(heard: ReceivedEvent) -> FitResult:
    """Return the result that a fit event carries. Raises FitError where it is a refusal."""
    event = heard.event
    if not isinstance(event, FitEvent) or event.report is None:
        raise FitError((event.error if isinstance(event, FitEvent) else None) or "this event holds no fit")
    return result_of(event.report, curves_of(event.curves, heard.arrays))


def diagnosis_of(heard: ReceivedEvent) -> dict[str, Any]:
    """Return what a diagnosis event says. Raises FitError where it is a refusal."""
    if isinstance(heard.event, DiagnosisEvent):
        return heard.event.diagnosis
    raise FitError(
        (heard.event.error if isinstance(heard.event, FitEvent) else None) or "this event holds no diagnosis"
    )
