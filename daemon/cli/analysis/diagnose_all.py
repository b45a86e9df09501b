"""`pzctl diagnose --all`: shared effects of the samples of a bench, and effects of single samples."""

import contextlib
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ....models.base.names import shown
from .fit_options import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from ....fitters.population.batch import BatchJob
    from ....fitters.population.joint_diagnosis import HowToDiagnose
    from ....models.build import EffectSpec
    from ...samples.sample_selection import Sample


def diagnose_all(
    words: list[str],
    how: "HowToDiagnose",
    accuracy: float | None,
    dask: str | None,
    processes: int | None,
    *,
    as_json: bool,
) -> None:
    """Diagnose every sample of the journal, or of the one folder in `words`, together, and print the result.

    If laws are to be learned, everything found is written to the build file of each sample of a folder; the builds in a
    journal are a record, so for these samples it is printed.

    `accuracy`: of the analyzer, in per cent of |Z|. `processes`: how many at a time, None for one on each core. Raises
    UsageError, NoSamplesError, JournalError, BatchError or TooFewSamplesError if there is nothing to diagnose together,
    BuildError if a build file cannot be written.
    """
    from ....fitters.population.batch import on_dask
    from ....fitters.population.joint_diagnosis import diagnose_together
    from ...report.tables.joint_output import joint_json, print_joint
    from ...report.terminal import console
    from ...samples.sample_selection import sheets_of

    samples = _samples(words)
    for sample in samples:
        for note in (*sample.notes, *([sample.error] if sample.error else [])):
            print(shown(f"note: {sample.name}: {note}"), file=sys.stderr)
    jobs = [_accurate(sample.job, accuracy) for sample in samples if sample.job is not None]
    sheets = sheets_of(job.task.build for job in jobs if job.task.build is not None)
    screen = console(stderr=True)
    with (
        on_dask(dask) if dask is not None else contextlib.nullcontext() as client,
        screen.status("diagnosing") as status,
    ):
        joint = diagnose_together(jobs, sheets, how, client, status.update, processes)
    unread = {sample.name: str(sample.error) for sample in samples if sample.job is None}
    joint = replace(joint, failed={**unread, **joint.failed})
    if as_json:
        print(json.dumps(joint_json(joint)))
    else:
        print_joint(console(), joint)
    if how.learn:
        for sample in samples:
            if sample.job is not None and sample.name in joint.own:
                _state(sample, joint.effects_of(sample.name), console(stderr=as_json))


def _state(sample: "Sample", effects: "tuple[EffectSpec, ...]", screen: "Console") -> None:
    """Write what a sample has to its build file, or print it if it has none. Raises BuildError."""
    from ...files.builds.effects_writing import append_effects, effects_text

    build = None if sample.job is None else sample.job.task.build
    if not effects or build is None:
        return
    if sample.build_file is not None:
        screen.print(append_effects(sample.build_file, effects), soft_wrap=True)
    else:
        text = effects_text(effects, build)
        screen.print(f"to be added to the build file of {sample.name}:\n{text}", soft_wrap=True, markup=False)


def _samples(words: list[str]) -> "list[Sample]":
    from ...samples.sample_selection import folder_samples, journal_samples, open_journal

    if len(words) > 1 or any("=" in word for word in words):
        raise UsageError(f"--all takes one folder, or nothing for the journal; found {' '.join(words)}")
    if words:
        return folder_samples(Path(words[0]))
    journal = open_journal()
    try:
        return journal_samples(journal)
    finally:
        journal.close()


def _accurate(job: "BatchJob", accuracy: float | None) -> "BatchJob":
    """Return a job whose recordings state this accuracy of the analyzer."""
    if accuracy is None:
        return job
    told = {"accuracy": accuracy / 100}
    sweeps = {
        step: tuple(replace(sweep, settings={**sweep.settings, **told}) for sweep in of_step)
        for step, of_step in job.task.sweeps.items()
    }
    return replace(job, task=replace(job.task, sweeps=sweeps))
