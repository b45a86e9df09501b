"""`pzctl fit --all`: fit every sample of the journal or of a folder, then summarise the population."""

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....models.base.errors import CannotError, PzctlError
from ....models.base.names import shown
from .fit_options import FitSelection, UsageError, check_options

if TYPE_CHECKING:
    from ....fitters.population.batch import BatchOutcome
    from ....fitters.population.population_statistics import Population
    from ...samples.sample_selection import Sample


class BatchFailure(CannotError):
    """Some samples could not be fitted."""


def _amended(sample: "Sample", wanted: FitSelection) -> "Sample":
    """Return the sample with the requested changes to build and task.

    A sample whose build lacks a named constant gets an `error` in place of a job.
    """
    from ....fitters.engine.parameters.overrides import amended

    job = sample.job
    if job is None or job.task.build is None:
        return sample
    try:
        task = replace(job.task, build=amended(job.task.build, wanted.amendments), options=wanted.options)
    except PzctlError as error:
        return replace(sample, job=None, error=str(error))
    return replace(sample, job=replace(job, task=task))


def fit_all(
    words: Sequence[str],
    fitters: Sequence[str],
    wanted: FitSelection,
    dask: str | None,
    processes: int | None,
    *,
    as_json: bool,
    with_withdrawn: bool,
) -> None:
    """Fit all samples with each of `fitters` (none: mason) and print the populations.

    `words` is empty (the journal's samples) or names one folder. `processes`: how many fit at a time, None for one on
    each core. Results of the journal's samples are added to the
    journal. A sample that fails is reported on standard error; the others go on. Raises BatchFailure at the end if any
    failed; UsageError, NoSamplesError, JournalError, PluginError or BatchError if nothing can be fitted.
    """
    from ....fitters.plugins import DEFAULT, load_fitter
    from ...samples.sample_selection import folder_samples, journal_samples, open_journal

    if len(words) > 1 or any("=" in word for word in words):
        raise UsageError(f"--all takes one folder, or nothing for the journal; found {' '.join(words)}")
    if words:
        samples = folder_samples(Path(words[0]), wanted.free)
    else:
        journal = open_journal()
        try:
            samples = journal_samples(journal, wanted.free, with_withdrawn=with_withdrawn)
        finally:
            journal.close()
    for fitter in fitters or [DEFAULT]:
        check_options(load_fitter(fitter), wanted.options)
    samples = [_amended(sample, wanted) for sample in samples]
    for sample in samples:
        for note in sample.notes:
            print(shown(f"note: {sample.name}: {note}"), file=sys.stderr)
    batches = {fitter: _batch(samples, fitter, dask, processes) for fitter in fitters or [DEFAULT]}
    _report(samples, batches, as_json)
    failed = [outcome.sample for outcomes in batches.values() for outcome in outcomes if outcome.result is None]
    if failed:
        total = len(samples) * len(batches)
        raise BatchFailure(f"{len(failed)} of {total} fits failed: {', '.join(dict.fromkeys(failed))}; see above")


def _batch(samples: "Sequence[Sample]", fitter: str, dask: str | None, processes: int | None) -> "list[BatchOutcome]":
    """Fit, add the results of the journal's samples to it, and return one outcome per sample, in the same order."""
    from rich.progress import Progress

    from ....fitters.population.batch import BatchOutcome, fit_on_cores, fit_on_dask
    from ...files.paths import home
    from ...report.terminal import console
    from ...samples.result_writer import keep

    screen = console(stderr=True)
    jobs = [sample.job for sample in samples if sample.job is not None]
    with Progress(console=screen, transient=True, disable=not screen.is_terminal) as progress:
        bar = progress.add_task(fitter, total=len(jobs))

        def report_outcome(outcome: BatchOutcome) -> None:
            screen.print(f"{fitter}: {_line(outcome)}", highlight=False, markup=False, soft_wrap=True)
            progress.advance(bar)

        outcomes = (
            fit_on_dask(jobs, fitter, dask, report_outcome)
            if dask is not None
            else fit_on_cores(jobs, fitter, report_outcome, processes)
        )
    of_journal = [sample for sample in samples if sample.measurement is not None]
    if of_journal:
        try:
            keep(home(), of_journal, outcomes)
        except PzctlError as error:
            screen.print(f"! not kept in the journal: {error}", style="yellow", highlight=False, markup=False)
    by_name = {outcome.sample: outcome for outcome in outcomes}
    return [by_name.get(sample.name) or _unread(sample) for sample in samples]


def _unread(sample: "Sample") -> "BatchOutcome":
    from ....fitters.population.batch import BatchOutcome

    print(shown(f"{sample.name}: {sample.error}"), file=sys.stderr)
    return BatchOutcome(sample.name, None, sample.error)


def _line(outcome: "BatchOutcome") -> str:
    result = outcome.result
    if result is None:
        return f"{outcome.sample}: {outcome.error}"
    stopped = "" if result.converged else ", did not converge"
    return (
        f"{outcome.sample}: {' + '.join(result.steps)}, chi2/dof {result.chi2_per_dof:.3g}, "
        f"RMS log error {result.rms_log_error:.2g}, {result.seconds:.2f} s{stopped}"
    )


def _population(samples: "Sequence[Sample]", outcomes: "Sequence[BatchOutcome]") -> "Population":
    from ....fitters.population.population_statistics import population
    from ...samples.sample_selection import sheets_of

    fits = {outcome.sample: outcome.result for outcome in outcomes if outcome.result is not None}
    builds = (sample.job.task.build for sample in samples if sample.job is not None)
    return population(fits, sheets_of(build for build in builds if build is not None))


def _report(samples: "Sequence[Sample]", batches: "dict[str, list[BatchOutcome]]", as_json: bool) -> None:
    from ...report.tables.population_table import print_population
    from ...report.terminal import console

    if as_json:
        objects = [_plain(samples, fitter, outcomes) for fitter, outcomes in batches.items()]
        print(json.dumps(objects[0] if len(objects) == 1 else {"batches": objects}))
        return
    for fitter, outcomes in batches.items():
        console().print(f"fitter {fitter}", style="bold", highlight=False)
        print_population(console(), _population(samples, outcomes))


def _plain(samples: "Sequence[Sample]", fitter: str, outcomes: "Sequence[BatchOutcome]") -> dict[str, Any]:
    from ...report.json_output.fit_json import fit_json
    from ...report.tables.population_table import population_json

    return {
        "fitter": fitter,
        "fits": {outcome.sample: fit_json(outcome.result) for outcome in outcomes if outcome.result is not None},
        "failed": {outcome.sample: outcome.error for outcome in outcomes if outcome.result is None},
        "population": population_json(_population(samples, outcomes)),
    }
