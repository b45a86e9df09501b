"""Selection of samples: those of the journal, or those of a folder with one subfolder for each sample."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...drivers.recordings import read_recording
from ...fitters.interface import FitResult, FitTask
from ...fitters.population.batch import BatchJob
from ...models.base.errors import CannotError, PzctlError
from ...models.build import Build, Quantity
from ...models.sweep import Sweep
from ..client.location import find
from ..client.result_waiter import fit_of
from ..files.builds.build_file import read_build
from ..files.config import journal_of, settings
from ..files.paths import home, journal_folder
from ..journal.journal_reader import JournalMeasurement, JournalReader
from ..wire.events import FitEvent, decode

BUILD = "build.toml"
_TYPES = (".csv", ".txt", ".tsv", ".s1p", ".z1p", ".y1p")
"""File name extensions of recordings in a sample's folder."""


class NoSamplesError(CannotError):
    """There is nothing to list or to fit."""


class FolderMissing(PzctlError):
    """There is no folder of this name."""


@dataclass(frozen=True, eq=False)
class Sample:
    """One sample, ready to be fitted, or the sentence that says why it is not."""

    name: str
    job: BatchJob | None
    error: str | None = None
    notes: tuple[str, ...] = ()
    """Sentences that a person should read about the sample."""
    measurement: str | None = None
    """The journal's measurement of the last gluing step; None for a sample of a folder."""
    build_file: Path | None = None
    """The build file of a sample of a folder."""


@dataclass(frozen=True, eq=False)
class LatestFit:
    """The fit of a sample's newest measurement that was fitted."""

    result: FitResult
    measurement: JournalMeasurement
    build: Build


def open_journal() -> JournalReader:
    """Open this user's journal for reading: the running daemon's, or else the one in the settings.

    Raises NoSamplesError if nothing was measured yet.
    """
    running = find(home())
    url, station = (running.journal, running.station) if running else journal_of(settings({}))
    if url is not None:
        return JournalReader(url, station)
    folder = journal_folder(home())
    if not (folder / "journal.sqlite").exists() and not any((folder / "arrays").glob("*.bin")):
        raise NoSamplesError(f"no journal in {folder}: nothing was measured yet; begin with `pzctl measure`")
    return JournalReader(folder)


def journal_samples(
    journal: JournalReader, free: tuple[str, ...] | None = None, *, with_withdrawn: bool = False
) -> list[Sample]:
    """Return every sample with the latest complete measurement of each of its steps, and the build of the newest.

    Withdrawn measurements are left out unless `with_withdrawn`.
    """
    latest: dict[str, dict[str, JournalMeasurement]] = {}
    for measurement in journal.measurements(_counted(with_withdrawn=with_withdrawn)):
        steps = latest.setdefault(measurement.sample.name, {})
        steps.pop(measurement.sample.step, None)
        steps[measurement.sample.step] = measurement  # moves the newest measurement to the end
    if not latest:
        raise NoSamplesError(f"the journal in {journal.name} holds no complete measurement")
    return [_journal_sample(journal, name, steps, free) for name, steps in latest.items()]


def _journal_sample(
    journal: JournalReader, name: str, latest: dict[str, JournalMeasurement], free: tuple[str, ...] | None
) -> Sample:
    newest = list(latest.values())[-1].id
    try:
        build = journal.build(newest)
        known = [step.name for step in build.steps if step.name in latest]
        sweeps = {step: tuple(decode(e).sweep() for e in journal.sweeps(latest[step].id)) for step in known}
    except PzctlError as error:
        return Sample(name, None, str(error))
    notes = tuple(
        f"step {step!r} is left out: the latest build no longer has it" for step in latest if step not in known
    )
    if not known:
        return Sample(name, None, "no step of its latest build was measured", notes)
    return Sample(name, BatchJob(name, FitTask(build, sweeps, free)), notes=notes, measurement=latest[known[-1]].id)


def folder_samples(folder: Path, free: tuple[str, ...] | None = None) -> list[Sample]:
    """Return the sample of every subfolder that holds a build.toml; its name is that of the subfolder.

    Raises NoSamplesError if there is none, FolderMissing.
    """
    if not folder.is_dir():
        raise FolderMissing(f"{folder}: no such folder; one with a subfolder for each sample is needed")
    folders = sorted(path.parent for path in folder.glob(f"*/{BUILD}"))
    if not folders:
        raise NoSamplesError(f"{folder}: no subfolder holds a {BUILD}; each sample needs {BUILD} and STEP.csv files")
    return [folder_sample(path, free) for path in folders]


def by_number(files: Sequence[Path]) -> list[Path]:
    """Return recordings of one step by the number that ends their names; as they are given if more than it differs.

    A shell lists disk-2 before disk, and a drift goes on from one to the next.
    """
    names = {re.sub(r"[-_ ]\d+$", "", path.stem) for path in files}
    return _in_order(files) if len(names) == 1 else list(files)


def _in_order(files: Iterable[Path]) -> list[Path]:
    """Return files in the order of their numbers: disk, disk-2, disk-10. A drift goes on from one to the next."""

    def parts(path: Path) -> list[tuple[int, str]]:
        return [(int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", path.stem)]

    return sorted(files, key=parts)


def folder_sample(folder: Path, free: tuple[str, ...] | None = None) -> Sample:
    """Return the sample of a folder with a build.toml and recordings; it has an `error` if it cannot be fitted."""
    try:
        build = read_build(folder / BUILD)
        steps = [step.name for step in build.steps]
        files = _in_order(path for path in folder.iterdir() if path.suffix.lower() in _TYPES)
        of_file = {path: step_of(path.stem, steps) for path in files}
        sweeps = {step: tuple(read_recording(p) for p in files if of_file[p] == step) for step in steps}
    except PzctlError as error:
        return Sample(folder.name, None, str(error))
    strange = [path for path, step in of_file.items() if step is None]
    notes = [f"{path}: its name begins with none of the steps {', '.join(steps)}; it is left out" for path in strange]
    notes += [f"{sweep.name}: {note}" for of_step in sweeps.values() for sweep in of_step for note in sweep.notes]
    there: dict[str, tuple[Sweep, ...]] = {step: of_step for step, of_step in sweeps.items() if of_step}
    if not there:
        error = (
            f"{folder}: no recording; files named after the steps are needed: {', '.join(f'{s}.csv' for s in steps)}"
        )
        return Sample(folder.name, None, error, tuple(notes))
    job = BatchJob(folder.name, FitTask(build, there, free))
    return Sample(folder.name, job, notes=tuple(notes), build_file=folder / BUILD)


def step_of(stem: str, steps: Sequence[str]) -> str | None:
    """Return the longest step name that a file's name (without extension) begins with, or None.

    The rest must not continue a word or a number: `disk-2` and `disk2` belong to step `disk`, but `diskette` does not,
    and `ml12` does not belong to step `ml1`.
    """
    for step in sorted(steps, key=len, reverse=True):
        rest = stem.removeprefix(step)
        if stem.startswith(step) and not (rest[:1].isalpha() or (rest[:1].isdigit() and step[-1:].isdigit())):
            return step
    return None


def latest_fits(
    journal: JournalReader, fitter: str, step: str | None, *, with_withdrawn: bool = False
) -> dict[str, LatestFit]:
    """Return the latest fit of each fitted sample, by name: that of its newest measurement (of `step`) with a result.

    Withdrawn measurements are left out unless `with_withdrawn`.
    """
    measured = journal.measurements(_counted(with_withdrawn=with_withdrawn))
    fits: dict[str, LatestFit | None] = {measurement.sample.name: None for measurement in measured}
    for measurement in reversed(measured):
        sample = measurement.sample
        if fits[sample.name] is None and step in (None, sample.step):
            fits[sample.name] = _fit_of_measurement(journal, measurement, fitter)
    return {name: fit for name, fit in fits.items() if fit is not None}


def _counted(*, with_withdrawn: bool) -> str:
    """Return the SQL condition that selects the measurements to use."""
    return "state IN ('measured', 'withdrawn')" if with_withdrawn else "state = 'measured'"


def _fit_of_measurement(journal: JournalReader, measurement: JournalMeasurement, fitter: str) -> LatestFit | None:
    if fitter not in journal.fitters(measurement.id):
        return None
    for frames in reversed(journal.fits(measurement.id)):
        answer = decode(frames)
        if isinstance(answer.event, FitEvent) and answer.event.fitter == fitter and answer.event.report is not None:
            return LatestFit(fit_of(answer), measurement, journal.build(measurement.id))
    return None


def sheets_of(builds: Iterable[Build]) -> dict[str, Quantity]:
    """Return the data sheet's or build file's value of each constant (`disk.c33D`) on which all builds agree."""
    values: dict[str, list[Quantity]] = {}
    for build in builds:
        for name, quantity in build.data_sheet.items():
            values.setdefault(name, []).append(quantity)
    return {name: given[0] for name, given in values.items() if all(other.value == given[0].value for other in given)}
