"""A queue file: measurements that follow each other unattended, read for `pzctl measure --queue`.

name = "night of 4 March"                     # noted with each measurement: what is done is not measured again
build = "S4.toml"                             # beside this file

[[measure]]
sample = "S4"
step = "disk"
wait = "30min"
repeat = 12
every = "10min"
sweep = { segments = [ { start_MHz = 1, stop_MHz = 6 } ], bias_V = 5 }
measurement = { operator = "Ana" }
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ...models.base.names import NameFault, check_name
from ...models.build import Build
from .builds.build_check import check_build, check_build_name
from .builds.build_file import read_build, read_metadata, read_plan
from .builds.build_table import BuildError, Table, read_table
from .builds.file_keys import QUEUE_ENTRIES, QUEUED_ENTRIES
from .durations import seconds_of

QUEUE_KEY = "queue"
"""Key under which the name of the queue is noted with each of its measurements."""


@dataclass(frozen=True)
class QueuedStep:
    """One entry: a step that is measured `repeat` times."""

    build: Build
    """With the name of the sample, its plan and its notes."""
    step: str
    repeat: int = 1
    every: float = 0.0
    """Seconds from start to start."""
    wait: float = 0.0
    """Seconds before the first start."""
    ask: str = ""
    """What a person is to do first; empty if nothing."""
    before: int = 0
    """Number of measurements of this entry that were made before, by an earlier command."""

    def named(self, number: int) -> str:
        """Return the name of its measurement `number`, from 0: `X1, step disk, 2 of 3`."""
        count = self.before + self.repeat
        which = f", {self.before + number + 1} of {count}" if count > 1 else ""
        return f"{self.build.name}, step {self.step}{which}"


@dataclass(frozen=True)
class MeasurementQueue:
    """The entries of a queue file."""

    name: str
    steps: tuple[QueuedStep, ...]

    @property
    def total(self) -> int:
        """Number of measurements."""
        return sum(entry.repeat for entry in self.steps)

    def without(self, done: Mapping[tuple[str, str], int]) -> "MeasurementQueue":
        """Return what is left; `done`: number of measurements of this queue by sample and step.

        The first entries of a sample and step count as done first. What has begun is continued without its `wait`.
        """
        left = Counter(done)
        steps: list[QueuedStep] = []
        for entry in self.steps:
            key = (entry.build.name, entry.step)
            measured = min(left[key], entry.repeat)
            left[key] -= measured
            if measured == 0:
                steps.append(entry)
            elif measured < entry.repeat:
                steps.append(replace(entry, repeat=entry.repeat - measured, wait=0.0, before=measured))
        return replace(self, steps=tuple(steps))


def read_queue(path: Path, changed: Callable[[Build], Build] = lambda build: build) -> MeasurementQueue:
    """Read a queue file; `changed` is applied to each of its builds. Raises BuildError."""
    top = read_table(path)
    top.only(QUEUE_ENTRIES)
    name = top.string("name") if "name" in top.data else path.stem
    try:
        check_name(name, f"{path}: name")
    except NameFault as fault:
        raise BuildError(str(fault)) from None
    builds: dict[Path, Build] = {}
    steps: list[QueuedStep] = []
    for table in top.tables("measure", "entry"):
        table.only(QUEUED_ENTRIES)
        giver = table if "build" in table.data else top
        if "build" not in giver.data:
            raise table.missing("build", f'write build = "S4.toml" there, or once at the top of {path}')
        file = path.parent / giver.string("build")
        if file not in builds:
            builds[file] = changed(read_build(file))
        steps.append(_entry(table, builds[file], name))
    return MeasurementQueue(name, tuple(steps))


def _entry(table: Table, build: Build, queue: str) -> QueuedStep:
    texts = table.settings({key: entry for key, entry in QUEUED_ENTRIES.items() if entry.kind in ("text", "integer")})
    sample = str(texts.get("sample", build.name))
    check_build_name(sample, f"{table.source}: {table.key('sample')}")
    step = table.string("step")
    if step not in [one.name for one in build.steps]:
        steps = ", ".join(one.name for one in build.steps)
        raise table.error("step", f"is {step!r}; build {build.name!r} has the steps {steps}")
    notes = read_metadata(table.table("measurement")) if "measurement" in table.data else {}
    plan = read_plan(table.table("sweep")) if "sweep" in table.data else build.plan
    if plan is None:
        raise table.missing("sweep", f"build {build.name!r} has no [sweep] either; write one of the two")
    if QUEUE_KEY in notes:
        raise table.error(f"measurement.{QUEUE_KEY}", "is taken by the name of the queue; use another key")
    metadata = {**build.metadata, **notes, QUEUE_KEY: queue}
    queued = replace(build, name=sample, plan=plan, metadata=metadata)
    check_build(queued, f"{table.source}: {table.path}")
    return QueuedStep(
        queued,
        step,
        repeat=int(texts.get("repeat", 1)),
        every=_seconds(table, "every"),
        wait=_seconds(table, "wait"),
        ask=str(texts.get("ask", "")),
    )


def _seconds(table: Table, key: str) -> float:
    if key not in table.data:
        return 0.0
    seconds = seconds_of(table.string(key))
    if seconds is None:
        raise table.error(key, f'is {table.string(key)!r}; a number with s, min or h is needed, for example "10min"')
    return seconds
