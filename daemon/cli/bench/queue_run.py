"""`pzctl measure --queue`: what of a queue file is left, and carrying it out without a person."""

import sys
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

import typer

from ....models.base.errors import CannotError, PzctlError
from ....models.metadata import check_metadata
from ...client.gluing import StepRefusedError
from ...client.protocol import DaemonError
from ...files.measurement_queue import QUEUE_KEY, MeasurementQueue, QueuedStep
from ..analysis.fit_options import UsageError
from .note_options import NoteOptions
from .repeats import Pause

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from ....models.build import Build
    from ....models.sweep_plan import SweepPlan

_ENDED_CODES = ("failed", "cancelled", "abandoned", "bad-plan")
"""Codes of errors that concern one measurement only; the queue goes on with the next."""


class QueueError(CannotError):
    """Measurements of a queue failed."""


class QueueFault(PzctlError):
    """An entry of a queue cannot be measured; found before the first one is."""


def queued(path: "Path", changed: "Callable[[Build], Build]", given: Mapping[str, object]) -> MeasurementQueue:
    """Return the queue of a file; `given`: other options of the command, which a queue file replaces if true.

    Raises UsageError, BuildError.
    """
    from ...files.measurement_queue import read_queue

    for option, value in given.items():
        if value:
            raise UsageError(f"{option} is given beside --queue, whose file says what is measured; leave out {option}")
    queue = read_queue(path, changed)
    asks = [entry for entry in queue.steps if entry.ask]
    if asks and not sys.stdin.isatty():
        raise UsageError(
            f"{path}: ask = {asks[0].ask!r} needs a person at a terminal; leave it out of a queue that runs alone"
        )
    return queue


def refuse_finished(queue: MeasurementQueue) -> None:
    """Raise QueueError if the journal holds all measurements of a queue: no daemon has to be started for it."""
    if not queue.without(_counted(queue, ("measured",))).total:
        raise QueueError(f"{_held(queue, queue.total)}: all of them; give the queue another name to measure again")


def what_is_left(queue: MeasurementQueue, console: "Console") -> MeasurementQueue:
    """Return the measurements that the journal does not hold yet, and say how many it holds.

    Those that the running daemon is to make for an earlier command count as held. Raises QueueError if none is left.
    """
    left = queue.without(_counted(queue, ("measured", "measuring", "queued")))
    if left.total < queue.total:
        held = _held(queue, queue.total - left.total)
        if not left.total:
            raise QueueError(f"{held}, or are being made: all of them; give the queue another name to measure again")
        console.print(
            f"{held}; {left.total} {'is' if left.total == 1 else 'are'} left", highlight=False, soft_wrap=True
        )
    return left


def _held(queue: MeasurementQueue, count: int) -> str:
    return f"{count} of {queue.total} measurements of queue {queue.name!r} are in the journal"


def check_queue(queue: MeasurementQueue, notes: NoteOptions, check: "Callable[[Build, SweepPlan], None]") -> None:
    """Check the plan and the notes of every entry; `check` does so for the plan of a build.

    Raises QueueFault, UsageError.
    """
    from ...files.builds.build_check import needed_plan

    given = notes.metadata()
    if QUEUE_KEY in given:  # it would not be known which measurements are those of the queue
        raise UsageError(f"--note {QUEUE_KEY}=... is taken by the name of the queue; use another key")
    for entry in queue.steps:
        where = f"queue {queue.name!r}: {entry.build.name}, step {entry.step}"
        try:
            check(entry.build, needed_plan(entry.build, where))
            check_metadata({**entry.build.metadata, **given}, "notes")
        except PzctlError as error:
            raise QueueFault(f"{where}: {error}; nothing was started") from None


def _counted(queue: MeasurementQueue, states: Sequence[str]) -> Counter[tuple[str, str]]:
    """Return how often the journal holds each sample and step of this queue in one of these states."""
    from ...samples.sample_selection import NoSamplesError, open_journal

    done: Counter[tuple[str, str]] = Counter()
    try:
        journal = open_journal()
    except NoSamplesError:
        return done
    with closing(journal):
        for sample in {entry.build.name for entry in queue.steps}:
            known = f"sample = ? AND state IN ({', '.join('?' * len(states))})"
            for measurement in journal.measurements(known, sample, *states):
                if journal.build(measurement.id).metadata.get(QUEUE_KEY) == queue.name:
                    done[sample, measurement.sample.step] += 1
    return done


class QueueRun:
    """Carries out a queue; a measurement that fails does not end it."""

    def __init__(self, queue: MeasurementQueue, console: "Console") -> None:
        self._queue = queue
        self._console = console
        self._done = 0
        self._failed: list[str] = []

    def run(
        self,
        prepare: Callable[[str], None],
        noted: "Callable[[Build, str], Build]",
        measure: "Callable[[QueuedStep, Build], None]",
    ) -> None:
        """Measure everything in order; `noted` returns a build with the notes on its step, as they are at that time.

        Raises QueueError at the end if some failed.
        """
        with self._interruptible():
            for entry in self._queue.steps:
                pause = Pause(entry.every, entry.wait)
                if entry.ask:
                    typer.prompt(f"{entry.ask}; then press Enter", default="", show_default=False, err=True)
                if not self._is_prepared(entry, prepare):
                    continue
                for number in range(entry.repeat):
                    pause.wait(self._console, f"{self._done} of {self._queue.total} measured")
                    name = entry.named(number)
                    self._console.print(f"{name}:", highlight=False, soft_wrap=True)
                    self._measure(entry, name, noted, measure)
        if self._failed:
            raise QueueError(
                f"{len(self._failed)} of {self._queue.total} measurements failed, the first: {self._failed[0]}; "
                "the same command measures them again"
            )

    def _is_prepared(self, entry: QueuedStep, prepare: Callable[[str], None]) -> bool:
        """Bring the device to a step; all measurements of an entry to which the bench cannot bring it have failed."""
        try:
            prepare(entry.step)
        except StepRefusedError as error:
            self._fail(f"{entry.build.name}, step {entry.step}", error, entry.repeat)
            return False
        return True

    def _measure(
        self,
        entry: QueuedStep,
        name: str,
        noted: "Callable[[Build, str], Build]",
        measure: "Callable[[QueuedStep, Build], None]",
    ) -> None:
        try:
            build = noted(entry.build, entry.step)
        except PzctlError as error:  # such as that of a thermometer which does not answer
            self._fail(name, error)
            return
        try:
            measure(entry, build)
        except DaemonError as error:
            if error.code not in _ENDED_CODES:
                raise
            self._fail(name, error)
        except PzctlError as error:  # the fit; the measurement is in the journal
            self._done += 1
            self._console.print(f"{name}: {error}", style="red", markup=False)
        else:
            self._done += 1

    def _fail(self, name: str, error: PzctlError, count: int = 1) -> None:
        self._failed += [f"{name}: {error}"] * count
        self._console.print(self._failed[-1], style="red", highlight=False, soft_wrap=True, markup=False)

    @contextmanager
    def _interruptible(self) -> Generator[None]:
        """Say on Ctrl-C how much is left."""
        try:
            yield
        except KeyboardInterrupt:
            done, left = self._done, self._queue.total - self._done
            self._console.print(
                f"{done} of {done + left} measured; the same command continues with the {left} that are left",
                highlight=False,
                soft_wrap=True,
            )
            raise
