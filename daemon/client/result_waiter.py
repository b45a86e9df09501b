"""Waiting for a measurement to end, and for what a fitter, or a diagnosis, answers to it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ...fitters.interface import FitError, FitResult
from ...models.sweep import Sweep
from ..wire.events import DiagnosisEvent, FitEvent, ProgressEvent, ReceivedEvent, StateEvent, SweepEvent
from ..wire.replies import FitterState, MissingEvents
from ..wire.result_messages import curves_of, result_of
from .protocol import DaemonError


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
        self.measurement: Measurement | None = None
        """The measurement, once it is complete."""

    def take(self, heard: ReceivedEvent | MissingEvents | None) -> None:
        """Take what was heard. Raises DaemonError where the measurement ended without sweeps, or cannot be known."""
        if isinstance(heard, MissingEvents):
            raise DaemonError(f"measurement {self._id!r}: what became of it is not known; {heard.sentence}", "missing")
        match heard.event if heard is not None else None:
            case ProgressEvent(measurement=m) as event if m == self._id:
                self._progress(event)
            case SweepEvent(measurement=m) if m == self._id and heard is not None:
                self._sweeps.append(heard.sweep())
            case StateEvent(measurement=m, state="measured" | "measured-aside") if m == self._id:
                self.measurement = Measurement(self._id, tuple(self._sweeps))
            case StateEvent(measurement=m, state="failed" | "cancelled" | "abandoned" as state, says=says) if (
                m == self._id
            ):
                raise DaemonError(says or f"the measurement was {state}", state)
            case _:
                pass


class AnswerWaiter:
    """Takes what is heard until a fitter, or a diagnosis, has answered a measurement; of one version where it is given.

    The daemon may answer in its place: that it died, or gave no answer in time.
    """

    def __init__(self, measurement: str, fitter: str, version: str | None = None) -> None:
        self.measurement = measurement
        self.fitter = fitter
        self._version = version
        self._answers: list[ReceivedEvent] = []

    def take(self, *heard: ReceivedEvent) -> None:
        """Keep the answers among what was heard."""
        for one in heard:
            event = one.event
            if (
                isinstance(event, FitEvent | DiagnosisEvent)
                and (event.measurement, event.fitter) == (self.measurement, self.fitter)
                and (self._version in (None, event.version) or is_given_up(one))
            ):
                self._answers.append(one)

    @property
    def answer(self) -> ReceivedEvent | None:
        """The latest answer; one of the version that was asked for goes before one in its place."""
        own = [one for one in self._answers if not is_given_up(one)]
        answers = own if own and self._version is not None else self._answers
        return answers[-1] if answers else None

    def forget_given_up(self) -> None:
        """Forget that the daemon answered in the fitter's place: it is asked once more."""
        self._answers = [one for one in self._answers if not is_given_up(one)]


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
