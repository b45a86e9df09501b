"""The one thread that owns the analyzer, and the queue of what it is to measure."""

import asyncio
import logging
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from ...drivers.base.analyzer import Analyzer, Cancelled, Identity, InstrumentError, Progress
from ...models.base.errors import PzctlError
from ...models.build import Build
from ...models.sweep import Sweep
from ...models.sweep_plan import SweepPlan
from ..journal.store import JournalError
from ..wire.events import (
    Event,
    InstrumentInfo,
    Payload,
    ProgressEvent,
    SampleStep,
    StateEvent,
    SweepEvent,
    sweep_columns,
)
from ..wire.uuid7 import uuid7

log = logging.getLogger(__name__)

PROGRESS_EVERY = 0.2
"""Seconds between two progress events, at least: they are journalled like every event."""


@dataclass(frozen=True)
class MeasurementJob:
    """A measurement that was accepted."""

    measurement: str
    build: Build
    step: str
    plan: SweepPlan
    priority: int = 0
    """Higher ones go first."""
    decides: str | None = None
    """The measurement whose diagnosis it is to decide."""
    client: str | None = None
    """Who asked for it: the name of their key."""
    by: str | None = None
    """For whom that client asked, as it said itself."""
    cancelled: threading.Event = field(default_factory=threading.Event)

    @property
    def sample(self) -> SampleStep:
        """What is measured."""
        return SampleStep(self.build.name, self.step)


class AnalyzerThread:
    """An analyzer behind one thread. After a failure the instrument is let go of and opened anew for the next job."""

    def __init__(self, resource: str, open_analyzer: Callable[[str], Analyzer]) -> None:
        self._resource = resource
        self._open = open_analyzer
        self._analyzer: Analyzer | None = None
        self._last: Analyzer | None = None
        """The one that was opened last; what it can do is known without asking it."""
        self._thread = ThreadPoolExecutor(1, "analyzer")

    async def identify(self) -> Identity:
        """Open the instrument and ask who it is. Raises InstrumentError."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, lambda: self._opened().identify())

    async def measure(self, job: MeasurementJob, report: Callable[[Progress], None]) -> tuple[Sweep, ...]:
        """Carry out a job; `report` is called in the thread. Raises PlanError, Cancelled or InstrumentError."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._measure, job, report)

    async def let_go(self) -> None:
        """Let go of the instrument, once what runs has come to its end; the next job opens it again."""
        await asyncio.get_running_loop().run_in_executor(self._thread, self._let_go)

    async def close(self) -> None:
        """Let go of the instrument for good."""
        await self.let_go()
        self._thread.shutdown()

    def seconds(self, plan: SweepPlan) -> float:
        """Return how long a plan will take. Raises PlanError where the analyzer cannot do it."""
        return 0.0 if self._last is None else self._last.estimated_seconds(plan)

    def _opened(self) -> Analyzer:
        if self._analyzer is None:
            self._analyzer = self._last = self._open(self._resource)
            try:
                self._analyzer.identify()
                self._analyzer.make_safe()  # before anything else: a daemon that was killed may have left a bias on
            except InstrumentError:
                self._let_go()
                raise
        return self._analyzer

    def _measure(self, job: MeasurementJob, report: Callable[[Progress], None]) -> tuple[Sweep, ...]:
        try:
            return self._opened().measure(job.plan, report, job.cancelled.is_set)
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
            except InstrumentError as error:  # it is gone already; the reason was told when that was found
                log.warning("instrument %s: %s", self._resource, error)


class Acquisition:
    """Measures one job after the other and publishes what comes of it."""

    def __init__(
        self,
        analyzer: AnalyzerThread,
        instrument: InstrumentInfo,
        publish: Callable[[Event, Payload], None],
        ready: Callable[[], Awaitable[None]],
        annotated: Callable[[Sweep], Sweep],
    ) -> None:
        self.current: MeasurementJob | None = None
        self.waiting: deque[MeasurementJob] = deque()
        self._analyzer = analyzer
        self._instrument = instrument
        self._publish = publish
        self._ready = ready
        self._annotated = annotated
        self._more = asyncio.Event()

    @property
    def is_busy(self) -> bool:
        """Whether something is measured, or waits to be."""
        return self.current is not None or bool(self.waiting)

    def seconds(self, plan: SweepPlan) -> float:
        """Return how long a plan will take. Raises PlanError where the analyzer cannot do it."""
        return self._analyzer.seconds(plan)

    def add(self, job: MeasurementJob) -> None:
        """Put a job into the queue, behind those of the same or a higher priority."""
        behind = next((k for k, other in enumerate(self.waiting) if other.priority < job.priority), len(self.waiting))
        self.waiting.insert(behind, job)
        self._more.set()

    async def let_go(self) -> None:
        """Let go of the instrument until the next job: somebody else takes it."""
        await self._analyzer.let_go()

    def cancel(self, measurement: str | None) -> MeasurementJob | None:
        """Cancel a job, the running one where none is named; return it, None where there was none."""
        jobs = [job for job in (self.current, *self.waiting) if job is not None]
        if measurement is None:
            jobs = [] if self.current is None else [self.current]
        found = next((job for job in jobs if measurement in (None, job.measurement)), None)
        if found is not None:
            found.cancelled.set()
        return found

    def cancel_all(self) -> None:
        """Cancel what runs and what waits."""
        for job in (self.current, *self.waiting):
            if job is not None:
                job.cancelled.set()

    async def work(self) -> None:
        """Measure for ever. Raises JournalError: what cannot be recorded is not measured on."""
        while True:
            while self.waiting:
                await self._ready()  # the journal, to take what will be measured
                self.current = self.waiting.popleft()
                await self._do(self.current)
                self.current = None
            self._more.clear()
            await self._more.wait()

    async def _do(self, job: MeasurementJob) -> None:
        if job.cancelled.is_set():
            self._state(job, "cancelled", "the measurement was cancelled before it began")
            return
        self._state(job, "measuring")
        try:
            sweeps = await self._analyzer.measure(job, self._reporter(job))
            self._announce(job, tuple(map(self._annotated, sweeps)))
        except Cancelled as error:
            self._state(job, "cancelled", str(error))
        except JournalError:
            raise
        except PzctlError as error:
            self._state(job, "failed", str(error))
        except Exception as error:
            log.exception("measurement %s", job.measurement)
            self._state(job, "failed", f"a defect of pzctl, see the daemon's log: {error!r}")
        else:
            self._state(job, "measured-aside" if job.decides else "measured", f"{len(sweeps)} sweep(s)")

    def _announce(self, job: MeasurementJob, sweeps: tuple[Sweep, ...]) -> None:
        for k, sweep in enumerate(sweeps, start=1):
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
                client=job.client,
                by=job.by,
                columns=columns,
            )
            self._publish(event, payload)

    def _state(self, job: MeasurementJob, state: str, says: str = "") -> None:
        event = StateEvent(state=state, says=says, measurement=job.measurement, sample=job.sample)
        self._publish(event, ())

    def _reporter(self, job: MeasurementJob) -> Callable[[Progress], None]:
        """Return what the analyzer's thread calls: it hands progress to the loop, not more often than is read."""
        loop = asyncio.get_running_loop()
        last = -PROGRESS_EVERY

        def report(progress: Progress) -> None:
            nonlocal last
            if time.monotonic() - last >= PROGRESS_EVERY:
                last = time.monotonic()
                loop.call_soon_threadsafe(self._publish, _progress(job, progress), ())

        return report


def _progress(job: MeasurementJob, progress: Progress) -> ProgressEvent:
    return ProgressEvent(
        measurement=job.measurement,
        sample=job.sample,
        fraction=progress.fraction,
        seconds_left=progress.seconds_left,
        what=progress.what,
    )
