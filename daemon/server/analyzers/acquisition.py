"""The thread that owns the analyzer, and the queue of its measurements."""

import asyncio
import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from ....drivers.base.analyzer import Analyzer, Cancelled, Identity, InstrumentError, Progress
from ....models.base.errors import PzctlError
from ....models.build import Build
from ....models.sweep import Sweep
from ....models.sweep_plan import SweepPlan
from ...journal.store import JournalError, is_broken
from ...wire.events import (
    Event,
    InstrumentInfo,
    Payload,
    ProgressEvent,
    SampleStep,
    StateEvent,
    SweepEvent,
    sweep_columns,
)
from ...wire.uuid7 import uuid7
from .pace import Pace

log = logging.getLogger(__name__)

TRY_AGAIN = 1.0
"""Seconds until an event that the journal could not keep is given to it again."""

PROGRESS_EVERY = 0.2
"""Least seconds between two progress events, since the journal keeps them like every event."""

BEFORE_IT_BEGAN = "the measurement was cancelled before it began"


@dataclass(frozen=True)
class MeasurementJob:
    """An accepted measurement."""

    measurement: str
    build: Build
    step: str
    plan: SweepPlan
    priority: int = 0
    """Higher ones go first."""
    decides: str | None = None
    """The measurement whose diagnosis this one helps to decide."""
    client: str | None = None
    """Name of the client's key."""
    by: str | None = None
    """The user for whom the client asked, as the client states."""
    cancelled: threading.Event = field(default_factory=threading.Event)

    @property
    def sample(self) -> SampleStep:
        """The sample and its step."""
        return SampleStep(self.build.name, self.step)


class AnalyzerThread:
    """An analyzer used by one thread only. After a failure it is closed, and opened again for the next job."""

    def __init__(self, resource: str, open_analyzer: Callable[[str], Analyzer], pace: float = 1.0) -> None:
        self._resource = resource
        self._pace = Pace(pace)
        self._open = open_analyzer
        self._analyzer: Analyzer | None = None
        self._last: Analyzer | None = None
        """The analyzer opened last, whose capabilities are known without asking it."""
        self._thread = ThreadPoolExecutor(1, "analyzer")

    async def identify(self) -> Identity:
        """Open the instrument and return its identity. Raises InstrumentError."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, lambda: self._opened().identify())

    async def measure(self, job: MeasurementJob, report: Callable[[Progress], None]) -> tuple[Sweep, ...]:
        """Carry out a job; `report` is called in the thread. Raises PlanError, Cancelled or InstrumentError."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._measure, job, report)

    async def let_go(self) -> None:
        """Close the connection to the instrument after the running job; the next job opens it again."""
        await asyncio.get_running_loop().run_in_executor(self._thread, self._let_go)

    async def close(self) -> None:
        """Close the connection to the instrument and end the thread."""
        await self.let_go()
        self._thread.shutdown()

    def seconds(self, plan: SweepPlan) -> float:
        """Return the estimated seconds of a plan. Raises PlanError if the analyzer cannot do it."""
        return 0.0 if self._last is None else self._last.estimated_seconds(plan)

    def _opened(self) -> Analyzer:
        if self._analyzer is None:
            self._analyzer = self._last = self._open(self._resource)
            try:
                self._analyzer.identify()
                self._analyzer.make_safe()  # first, because a killed daemon may have left a bias on
            except InstrumentError:
                self._let_go()
                raise
        return self._analyzer

    def _measure(self, job: MeasurementJob, report: Callable[[Progress], None]) -> tuple[Sweep, ...]:
        try:
            analyzer = self._opened()
            progress = self._pace.corrected(analyzer.estimated_seconds(job.plan), report)
            sweeps = analyzer.measure(job.plan, progress, job.cancelled.is_set)
            progress.done()
            return sweeps
        except Cancelled:
            raise
        except InstrumentError:
            self._let_go()
            raise

    def _let_go(self) -> None:
        analyzer, self._analyzer = self._analyzer, None
        if analyzer is not None:
            try:
                analyzer.close()
            except InstrumentError as error:  # the connection is lost already, which was reported then
                log.warning("instrument %s: %s", self._resource, error)


class Acquisition:
    """Measures one job after the other and publishes the results."""

    def __init__(
        self,
        name: str,
        analyzer: AnalyzerThread,
        instrument: InstrumentInfo,
        publish: Callable[[Event, Payload], None],
        ready: Callable[[], Awaitable[None]],
        annotated: Callable[[Sweep], Sweep],
    ) -> None:
        self.current: MeasurementJob | None = None
        self.waiting: deque[MeasurementJob] = deque()
        self.not_kept = ""
        """Why the journal does not take the current job's next event, in a sentence; empty if it does."""
        self._name = name
        self._analyzer = analyzer
        self._instrument = instrument
        self._publish = publish
        self._ready = ready
        self._annotated = annotated
        self._more = asyncio.Event()
        self._ending = False

    @property
    def is_busy(self) -> bool:
        """Whether a measurement runs or waits."""
        return self.current is not None or bool(self.waiting)

    def seconds(self, plan: SweepPlan) -> float:
        """Return the estimated seconds of a plan. Raises PlanError if the analyzer cannot do it."""
        return self._analyzer.seconds(plan)

    def waiting_of(self, client: str) -> int:
        """Return how many measurements of a client wait."""
        return sum(job.client == client for job in self.waiting)

    def add(self, job: MeasurementJob) -> None:
        """Put a job into the queue, behind those of a higher priority; among equals, clients take turns."""
        if self._ending:
            job.cancelled.set()
        self.waiting.insert(self._place(job), job)
        self._more.set()

    def _place(self, job: MeasurementJob) -> int:
        """Return the place of a new job: a client's nth job waits only for the first n jobs of every other client."""
        equals = [other for other in self.waiting if other.priority == job.priority]
        turn = sum(other.client == job.client for other in equals)
        turns: Counter[str | None] = Counter()
        for place, other in enumerate(self.waiting):
            if other.priority < job.priority:
                return place
            if other.priority == job.priority:
                if turns[other.client] > turn:
                    return place
                turns[other.client] += 1
        return len(self.waiting)

    async def let_go(self) -> None:
        """Close the connection to the instrument until the next job, so that another tool can use it."""
        await self._analyzer.let_go()

    def cancel(self, measurement: str | None) -> MeasurementJob | None:
        """Cancel a job, by default the running one; return it, or None if there is none.

        One that waits leaves the queue at once; `end_cancelled` publishes its end.
        """
        jobs = [job for job in (self.current, *self.waiting) if job is not None]
        if measurement is None:
            jobs = [] if self.current is None else [self.current]
        cancelled = next((job for job in jobs if measurement in (None, job.measurement)), None)
        if cancelled is not None:
            cancelled.cancelled.set()
            if cancelled is not self.current:
                self.waiting.remove(cancelled)
        return cancelled

    def end_cancelled(self, job: MeasurementJob) -> None:
        """Publish the end of a job that was cancelled while it waited; the running one ends by itself."""
        if job is not self.current:
            self._publish(self._state(job, "cancelled", BEFORE_IT_BEGAN), ())

    def cancel_all(self) -> None:
        """Cancel the running job and all that wait, and those that come from now on: the daemon ends."""
        self._ending = True
        for job in (self.current, *self.waiting):
            if job is not None:
                job.cancelled.set()

    async def work(self) -> None:
        """Measure until cancelled. Raises JournalError if disk or database fail, because results must not be lost."""
        while True:
            await self._ready()  # until the journal can take the result; meanwhile all that wait may be cancelled
            if self.waiting:
                self.current = self.waiting.popleft()
                try:
                    await self._do(self.current)
                except JournalError as error:
                    if is_broken(error):
                        raise
                    log.error("not in the journal: how measurement %s ended: %s", self.current.measurement, error)
                self.current = None
            else:
                self._more.clear()
                await self._more.wait()

    async def _do(self, job: MeasurementJob) -> None:
        if job.cancelled.is_set():
            await self._keep(job, self._state(job, "cancelled", BEFORE_IT_BEGAN))
            return
        await self._keep(job, self._state(job, "measuring"))
        try:
            sweeps = await self._analyzer.measure(job, self._reporter(job))
            await self._announce(job, tuple(map(self._annotated, sweeps)))
        except Cancelled as error:
            end = self._state(job, "cancelled", str(error))
        except JournalError:
            raise
        except PzctlError as error:
            end = self._state(job, "failed", str(error))
        except Exception as error:
            log.exception("measurement %s", job.measurement)
            end = self._state(job, "failed", f"a defect of pzctl, see the daemon's log: {error!r}")
        else:
            end = self._state(job, "measured-aside" if job.decides else "measured", f"{len(sweeps)} sweep(s)")
        await self._keep(job, end)

    async def _announce(self, job: MeasurementJob, sweeps: tuple[Sweep, ...]) -> None:
        """Publish the sweeps; other tasks get a turn before each, as hundreds take the disk seconds, but none after."""
        for k, sweep in enumerate(sweeps, start=1):
            await asyncio.sleep(0)
            columns, payload = sweep_columns(sweep)
            event = SweepEvent(
                id=uuid7(),
                measurement=job.measurement,
                sample=job.sample,
                instrument=self._instrument,
                build=job.build,
                segment=k,
                segments=len(sweeps),
                started=sweep.time,
                settings=dict(sweep.settings),
                notes=sweep.notes,
                decides=job.decides,
                analyzer=self._name,
                client=job.client,
                by=job.by,
                columns=columns,
            )
            await self._keep(job, event, payload)

    async def _keep(self, job: MeasurementJob, event: Event, payload: Payload = ()) -> None:
        """Publish an event of a job; if the disk is full, later.

        Raises JournalError if disk or database fail, or if the disk is still full when the job is cancelled.
        """
        while True:
            try:
                self._publish(event, payload)
            except JournalError as error:
                if job.cancelled.is_set() or is_broken(error):
                    self.not_kept = ""
                    raise
                if not self.not_kept:
                    self.not_kept = f"measurement {job.measurement} waits until the journal can keep it: {error}"
                    log.error("%s", self.not_kept)
            else:
                self.not_kept = ""
                return
            await asyncio.sleep(TRY_AGAIN)

    def _state(self, job: MeasurementJob, state: str, says: str = "") -> StateEvent:
        return StateEvent(state=state, says=says, measurement=job.measurement, sample=job.sample, analyzer=self._name)

    def _reporter(self, job: MeasurementJob) -> Callable[[Progress], None]:
        """Return a function for the analyzer's thread that passes progress to the event loop at a limited rate."""
        loop = asyncio.get_running_loop()
        last = -PROGRESS_EVERY

        def report(progress: Progress) -> None:
            nonlocal last
            if time.monotonic() - last >= PROGRESS_EVERY:
                last = time.monotonic()
                loop.call_soon_threadsafe(self._tell, _progress(job, progress))

        return report

    def _tell(self, progress: ProgressEvent) -> None:
        """Publish progress. If the journal cannot keep it, it is dropped."""
        try:
            self._publish(progress, ())
        except JournalError as error:
            log.warning("progress was not published: %s", error)


def _progress(job: MeasurementJob, progress: Progress) -> ProgressEvent:
    return ProgressEvent(
        measurement=job.measurement,
        sample=job.sample,
        fraction=progress.fraction,
        seconds_left=progress.seconds_left,
        what=progress.what,
    )
