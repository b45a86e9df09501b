"""What a client asks of the daemon: one request, one answer. The blocking and the asyncio client have these methods."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, TypeVar

from ...fitters.interface import Curve, FitResult
from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from ..wire import replies as reply
from ..wire import requests as ask
from ..wire.events import ReceivedEvent
from ..wire.result_messages import curve_columns, report_of
from ..wire.uuid7 import uuid7
from .protocol import PATIENCE, Conversation, DaemonError, Deliver, Stream, ask_frames, read_events

LOOKS = 20.0
"""Seconds that are waited where the daemon looks through the whole journal."""

BENCH_PATIENCE = 60.0
"""Seconds that a bench command may take."""

A = TypeVar("A", bound=reply.Answer)


class Questions:
    """One conversation for each thing that the daemon can be asked.

    All raise DaemonError where the daemon refuses, does not answer, or has gone.
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
        """Ask who is there; a fitter gives its name and version and is then listed as ready."""
        return self.answer_to(ask.HelloRequest(id=uuid7(), fitter=fitter, version=version), reply.HelloAnswer)

    def status(self) -> Conversation[reply.StatusAnswer]:
        """Ask what is going on."""
        return self.answer_to(ask.StatusRequest(id=uuid7()), reply.StatusAnswer)

    def metrics(self) -> Conversation[reply.MetricsAnswer]:
        """Ask what was counted and timed since the daemon began."""
        return self.answer_to(ask.MetricsRequest(id=uuid7()), reply.MetricsAnswer)

    def settings(self) -> Conversation[dict[str, Any]]:
        """Ask how the daemon was started."""
        return (yield from self.answer_to(ask.SettingsRequest(id=uuid7()), reply.SettingsAnswer)).settings

    def samples(self, name: str | None = None) -> Conversation[tuple[reply.SampleHistory, ...]]:
        """Return what was measured, by sample; only of sample `name` where one is given."""
        request = ask.SamplesRequest(id=uuid7(), name=name)
        return (yield from self.answer_to(request, reply.SamplesAnswer, patience=LOOKS)).samples

    def sweeps(self, measurement: str) -> Conversation[tuple[ReceivedEvent, ...]]:
        """Return the sweep events of a measurement, after those of the latest one of each earlier step."""
        return self._ask_events(ask.SweepsRequest(id=uuid7(), measurement=measurement))

    def fits(self, measurement: str) -> Conversation[tuple[ReceivedEvent, ...]]:
        """Return what the fitters answered to a measurement: fit and diagnosis events."""
        return self._ask_events(ask.FitsRequest(id=uuid7(), measurement=measurement))

    def unanswered(self, fitter: str) -> Conversation[tuple[str, ...]]:
        """Return the measurements of the daemon's run that a fitter has not answered."""
        request = ask.UnansweredRequest(id=uuid7(), fitter=fitter)
        return (yield from self.answer_to(request, reply.MeasurementsAnswer)).measurements

    def bench(self, command: dict[str, Any]) -> Conversation[dict[str, Any]]:
        """Give the simulator's bench a command; return what it answers."""
        request = ask.BenchRequest(id=uuid7(), command=command)
        return (yield from self.answer_to(request, reply.BenchAnswer, patience=BENCH_PATIENCE)).answer

    def begin(
        self,
        build: Build,
        step: str,
        plan: SweepPlan | None = None,
        *,
        priority: int = 0,
        lease: str | None = None,
        decides: str | None = None,
    ) -> Conversation[str]:
        """Ask for a measurement and do not wait for it; return its id. The arguments are those of `measure`."""
        request = ask.MeasureRequest(
            id=uuid7(), build=build, step=step, plan=plan, priority=priority, lease=lease, decides=decides
        )
        return (yield from self.answer_to(request, reply.MeasureAnswer)).measurement

    def cancel(self, measurement: str | None = None) -> Conversation[None]:
        """Cancel a measurement; the running one where none is named."""
        yield from self.answer_to(ask.CancelRequest(id=uuid7(), measurement=measurement), reply.Answer)

    def lease(self, owner: str, seconds: float = 60.0) -> Stream[str]:
        """Have the instrument to oneself; give the id that `measure` needs meanwhile. Expires after `seconds`.

        The daemon lets go of the instrument, so that other tools may talk to it. Raises DaemonError where it is
        leased to another one already (code `leased`) or measures (code `busy`).
        """
        request = ask.LeaseRequest(id=uuid7(), owner=owner, seconds=seconds)
        held = (yield from self.answer_to(request, reply.LeaseAnswer)).lease
        try:
            yield Deliver(held)
        finally:
            with suppress(DaemonError):  # it may have expired
                yield from self.answer_to(ask.ReleaseRequest(id=uuid7(), lease=held), reply.Answer)

    def submit(
        self, measurement: str, sweeps: Sequence[str], fitter: str, version: str, answer: FitResult | str
    ) -> Conversation[None]:
        """Hand in a fitter's answer: a result, or the sentence that says why there is none."""
        if isinstance(answer, str):
            fields, curves = {"error": answer}, ()
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
        """Hand in a diagnosis: the object that `pzctl diagnose --json` prints, and the curves of its picture."""
        return self._submit(measurement, sweeps, fitter, version, curves, diagnosis=diagnosis)

    def shutdown(self) -> Conversation[None]:
        """End the daemon; what runs is cancelled, the bias is off, the instrument let go of."""
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
