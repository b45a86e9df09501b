"""Keeping what a batch found: each result goes into the journal, as if its fitter had answered the measurement."""

from collections.abc import Sequence
from pathlib import Path

from ..fitters.batch import Outcome
from .client import Client
from .config import journal_of, settings
from .journal import Journal
from .location import find
from .paths import journal_folder
from .reports import curve_columns, report_of
from .samples import Sample
from .wire import FitEvent


def keep(home: Path, samples: Sequence[Sample], outcomes: Sequence[Outcome]) -> None:
    """Hand in the results of `samples` to the daemon of this data folder, or write them down where none runs.

    A result that the same version found before from the same sweeps is there already, and not written again. Raises
    DaemonError or JournalError.
    """
    measurements = {sample.name: sample for sample in samples}
    where = find(home)
    if where is not None:
        with Client(where.events, where.requests, where.key) as client:
            for outcome in outcomes:
                _submit(client, measurements[outcome.sample], outcome)
        return
    journal = Journal(journal_folder(home), *journal_of(settings({})))
    try:
        for outcome in outcomes:
            _write(journal, measurements[outcome.sample], outcome)
    finally:
        journal.close()


def _sweeps(sample: Sample) -> tuple[str, ...]:
    return tuple(sweep.id for of_step in sample.job.task.sweeps.values() for sweep in of_step) if sample.job else ()


def _submit(client: Client, sample: Sample, outcome: Outcome) -> None:
    result = outcome.result
    if result is not None and sample.measurement is not None:
        client.submit(sample.measurement, _sweeps(sample), result.fitter, result.version, result)


def _write(journal: Journal, sample: Sample, outcome: Outcome) -> None:
    known = journal.measurement(sample.measurement or "")
    result = outcome.result
    if result is None or known is None:
        return
    columns, payload = curve_columns(result.curves)
    event = FitEvent(
        measurement=known.id,
        sample=known.sample,
        fitter=result.fitter,
        version=result.version,
        sweeps=_sweeps(sample),
        report=report_of(result),
        curves=tuple(curve.step for curve in result.curves),
        columns=columns,
    )
    if journal.answered(event) is None:
        journal.append(event, payload)
