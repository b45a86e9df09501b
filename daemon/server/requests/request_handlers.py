"""The handlers of all requests but `bench`: look-ups, changes of the queue, answers of fitters."""

import hashlib
import os
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import cache, singledispatchmethod
from importlib.metadata import version
from typing import Any

import msgspec

from ....fitters.plugins import installed_names
from ....models.base.names import among
from ....models.build import Build
from ....models.sweep_plan import PlanError, SweepPlan
from ...files.builds.build_table import BuildError
from ...files.builds.sent_build import check_sent_build
from ...journal.journal_reader import MOST_REPLAYED, History, JournalMeasurement, JournalReader
from ...journal.journal_writer import JournalWriter
from ...journal.store import JournalError
from ...journal.stores.event_rows import WITHDRAWN
from ...journal.withdrawal import WithdrawalError, withdrawal_event
from ...wire import replies as reply
from ...wire import requests as ask
from ...wire.curve_keys import LOCAL
from ...wire.events import WIRE, Event, Payload, SampleStep, StateEvent, envelope
from ...wire.frames import to_json
from ...wire.metrics import Metrics
from ..analyzers.acquisition import MeasurementJob
from ..analyzers.served_analyzers import ServedAnalyzer, ServedAnalyzers
from ..publishing.durable_publisher import logged_if_not_kept
from ..workers.job_runner import JobRunner, WorkerJob
from ..workers.job_worker import diagnosis_version
from ..workers.supervisor import Supervisor
from .request_errors import RequestError
from .submissions import checked

MOST_FITTERS = 100
"""Greatest number of fitters in the list."""

MOST_WAITING = 1000
"""Greatest number of measurements of one client in an analyzer's queue: nobody can fill it for the others."""


VERSION = version("pzctl")
"""Version of this package; determined once, since it is read from a file."""

_installed = cache(installed_names)  # a look-up takes tens of milliseconds


@dataclass
class RequestHandlers:
    """The daemon's answers to requests, and the parts of the daemon that they need."""

    journal: JournalWriter
    analyzers: ServedAnalyzers
    supervisor: Supervisor
    jobs: JobRunner
    endpoints: tuple[str, str]
    settings: dict[str, Any]
    begin: Callable[[str, Build, str, StateEvent], tuple[str, bool]]
    """Records and publishes an accepted measurement; see `DurablePublisher.begin`."""
    publish: Callable[[Event, Payload], None]
    shutdown: Callable[[], None]
    metrics: Metrics
    backup: Callable[[], reply.BackupState | None]
    not_kept_answers: dict[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    """By fitter: the measurement whose answer the journal could not keep, and why."""

    @singledispatchmethod
    def answer(self, request: ask.Request, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        """Return the answer to a request of `client` (the name of its key), and the frames that follow it.

        `raw` are the frames after the request's header. Raises RequestError, JournalError or WireError.
        """
        raise NotImplementedError(type(request).__name__)

    @answer.register
    def _(self, request: ask.HelloRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        if request.fitter is not None:
            self._list_fitter(request.fitter, request.version or "", client)
        usable = tuple(one.state for one in self.analyzers.of(client))
        return (
            reply.HelloAnswer(
                id=request.id,
                wire=WIRE,
                version=VERSION,
                pid=os.getpid(),
                run=self.journal.run,
                seq=self.journal.last_seq,
                instrument=usable[0].instrument,
                events=self.endpoints[0],
                requests=self.endpoints[1],
                bench=usable[0].bench,
                fitters=tuple(self.supervisor.states.values()),
                analyzers=usable,
            ),
            [],
        )

    @answer.register
    def _(self, request: ask.StatusRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        usable = tuple(one.state for one in self.analyzers.of(client))
        return (
            reply.StatusAnswer(
                id=request.id,
                run=self.journal.run,
                seq=self.journal.last_seq,
                measuring=usable[0].measuring,
                sample=usable[0].sample,
                queue=usable[0].queue,
                fitters=tuple(self.supervisor.states.values()),
                garbage=self.metrics.counts["garbage"],
                lease=usable[0].lease,
                backup=self.backup(),
                analyzers=usable,
            ),
            [],
        )

    @answer.register
    def _(self, request: ask.MetricsRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        metrics = self.metrics
        return (
            reply.MetricsAnswer(
                id=request.id,
                uptime=time.monotonic() - metrics.began,
                counts=dict(metrics.counts),
                queue=self.analyzers.waiting,
                errands=len(self.jobs.running),
                seconds=metrics.spreads(),
            ),
            [],
        )

    @answer.register
    def _(self, request: ask.SettingsRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        return reply.SettingsAnswer(id=request.id, settings=self.settings), []

    @answer.register
    def _(self, request: ask.MeasureRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        on = self.analyzers.named(request.analyzer, client)
        steps = [step.name for step in request.build.steps]
        if request.step not in steps:
            raise RequestError(
                "no-such-step", f"build {request.build.name!r} has no step {request.step!r}; it has {', '.join(steps)}"
            )
        try:
            check_sent_build(request.build, "build")
        except BuildError as error:
            raise RequestError("bad-build", str(error), "see the schema of `build` in docs/schema") from error
        plan = request.plan or request.build.plan
        if plan is None:
            raise RequestError(
                "no-plan",
                f"neither the request nor build {request.build.name!r} has a sweep plan",
                "give a plan, or a [sweep] table in build.toml",
            )
        try:
            on.plan_limits.check(request.build, plan, on.acquisition.seconds)
        except PlanError as error:
            raise RequestError(
                "bad-plan", str(error), "change the plan of the request, or [sweep] in build.toml"
            ) from error
        sample = SampleStep(request.build.name, request.step)
        if request.decides is not None:
            self._check_decides(request.decides, sample)
        on.lease.check(client, request.lease)
        on.bench_step.check(request.step)
        if on.acquisition.waiting_of(client) >= MOST_WAITING:
            raise RequestError(
                "queue-full", f"{MOST_WAITING} measurements of {client!r} wait already", "cancel some, or wait"
            )
        queued = asked_for(request, client, "queued", _summary(plan), sample=sample, analyzer=on.name)
        measurement, new = self.begin(scoped(client, request.id), request.build, request.step, queued)
        if new:
            arguments = (plan, request.priority, request.decides, client, request.by)
            on.acquisition.add(MeasurementJob(measurement, request.build, request.step, *arguments))
        else:
            self._check_repeated(request.id, measurement, on.name, queued.says)
        return reply.MeasureAnswer(id=request.id, measurement=measurement, analyzer=on.name), []

    @answer.register
    def _(self, request: ask.LeaseRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        on = self.leased(request, client)
        busy = on.acquisition.is_busy
        with on.lease.undone_on_error():
            lease, state = on.lease.take(client, request.owner, request.seconds, request.lease, busy=busy)
            says = f"to {request.owner!r} for {request.seconds:g} s"
            self.publish(asked_for(request, client, "leased", says, analyzer=on.name), ())
        return reply.LeaseAnswer(id=request.id, lease=lease, until=state.until), []

    @answer.register
    def _(self, request: ask.ReleaseRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        on = self.analyzers.of_lease(request.lease, client)
        with on.lease.undone_on_error():
            on.lease.give_back(client, request.lease)
            self.publish(asked_for(request, client, "released", analyzer=on.name), ())
        return reply.Answer(id=request.id), []

    @answer.register
    def _(self, request: ask.CancelRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        if request.measurement is None or request.analyzer is not None:
            on = self.analyzers.named(request.analyzer, client)
        else:
            on = self.analyzers.of_measurement(request.measurement, client)
        on.lease.check_client(client)
        job = on.acquisition.cancel(request.measurement)
        if job is None:
            named = f"measurement {request.measurement!r} neither runs nor waits" if request.measurement else None
            raise RequestError("nothing-to-cancel", named or "nothing is being measured")
        did = "cancelling"
        self.audit(asked_for(request, client, did, measurement=job.measurement, sample=job.sample, analyzer=on.name))
        with logged_if_not_kept("the end of a cancelled measurement"):
            on.acquisition.end_cancelled(job)
        return reply.Answer(id=request.id), []

    @answer.register
    def _(self, request: ask.WithdrawRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        if client != LOCAL:
            raise RequestError("not-allowed", "only programs of the daemon's own account may withdraw a measurement")
        if request.by is None:
            raise RequestError("bad-request", "withdraw: `by` is missing; give the name of the person who withdraws it")
        try:
            event = withdrawal_event(self.journal, request.measurement, request.why, client, request.by)
        except WithdrawalError as error:
            raise RequestError("not-withdrawn", str(error)) from error
        self.publish(event, ())
        return reply.Answer(id=request.id), []

    @answer.register
    def _(self, request: ask.ReplayRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        until = self.journal.last_seq if request.until is None else min(request.until, self.journal.last_seq)
        with self._reading() as journal:  # in another thread: fifty long sweeps have sixteen megabytes
            events = journal.replay(request.since, until, request.max)
            full = sum(len(frame) for event in events for frame in event) > MOST_REPLAYED
            more = full or len(events) == request.max
            missing = journal.missing(request.since, envelope(events[-1]).seq if more else until)
        self.metrics.counts["replayed"] += len(events)
        return _events(request.id, events, more=more, missing=missing)

    @answer.register
    def _(self, request: ask.SamplesRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        by_sample: dict[str, list[reply.MeasuredStep]] = {}
        with self._reading() as journal:  # this runs in another thread, as it may read all of it
            for history in journal.histories(request.name):
                by_sample.setdefault(history.measurement.sample.name, []).append(_measured(history))
        samples = tuple(reply.SampleHistory(name, tuple(steps)) for name, steps in by_sample.items())
        return reply.SamplesAnswer(id=request.id, samples=samples), []

    @answer.register
    def _(self, request: ask.SweepsRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        with self._reading() as journal:  # in another thread: three steps may have sixty megabytes
            known = _known(journal, request.measurement)
            steps = [step.name for step in journal.build(known.id).steps]
            before = steps[: steps.index(known.sample.step)]
            earlier = (journal.latest(known.sample.name, step, known.id) for step in before)
            measurements = [*(measurement for measurement in earlier if measurement), known.id]
            events = [event for measurement in measurements for event in journal.sweeps(measurement)]
        return _events(request.id, events)

    @answer.register
    def _(self, request: ask.FitsRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        with self._reading() as journal:
            events = journal.fits(_known(journal, request.measurement).id)
        lost = self.not_kept_answers.copy()  # this runs in another thread
        not_kept = {fitter: says for fitter, (of, says) in lost.items() if of == request.measurement}
        answer, frames = _events(request.id, events)
        return msgspec.structs.replace(answer, not_kept=not_kept), frames

    @answer.register
    def _(self, request: ask.FitRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        # Only installed or configured fitters may be loaded, never a name from a client's hello.
        installed = sorted({*_installed(), *self.settings["fitters"]})
        if request.fitter not in installed:
            raise RequestError(
                "no-such-fitter", f"fitter {request.fitter!r} is not installed here; {among(request.fitter, installed)}"
            )
        return self._start_job(request.id, _job_of(request), None), []

    @answer.register
    def _(self, request: ask.DiagnoseRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        for other in request.also:
            self._refuse_withdrawn(_known(self.journal, other))
        job = _job_of(request)
        return self._start_job(request.id, job, diagnosis_version(job.effects, job.also, job.propose)), []

    @answer.register
    def _(self, request: ask.UnansweredRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        self.supervisor.visitors.renew(request.fitter, client)
        unanswered = tuple(self.journal.unanswered(request.fitter))
        return reply.MeasurementsAnswer(id=request.id, measurements=unanswered), []

    @answer.register
    def _(self, request: ask.SubmitRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        known = _known(self.journal, request.measurement)
        if client == LOCAL:  # the daemon's own workers may answer as any installed fitter
            self.supervisor.visitors.renew(request.fitter, client)
        else:
            self._list_fitter(request.fitter, request.version, client)
        event = checked(self.journal, known, request, raw)
        if event is not None:
            with self._noted_if_not_kept(known.id, request.fitter):
                self.journal.store.check_room()  # answers must not fill the space that measurements need
                self.publish(event, tuple(raw))
        return reply.Answer(id=request.id), []

    @answer.register
    def _(self, request: ask.ShutdownRequest, raw: Sequence[bytes], client: str) -> tuple[reply.Answer, list[bytes]]:
        self.analyzers.check_every(client)
        self.audit(asked_for(request, client, "shutdown"))
        self.shutdown()
        return reply.Answer(id=request.id), []

    @contextmanager
    def _reading(self) -> Generator[JournalReader]:
        """Open the journal in another thread; while this one goes on writing, all that is read is of one moment."""
        with closing(self.journal.reader()) as journal, journal.store.snapshot():
            yield journal

    @contextmanager
    def _noted_if_not_kept(self, measurement: str, fitter: str) -> Generator[None]:
        """Note why the journal cannot keep the answer of a fitter, for those who wait for it."""
        lost = self.not_kept_answers
        lost.pop(fitter, None)
        try:
            yield
        except JournalError as error:
            says = f"the answer of {fitter} to measurement {measurement} could not be kept: {error}"
            lost[fitter] = measurement, says
            if len(lost) > MOST_FITTERS:
                del lost[next(iter(lost))]
            raise

    def not_kept(self, request: ask.Request) -> str | None:
        """Return why there is no answer to a request that was carried out, if the journal could not keep it."""
        if isinstance(request, ask.FitRequest | ask.DiagnoseRequest):
            return self.jobs.not_kept.get(_job_of(request))
        if isinstance(request, ask.MeasureRequest):
            return next(filter(None, (one.acquisition.not_kept for one in self.analyzers.every)), None)
        return None

    def audit(self, event: StateEvent) -> None:
        """Publish who requested an action that is carried out whether or not the journal can keep the event.

        If it cannot, only the log names the client.
        """
        with logged_if_not_kept(f"{event.state} {event.says} by {event.client!r}"):
            self.publish(event, ())

    def leased(self, request: ask.LeaseRequest, client: str) -> ServedAnalyzer:
        """Return the analyzer to lease. Raises RequestError."""
        if request.lease is not None and request.analyzer is None:
            return self.analyzers.of_lease(request.lease, client)
        return self.analyzers.named(request.analyzer, client)

    def _list_fitter(self, fitter: str, version: str, client: str) -> None:
        """List a fitter as ready. Raises RequestError if the name belongs to another client or the list is full."""
        if ":" in fitter and fitter not in self.settings["fitters"]:
            raise RequestError(
                "bad-name",
                f"fitter {fitter!r}: only the daemon's own configuration may name a module with ':'",
                "register the fitter as an entry point of pzctl.fitters",
            )
        visitors, listed = self.supervisor.visitors, self.supervisor.states
        if visitors.belongs_to_another(fitter, client):
            raise RequestError(
                "not-allowed",
                f"fitter {fitter!r}: this name belongs to a fitter with another key",
                "give the fitter another name",
            )
        if fitter not in listed and len(listed) >= MOST_FITTERS:
            raise RequestError("too-many-fitters", f"{MOST_FITTERS} fitters are connected already")
        visitors.heard(fitter, client)
        self.supervisor.ready(fitter, version)

    def _start_job(self, request: str, job: WorkerJob, version: str | None) -> reply.JobAnswer:
        """Start a job on a complete measurement."""
        known = _known(self.journal, job.measurement)
        self._refuse_withdrawn(known)
        if known.state != "measured":
            raise RequestError("not-measured", f"measurement {known.id!r} is {known.state}; it has no complete sweeps")
        if not self.jobs.begin(job, known, self.journal.sweep_ids(known.id)):
            raise RequestError("queue-full", f"{len(self.jobs.running)} fits and diagnoses run or wait already")
        return reply.JobAnswer(id=request, measurement=known.id, fitter=job.name, version=version)

    @staticmethod
    def _refuse_withdrawn(known: JournalMeasurement) -> None:
        if known.state == WITHDRAWN:
            raise RequestError("withdrawn", f"measurement {known.id!r} was withdrawn; `pzctl show {known.id}` says why")

    def _check_repeated(self, request: str, measurement: str, analyzer: str, says: str) -> None:
        """Raise RequestError if a request of an earlier run had this id, but another plan or analyzer."""
        queued = self.journal.queued(measurement)
        if queued is not None and queued.says and (queued.analyzer, queued.says) != (analyzer, says):
            raise RequestError(
                "id-in-use",
                f"id {request!r} belongs to a measurement on analyzer {queued.analyzer!r}: {queued.says}",
                "give every request a unique id, such as a UUID",
            )

    def _check_decides(self, measurement: str, sample: SampleStep) -> None:
        of = _known(self.journal, measurement).sample
        if of != sample:
            raise RequestError(
                "no-such-measurement",
                f"measurement {measurement!r} is of {of.name!r} at step {of.step!r}; one of {sample.name!r} at step "
                f"{sample.step!r} can only help to decide one of the same step",
            )


def _known(journal: JournalReader, measurement: str) -> JournalMeasurement:
    """Return a measurement. Raises RequestError."""
    known = journal.measurement(measurement)
    if known is None:
        raise RequestError("no-such-measurement", f"the journal holds no measurement {measurement!r}")
    return known


def _job_of(request: ask.FitRequest | ask.DiagnoseRequest) -> WorkerJob:
    if isinstance(request, ask.FitRequest):
        return WorkerJob(request.measurement, request.fitter)
    effects = tuple(sorted({*request.effects})) if request.effects else None
    return WorkerJob(request.measurement, None, effects, request.also, request.propose)


def asked_for(
    request: ask.Request,
    client: str,
    did: str,
    says: str = "",
    *,
    measurement: str | None = None,
    sample: SampleStep | None = None,
    analyzer: str = "",
) -> StateEvent:
    """Return the event that tells who requested an action."""
    return StateEvent(
        state=did,
        says=says,
        measurement=measurement,
        sample=sample,
        analyzer=analyzer,
        client=client,
        by=request.by,
    )


def scoped(client: str, request: str) -> str:
    """Return a request id that is unique among all clients, since two clients may both count "1", "2" ..."""
    return request if client == LOCAL else f"{client}/{request}"


def _summary(plan: SweepPlan) -> str:
    """Return a plan for people, with a hash that distinguishes it from every other plan."""
    points = sum(segment.points for segment in plan.segments)
    first, last = plan.segments[0].start_Hz, plan.segments[-1].stop_Hz
    return f"{points} points, {first:.6g} to {last:.6g} Hz, plan {hashlib.sha256(to_json(plan)).hexdigest()[:16]}"


def _measured(history: History) -> reply.MeasuredStep:
    known = history.measurement
    return reply.MeasuredStep(known.id, known.sample.step, known.state, known.time, history.sweeps, history.fitters)


def _events(
    request: str, events: Sequence[list[bytes]], *, more: bool = False, missing: Sequence[reply.MissingEvents] = ()
) -> tuple[reply.EventsAnswer, list[bytes]]:
    """Return an answer with the frames of events as they were published."""
    frames = tuple(len(event) for event in events)
    answer = reply.EventsAnswer(id=request, frames=frames, more=more, missing=tuple(missing))
    return answer, [frame for event in events for frame in event]
