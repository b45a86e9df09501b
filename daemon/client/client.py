"""Talk to a running daemon: measure, wait for fits, listen, look things up.

with connect() as lab:
    measurement = lab.measure(build, "disk")
    result = lab.wait_fit("mason", measurement.id)
"""

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import zmq

from ...fitters.interface import Curve, FitResult
from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from ..files.auto_diagnosis import DIAGNOSIS
from ..wire import replies as reply
from ..wire import requests as ask
from ..wire.curve_keys import ClientKey
from ..wire.events import ProgressEvent, ReceivedEvent
from ..wire.result_messages import curve_columns, report_of
from ..wire.uuid7 import uuid7
from .connection import LOOKS, DaemonError, RequestClient, Subscription
from .location import address
from .result_waiter import Answers, Measurement, MeasurementWaiter, diagnosis_of, fit_of, require

BENCH_PATIENCE = 60.0
"""Seconds that a bench command may take."""


def connect(events: str | None = None, requests: str | None = None, key: str | Path | None = None) -> "Client":
    """Return a client of the daemon at these endpoints, or of the one that runs here.

    `key` is the file that `pzctl keys client` made; a daemon on another machine asks for one. Raises DaemonError
    where none runs, or none answers, KeyFileError where the key cannot be used.
    """
    return Client(*address(events, requests, key))


class Client:
    """A connection to a daemon; use it as a context manager. For one thread.

    Every method raises DaemonError where the daemon refuses, does not answer, or has gone.
    """

    def __init__(self, events: str, requests: str, key: ClientKey | None = None) -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._asker = RequestClient(self._context, requests, key)
        self._key = key
        self._endpoint = events
        self._subscription: Subscription | None = None
        self._answers = Answers()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the sockets."""
        self._asker.close()
        if self._subscription is not None:
            self._subscription.close()
        self._context.term()

    def hello(self, fitter: str | None = None, version: str | None = None) -> reply.HelloAnswer:
        """Ask who is there; a fitter gives its name and version and is then listed as ready."""
        return self._asker.ask(ask.HelloRequest(id=uuid7(), fitter=fitter, version=version), reply.HelloAnswer)

    def status(self) -> reply.StatusAnswer:
        """Ask what is going on."""
        return self._asker.ask(ask.StatusRequest(id=uuid7()), reply.StatusAnswer)

    def metrics(self) -> reply.MetricsAnswer:
        """Ask what was counted and timed since the daemon began."""
        return self._asker.ask(ask.MetricsRequest(id=uuid7()), reply.MetricsAnswer)

    def settings(self) -> dict[str, Any]:
        """Ask how the daemon was started."""
        return self._asker.ask(ask.SettingsRequest(id=uuid7()), reply.SettingsAnswer).settings

    def samples(self, name: str | None = None) -> tuple[reply.SampleHistory, ...]:
        """Return what was measured, by sample; only of sample `name` where one is given."""
        return self._asker.ask(ask.SamplesRequest(id=uuid7(), name=name), reply.SamplesAnswer, patience=LOOKS).samples

    def sweeps(self, measurement: str) -> tuple[ReceivedEvent, ...]:
        """Return the sweep events of a measurement, after those of the latest one of each earlier step."""
        return tuple(self._asker.events(ask.SweepsRequest(id=uuid7(), measurement=measurement))[0])

    def fits(self, measurement: str) -> tuple[ReceivedEvent, ...]:
        """Return what the fitters answered to a measurement: fit and diagnosis events."""
        return tuple(self._asker.events(ask.FitsRequest(id=uuid7(), measurement=measurement))[0])

    def unanswered(self, fitter: str) -> tuple[str, ...]:
        """Return the measurements of the daemon's run that a fitter has not answered."""
        return self._asker.ask(ask.UnansweredRequest(id=uuid7(), fitter=fitter), reply.MeasurementsAnswer).measurements

    def bench(self, command: dict[str, Any]) -> dict[str, Any]:
        """Give the simulator's bench a command; return what it answers."""
        request = ask.BenchRequest(id=uuid7(), command=command)
        return self._asker.ask(request, reply.BenchAnswer, patience=BENCH_PATIENCE).answer

    def cancel(self, measurement: str | None = None) -> None:
        """Cancel a measurement; the running one where none is named."""
        self._asker.ask(ask.CancelRequest(id=uuid7(), measurement=measurement), reply.Answer)

    def shutdown(self) -> None:
        """End the daemon; what runs is cancelled, the bias is off, the instrument let go of."""
        self._asker.ask(ask.ShutdownRequest(id=uuid7()), reply.Answer)

    def replay(self, since: int, until: int | None = None) -> Iterator[ReceivedEvent]:
        """Yield the events `since` .. `until` (both included, None: the newest) from the journal, in order."""
        more = True
        while more:
            heard, more = self._asker.events(ask.ReplayRequest(id=uuid7(), since=since, until=until))
            yield from heard
            since = heard[-1].event.seq + 1 if heard else since

    def listen(self, patience: float) -> Iterator[ReceivedEvent]:
        """Return every event from now on, in order, none lost; they end when none comes within `patience` seconds."""
        subscription = self._subscribed()
        return iter(lambda: subscription.receive(patience), None)

    def measure(
        self,
        build: Build,
        step: str,
        plan: SweepPlan | None = None,
        progress: Callable[[ProgressEvent], None] = lambda _: None,
        *,
        priority: int = 0,
        lease: str | None = None,
        decides: str | None = None,
    ) -> Measurement:
        """Measure a step of a build and wait for it; Ctrl-C cancels the measurement.

        `plan` is the build's own where none is given; a higher `priority` (-10 .. 10) goes first; `lease` is needed
        while the instrument is leased; `decides` is the measurement whose diagnosis it is to decide. Raises
        DaemonError with the daemon's sentence where the measurement failed or was cancelled.
        """
        subscription = self._subscribed()
        measurement = self.begin(build, step, plan, priority=priority, lease=lease, decides=decides)
        try:
            return self._follow(subscription, measurement, progress)
        except KeyboardInterrupt:
            with suppress(DaemonError):  # it may have ended by itself in the meantime
                self.cancel(measurement)
            raise

    def begin(
        self,
        build: Build,
        step: str,
        plan: SweepPlan | None = None,
        *,
        priority: int = 0,
        lease: str | None = None,
        decides: str | None = None,
    ) -> str:
        """Ask for a measurement and do not wait for it; return its id."""
        request = ask.MeasureRequest(
            id=uuid7(), build=build, step=step, plan=plan, priority=priority, lease=lease, decides=decides
        )
        return self._asker.ask(request, reply.MeasureAnswer).measurement

    @contextmanager
    def lease(self, owner: str, seconds: float = 60.0) -> Generator[str]:
        """Have the instrument to oneself; give the id that `measure` needs meanwhile. Expires after `seconds`.

        The daemon lets go of the instrument, so that other tools may talk to it. Raises DaemonError where it is
        leased to another one already (code `leased`) or measures (code `busy`).
        """
        held = self._asker.ask(ask.LeaseRequest(id=uuid7(), owner=owner, seconds=seconds), reply.LeaseAnswer).lease
        try:
            yield held
        finally:
            with suppress(DaemonError):  # it may have expired
                self._asker.ask(ask.ReleaseRequest(id=uuid7(), lease=held), reply.Answer)

    def wait_fit(self, fitter: str, measurement: str, patience: float = 120.0) -> FitResult:
        """Return what a fitter answered to a measurement, waiting for it.

        Raises FitError where the fitter refused, DaemonError where it does not run or does not answer in time.
        """
        self._subscribed()
        self._answers.note(self.fits(measurement))
        return fit_of(self._answer(measurement, fitter, None, patience, kept=True))

    def fit(self, measurement: str, fitter: str, patience: float = 600.0) -> FitResult:
        """Have a measurement fitted by any fitter that is installed beside the daemon, unless it was already.

        Raises FitError where the fitter refused, DaemonError where it is not installed or does not answer in time.
        """
        self._subscribed()
        self._answers.note(self.fits(measurement))
        self._answers.forget_given_up(measurement, fitter)
        if self._answers.find(measurement, fitter) is None:
            self._asker.ask(ask.FitRequest(id=uuid7(), measurement=measurement, fitter=fitter), reply.JobAnswer)
        return fit_of(self._answer(measurement, fitter, None, patience))

    def diagnose(
        self,
        measurement: str,
        effects: Sequence[str] | None = None,
        patience: float = 1200.0,
        *,
        also: Sequence[str] = (),
        propose: bool = False,
    ) -> dict[str, Any]:
        """Have a measurement diagnosed; return the object that `pzctl diagnose --json` prints.

        `also` are measurements that were made to decide it; `propose` asks which measurements would decide what stays
        open: they are `would_measure` in what is returned. Raises FitError where it cannot be, DaemonError where an
        effect is not known or no answer comes in time.
        """
        self._subscribed()
        request = ask.DiagnoseRequest(id=uuid7(), measurement=measurement, **_wishes(effects, also, propose))
        wanted = self._asker.ask(request, reply.JobAnswer)
        self._answers.note(self.fits(measurement))
        self._answers.forget_given_up(measurement, wanted.fitter)
        return diagnosis_of(self._answer(measurement, wanted.fitter, wanted.version, patience))

    def wait_diagnosis(self, measurement: str, patience: float = 300.0) -> dict[str, Any]:
        """Return the diagnosis of a measurement that the daemon makes by itself, waiting for it.

        Raises FitError where it cannot be diagnosed, DaemonError where no answer comes in time.
        """
        self._subscribed()
        self._answers.note(self.fits(measurement))
        return diagnosis_of(self._answer(measurement, DIAGNOSIS, None, patience))

    def submit(
        self, measurement: str, sweeps: Sequence[str], fitter: str, version: str, answer: FitResult | str
    ) -> None:
        """Hand in a fitter's answer: a result, or the sentence that says why there is none."""
        if isinstance(answer, str):
            request, raw = self._submission(measurement, sweeps, fitter, version, error=answer), ()
        else:
            columns, raw = curve_columns(answer.curves)
            curves = tuple(curve.step for curve in answer.curves)
            report = report_of(answer)
            request = self._submission(
                measurement, sweeps, fitter, version, report=report, curves=curves, columns=columns
            )
        self._asker.ask(request, reply.Answer, raw)

    def submit_diagnosis(
        self,
        measurement: str,
        sweeps: Sequence[str],
        fitter: str,
        version: str,
        diagnosis: dict[str, Any],
        curves: Sequence[Curve] = (),
    ) -> None:
        """Hand in a diagnosis: the object that `pzctl diagnose --json` prints, and the curves of its picture."""
        columns, raw = curve_columns(curves)
        steps = tuple(curve.step for curve in curves)
        found = {"diagnosis": diagnosis, "curves": steps, "columns": columns}
        self._asker.ask(self._submission(measurement, sweeps, fitter, version, **found), reply.Answer, raw)

    @staticmethod
    def _submission(
        measurement: str, sweeps: Sequence[str], fitter: str, version: str, **answer: Any
    ) -> ask.SubmitRequest:
        return ask.SubmitRequest(
            id=uuid7(), measurement=measurement, sweeps=tuple(sweeps), fitter=fitter, version=version, **answer
        )

    def _subscribed(self) -> Subscription:
        if self._subscription is None:
            self._subscription = Subscription(self._context, self._endpoint, self._asker, self._key)
        return self._subscription

    def _follow(
        self, subscription: Subscription, measurement: str, progress: Callable[[ProgressEvent], None]
    ) -> Measurement:
        """Listen until a measurement has ended. Raises DaemonError where it ended without sweeps."""
        following = MeasurementWaiter(measurement, progress)
        while True:
            heard = subscription.receive(1.0)
            self._answers.note([heard] if heard else [])
            found = following.take(heard) if heard else None
            if found is not None:
                return found

    def _answer(
        self, measurement: str, fitter: str, version: str | None, patience: float, *, kept: bool = False
    ) -> ReceivedEvent:
        """Listen until there is an answer, of this version where one is given, or one in the fitter's place.

        Raises DaemonError where none comes in time, or where a fitter that has to be a `kept` one is none.
        """
        subscription = self._subscribed()
        deadline = time.monotonic() + patience
        while True:
            found = self._answers.find(measurement, fitter, version) or self._answers.find(measurement, fitter, "")
            if found is not None:
                return found
            if kept:
                require(fitter, self.status().fitters)
            heard = subscription.receive(min(1.0, max(0.0, deadline - time.monotonic())))
            self._answers.note([heard] if heard else [])
            if heard is None and time.monotonic() > deadline:
                raise DaemonError(f"fitter {fitter!r}: no answer within {patience:g} s", "no-answer")


def _wishes(effects: Sequence[str] | None, also: Sequence[str], propose: bool) -> dict[str, Any]:
    return {"effects": tuple(effects) if effects else None, "also": tuple(also), "propose": propose}
