"""Requested fits and diagnoses: each in a process of its own, few at a time, limited in time and memory."""

import asyncio
import logging
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from ....fitters.data_folder import user_effects_folder
from ...files.auto_diagnosis import DIAGNOSIS
from ...files.paths import log_file
from ...files.worker_limits import Limits
from ...journal.journal_reader import JournalMeasurement
from ...journal.store import JournalError
from ...wire.curve_keys import ClientKey
from ...wire.events import FitEvent
from .bounded_logs import keep_newest
from .process_runner import not_run, run_to_end

log = logging.getLogger(__name__)

AT_ONCE = 2
"""Greatest number of jobs that run at the same time; the others wait."""

MOST = 100
"""Greatest number of jobs that run or wait."""

LOGS_KEPT = 20
"""Number of logs of failed jobs to keep."""

LARGEST_LOG = 1 << 20
"""Bytes to keep of such a log: its end."""

NAMES = "from pzctl.models.effects import catalogue; print(*(effect.name for effect in catalogue()))"
"""A program that prints the names of the effects. It runs in another process, because the catalogue imports SciPy,
which would delay the daemon's answers."""


@dataclass(frozen=True)
class WorkerJob:
    """A fit by `fitter`, or, if fitter is None, a diagnosis that considers `effects`."""

    measurement: str
    fitter: str | None
    effects: tuple[str, ...] | None = None
    also: tuple[str, ...] = ()
    """Ids of further measurements made to decide the diagnosis."""
    propose: bool = False

    @property
    def name(self) -> str:
        """The fitter's name in the answer."""
        return self.fitter or DIAGNOSIS

    @property
    def arguments(self) -> list[str]:
        """The command-line arguments for `job_worker`."""
        fitter = [] if self.fitter is None else ["--fitter", self.fitter]
        effects = ["--effects", ",".join(self.effects)] if self.effects else []
        also = ["--also", ",".join(self.also)] if self.also else []
        return [self.measurement, *fitter, *effects, *also, *(["--propose"] if self.propose else [])]


@dataclass
class JobRunner:
    """Runs jobs. A job that ends without an answer is answered here, with the reason.

    If the journal refuses that, too, no event can be published, and `not_kept` tells whoever asks again.
    """

    home: Path
    events: str
    requests: str
    key: ClientKey | None
    limits: Limits
    publish: Callable[[FitEvent], None]
    running: dict[WorkerJob, "asyncio.Task[None]"] = field(default_factory=dict[WorkerJob, "asyncio.Task[None]"])
    not_kept: dict[WorkerJob, str] = field(default_factory=dict[WorkerJob, str])
    """Sentences about the latest jobs whose answers the journal refused."""
    _numbers: Iterator[int] = field(default_factory=lambda: count(1))
    _effects: "asyncio.Task[frozenset[str]] | None" = None
    _slots: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(AT_ONCE))

    def begin(self, job: WorkerJob, of: JournalMeasurement, sweeps: tuple[str, ...]) -> bool:
        """Start a job, unless it runs already; return False if there are too many."""
        if job in self.running:
            return True
        if len(self.running) >= MOST:
            return False
        self.not_kept.pop(job, None)
        task = asyncio.get_running_loop().create_task(self._do(job, of, sweeps))
        self.running[job] = task
        task.add_done_callback(lambda _: self.running.pop(job, None))
        return True

    async def effects(self) -> frozenset[str]:
        """Return the names of all effects; those of the catalogue are looked up until it succeeds."""
        if self._effects is None or (self._effects.done() and self._effects.exception() is not None):
            self._effects = asyncio.create_task(asyncio.to_thread(_effects))
        own = await asyncio.to_thread(lambda: {file.stem for file in user_effects_folder(self.home).glob("*.toml")})
        return await asyncio.shield(self._effects) | own

    async def end(self) -> None:
        """End all jobs."""
        tasks = list(self.running.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _do(self, job: WorkerJob, of: JournalMeasurement, sweeps: tuple[str, ...]) -> None:
        async with self._slots:
            try:
                failure = await self._run(job)
            except OSError as error:
                failure = not_run(error)
        if not failure:
            return
        says = f"{job.name} of measurement {of.id}: {failure}"
        refusal = FitEvent(measurement=of.id, sample=of.sample, fitter=job.name, version="", sweeps=sweeps, error=says)
        try:
            self.publish(refusal)
        except JournalError as error:
            log.error("not in the journal: %s: %s", says, error)
            self.not_kept[job] = f"the answer of {job.name} to measurement {of.id} could not be kept: {error}"
            if len(self.not_kept) > MOST:
                del self.not_kept[next(iter(self.not_kept))]

    async def _run(self, job: WorkerJob) -> str:
        """Run a job's process; return why it failed, or an empty string. Raises OSError if it cannot be run."""
        began, most = time.monotonic(), self.limits.seconds
        arguments = [*job.arguments, "--events", self.events, "--requests", self.requests]
        output = log_file(self.home, f"job-{job.measurement}-{next(self._numbers)}")  # several jobs may be of one
        end = await run_to_end(
            "pzctl.daemon.server.workers.job_worker",
            [*arguments, "--memory-MB", str(self.limits.memory_MB)],
            output,
            self.key,
            lambda: f"no answer within {most:g} s" if time.monotonic() - began > most else "",
        )
        if end.code == 0:
            output.unlink(missing_ok=True)
            return ""
        keep_newest(output.parent, "job-*.log*", LOGS_KEPT, LARGEST_LOG)
        return end.says


def _effects() -> frozenset[str]:
    printed = subprocess.run([sys.executable, "-P", "-c", NAMES], capture_output=True, text=True, check=True)  # noqa: S603
    return frozenset(printed.stdout.split())
