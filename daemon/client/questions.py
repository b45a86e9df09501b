"""The client's methods that are one request and one answer, shared by the blocking and the asyncio client."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, TypedDict, TypeVar, Unpack

from ...fitters.interface import Curve, FitResult
from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from ..wire import replies as reply
from ..wire import requests as ask
from ..wire.events import ReceivedEvent
from ..wire.result_messages import curve_columns, report_of
from ..wire.uuid7 import uuid7
from .protocol import PATIENCE, Conversation, DaemonError, Deliver, Stream, ask_frames, read_events

A = TypeVar("A", bound=reply.Answer)


class MeasureOptions(TypedDict, total=False):
    """Options of a measurement; without them, the defaults of `MeasureRequest`."""

    priority: int
    """A higher one (-10 .. 10) goes first."""
    lease: str | None
    """Needed while the instrument is leased."""
    decides: str | None
    """The id of the measurement whose diagnosis this one helps to decide."""
    analyzer: str | None
    """The name of one of the daemon's analyzers; None: the first one that this client may use."""


class Questions:
    """One conversation for each kind of request to the daemon.

    All raise DaemonError if the daemon refuses, does not answer or has ended.
    """

    def __init__(self, events: str, requests: str) -> None:
        self._events = events
        self._requests = requests

    def answer_to(
        self, request: ask.Request, expected: type[A], raw: Sequence[bytes] = (), patience: float = PATIENCE
    ) -> Conversation[A]:
        """Return the answer to any request."""
        return (yield from ask_frames(self._requests, request, expected, raw, patience))[0]

    def hello(self, fitter: str | None = None, version: str | None = None) -> Conversation[reply.HelloAnswer]:
        """Return the daemon's version and instrument; a fitter gives its name and version to be listed as ready."""
        return self.answer_to(ask.HelloRequest(id=uuid7(), fitter=fitter, version=version), reply.HelloAnswer)

    def status(self) -> Conversation[reply.StatusAnswer]:
        """Return what is measured, what waits, and the state of the fitters."""
        return self.answer_to(ask.StatusRequest(id=uuid7()), reply.StatusAnswer)

    def metrics(self) -> Conversation[reply.MetricsAnswer]:
        """Return the counters and times since the daemon started."""
        return self.answer_to(ask.MetricsRequest(id=uuid7()), reply.MetricsAnswer)

    def settings(self) -> Conversation[dict[str, Any]]:
        """Return the settings that the daemon was started with."""
        return (yield from self.answer_to(ask.SettingsRequest(id=uuid7()), reply.SettingsAnswer)).settings

    def samples(self, name: str | None = None) -> Conversation[tuple[reply.SampleHistory, ...]]:
        """Return the measurements of each sample, or only of sample `name`."""
        request = ask.SamplesRequest(id=uuid7(), name=name)
        return (yield from self.answer_to(request, reply.SamplesAnswer)).samples

    def sweeps(self, measurement: str) -> Conversation[tuple[ReceivedEvent, ...]]:
        """Return the sweep events of the latest measurement of each earlier step, then those of this measurement."""
        return self._ask_events(ask.SweepsRequest(id=uuid7(), measurement=measurement))

    def fits(self, measurement: str) -> Conversation[tuple[ReceivedEvent, ...]]:
        """Return the fit and diagnosis events of a measurement."""
        return (yield from self.answers(measurement))[0]

    def answers(self, measurement: str) -> Conversation[tuple[tuple[ReceivedEvent, ...], dict[str, str]]]:
        """Return what `fits` returns, and by fitter why its latest answer could not be kept in the journal."""
        request = ask.FitsRequest(id=uuid7(), measurement=measurement)
        answer, frames = yield from ask_frames(self._requests, request, reply.EventsAnswer)
        return tuple(read_events(answer, frames)), answer.not_kept

    def unanswered(self, fitter: str) -> Conversation[tuple[str, ...]]:
        """Return the ids of the measurements of this run that a fitter has not answered."""
        request = ask.UnansweredRequest(id=uuid7(), fitter=fitter)
        return (yield from self.answer_to(request, reply.MeasurementsAnswer)).measurements

    def bench(self, command: dict[str, Any], analyzer: str | None = None) -> Conversation[dict[str, Any]]:
        """Send a command to the simulator's bench, by default that of the first analyzer; return its answer."""
        request = ask.BenchRequest(id=uuid7(), command=command, analyzer=analyzer)
        return (yield from self.answer_to(request, reply.BenchAnswer)).answer

    def begin(
        self, build: Build, step: str, plan: SweepPlan | None = None, **options: Unpack[MeasureOptions]
    ) -> Conversation[str]:
        """Request a measurement without waiting for it, and return its id. The arguments are those of `measure`."""
        return (yield from self.begun(ask.MeasureRequest(id=uuid7(), build=build, step=step, plan=plan, **options)))

    def begun(self, request: ask.MeasureRequest) -> Conversation[str]:
        """Send a request for a measurement, once or again, and return its id."""
        return (yield from self.answer_to(request, reply.MeasureAnswer)).measurement

    def cancel(self, measurement: str | None = None, analyzer: str | None = None) -> Conversation[None]:
        """Cancel a measurement, by default the running one of the first analyzer or of the one named."""
        request = ask.CancelRequest(id=uuid7(), measurement=measurement, analyzer=analyzer)
        yield from self.answer_to(request, reply.Answer)

    def lease(self, owner: str, seconds: float = 60.0, analyzer: str | None = None) -> Stream[str]:
        """Lease an instrument for exclusive use; deliver the id that `measure` needs meanwhile.

        The lease expires after `seconds`. The daemon closes its connection to the instrument, so that other tools may
        use it. Raises DaemonError if it is leased to another owner (code `leased`) or measures (code `busy`).
        """
        request = ask.LeaseRequest(id=uuid7(), owner=owner, seconds=seconds, analyzer=analyzer)
        lease_id = (yield from self.answer_to(request, reply.LeaseAnswer)).lease
        try:
            yield Deliver(lease_id)
        finally:
            with suppress(DaemonError):  # it may have expired
                yield from self.answer_to(ask.ReleaseRequest(id=uuid7(), lease=lease_id), reply.Answer)

    def submit(
        self, measurement: str, sweeps: Sequence[str], fitter: str, version: str, answer: FitResult | str
    ) -> Conversation[None]:
        """Submit a fitter's answer: a result, or the sentence that says why there is none (its first 4000 letters)."""
        if isinstance(answer, str):
            fields, curves = {"error": answer[: ask.LONGEST_ERROR]}, ()
        else:
            fields, curves = {"report": report_of(answer)}, answer.curves
        return self._submit(measurement, sweeps, fitter, version, curves, **fields)

    def submit_diagnosis(
        self,
        measurement: str,
        sweeps: Sequence[str],
        fitter: str,
        version: str,
        diagnosis: dict[str, Any],
        curves: Sequence[Curve] = (),
    ) -> Conversation[None]:
        """Submit a diagnosis: the object that `pzctl diagnose --json` prints, and the curves of its picture."""
        return self._submit(measurement, sweeps, fitter, version, curves, diagnosis=diagnosis)

    def shutdown(self) -> Conversation[None]:
        """Stop the daemon, which cancels the running measurement, turns the bias off and releases the instrument."""
        yield from self.answer_to(ask.ShutdownRequest(id=uuid7()), reply.Answer)

    def _ask_events(self, request: ask.Request) -> Conversation[tuple[ReceivedEvent, ...]]:
        answer, frames = yield from ask_frames(self._requests, request, reply.EventsAnswer)
        return tuple(read_events(answer, frames))

    def _submit(
        self,
        measurement: str,
        sweeps: Sequence[str],
        fitter: str,
        version: str,
        curves: Sequence[Curve],
        **fields: Any,
    ) -> Conversation[None]:
        columns, raw = curve_columns(curves)
        request = ask.SubmitRequest(
            id=uuid7(),
            measurement=measurement,
            sweeps=tuple(sweeps),
            fitter=fitter,
            version=version,
            curves=tuple(curve.step for curve in curves),
            columns=columns,
            **fields,
        )
        yield from self.answer_to(request, reply.Answer, raw)
