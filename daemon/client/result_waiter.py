"""Waiting for the end of a measurement, and for the fit or diagnosis of one."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ...fitters.interface import FitError, FitResult
from ...models.sweep import Sweep
from ..wire.events import DiagnosisEvent, FitEvent, ProgressEvent, ReceivedEvent, StateEvent, SweepEvent
from ..wire.replies import FitterState, MissingEvents
from ..wire.result_messages import curves_of, result_of
from .protocol import DaemonError, UnreadableEvent


@dataclass(frozen=True, eq=False)
class Measurement:
    """A complete measurement of one step."""

    id: str
    sweeps: tuple[Sweep, ...]
    """One for each segment of the plan."""


class MeasurementWaiter:
    """Collects the events of a measurement until it has ended."""

    def __init__(self, measurement: str, progress: Callable[[ProgressEvent], None]) -> None:
        self._id = measurement
        self._progress = progress
        self._sweeps: list[Sweep] = []
        self._segments = 0
        self._unreadable = ""
        self.measurement: Measurement | None = None
        """The measurement, once it is complete."""

    def take(self, received: ReceivedEvent | MissingEvents | None) -> None:
        """Take an event. Raises DaemonError if the measurement ended without sweeps or its events are missing."""
        if isinstance(received, UnreadableEvent):  # probably of somebody else
            self._unreadable = received.sentence
            return
        if isinstance(received, MissingEvents):
            raise DaemonError(f"measurement {self._id!r}: its outcome is unknown; {received.sentence}", "missing")
        match received.event if received is not None else None:
            case ProgressEvent(measurement=m) as event if m == self._id:
                self._progress(event)
            case SweepEvent(measurement=m, segments=segments) if m == self._id and received is not None:
                self._sweeps.append(received.sweep())
                self._segments = segments
            case StateEvent(measurement=m, state="measured" | "measured-aside") if m == self._id:
                if self._unreadable and len(self._sweeps) < max(1, self._segments):
                    raise DaemonError(f"measurement {self._id!r}: a sweep is lost; {self._unreadable}", "missing")
                self.measurement = Measurement(self._id, tuple(self._sweeps))
            case StateEvent(measurement=m, state="failed" | "cancelled" | "abandoned" as state, says=says) if (
                m == self._id
            ):
                raise DaemonError(says or f"the measurement was {state}", state)
            case _:
                pass


class AnswerWaiter:
    """Collects events until a fitter, or a diagnosis, has answered a measurement; of one version only if it is given.

    The daemon answers in place of a fitter that crashed or gave no answer in time.
    """

    def __init__(self, measurement: str, fitter: str, version: str | None = None) -> None:
        self.measurement = measurement
        self.fitter = fitter
        self._version = version
        self._answers: list[ReceivedEvent] = []

    def take(self, *received: ReceivedEvent) -> None:
        """Keep the answers among these events."""
        for message in received:
            event = message.event
            if (
                isinstance(event, FitEvent | DiagnosisEvent)
                and (event.measurement, event.fitter) == (self.measurement, self.fitter)
                and (self._version in (None, event.version) or is_given_up(message))
            ):
                self._answers.append(message)

    @property
    def answer(self) -> ReceivedEvent | None:
        """The latest answer; one of the requested version precedes one that the daemon gave in its place."""
        genuine = [answer for answer in self._answers if not is_given_up(answer)]
        answers = genuine if genuine and self._version is not None else self._answers
        return answers[-1] if answers else None

    def forget_given_up(self) -> None:
        """Forget the answers that the daemon gave in the fitter's place, because the fitter is asked again."""
        self._answers = [answer for answer in self._answers if not is_given_up(answer)]


def require(fitter: str, states: Iterable[FitterState]) -> None:
    """Raise DaemonError if the daemon does not run this fitter or the fitter is broken."""
    known = {state.name: state for state in states}
    if fitter not in known:
        raise DaemonError(
            f"fitter {fitter!r}: this daemon does not run it; it runs {', '.join(known) or 'none'}", "no-such-fitter"
        )
    if known[fitter].state == "broken":
        raise DaemonError(f"fitter {fitter!r}: it cannot run: {known[fitter].says}", "broken-fitter")


def is_given_up(answer: ReceivedEvent) -> bool:
    """Return whether the daemon gave this answer in place of a fitter that crashed or hung."""
    return isinstance(answer.event, FitEvent) and answer.event.version == ""


def fit_of(answer: ReceivedEvent) -> FitResult:
    """Return the result in a fit event. Raises FitError if the fitter refused."""
    event = answer.event
    if not isinstance(event, FitEvent) or event.report is None:
        raise FitError((event.error if isinstance(event, FitEvent) else None) or "this event holds no fit")
    return result_of(event.report, curves_of(event.curves, answer.arrays))


def diagnosis_of(answer: ReceivedEvent) -> dict[str, Any]:
    """Return the diagnosis in a diagnosis event. Raises FitError if the diagnosis was refused."""
    event = answer.event
    if isinstance(event, DiagnosisEvent):
        return event.diagnosis
    raise FitError((event.error if isinstance(event, FitEvent) else None) or "this event holds no diagnosis")
