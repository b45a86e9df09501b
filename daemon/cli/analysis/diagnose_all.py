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
    from ....fitters.population.batch import BatchJob
    from ...samples.sample_selection import Sample


def diagnose_all(
    words: list[str],
    effects: tuple[str, ...] | None,
    accuracy: float | None,
    dask: str | None,
    processes: int | None,
    *,
    as_json: bool,
) -> None:
    """Diagnose every sample of the journal, or of the one folder in `words`, together, and print the result.

    `accuracy`: of the analyzer, in per cent of |Z|. `processes`: how many at a time, None for one on each core. Raises
    UsageError, NoSamplesError, JournalError, BatchError or TooFewSamplesError if there is nothing to diagnose together.
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
    with on_dask(dask) if dask else contextlib.nullcontext() as client, screen.status("diagnosing") as status:
        joint = diagnose_together(jobs, sheets, effects, client, status.update, processes)
    unread = {sample.name: str(sample.error) for sample in samples if sample.job is None}
    joint = replace(joint, failed={**unread, **joint.failed})
    if as_json:
        print(json.dumps(joint_json(joint)))
    else:
        print_joint(console(), joint)


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
