"""Writing results found outside the daemon into the journal, as if their fitter had answered the daemon."""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

from ...fitters.interface import FitResult
from ...fitters.population.batch import BatchOutcome
from ..client.client import Client
from ..client.location import find
from ..files.config import journal_of, settings
from ..files.paths import journal_folder
from ..journal.journal_writer import JournalWriter
from ..wire.events import FitEvent
from ..wire.result_messages import curve_columns, report_of
from .sample_selection import Sample

SaveResult: TypeAlias = Callable[[str, Sequence[str], FitResult], None]
"""Writes a result into the journal, given the measurement's id, the ids of its sweeps, and the result."""


@contextmanager
def keeping(home: Path) -> Generator[SaveResult]:
    """Yield a function that submits results to the daemon of this data folder, or writes them itself if none runs.

    A result of the same version and the same sweeps is not written twice. Raises DaemonError or JournalError.
    """
    location = find(home)
    if location is not None:
        with Client(location.events, location.requests, location.key) as client:
            yield lambda measurement, sweeps, result: client.submit(
                measurement, sweeps, result.fitter, result.version, result
            )
        return
    journal = JournalWriter(journal_folder(home), *journal_of(settings({})))
    try:
        yield lambda measurement, sweeps, result: _write(journal, measurement, sweeps, result)
    finally:
        journal.close()


def keep(home: Path, samples: Sequence[Sample], outcomes: Sequence[BatchOutcome]) -> None:
    """Write the results of `samples` into the journal, each for its measurement. Raises DaemonError or JournalError."""
    by_name = {sample.name: sample for sample in samples}
    with keeping(home) as put:
        for outcome in outcomes:
            sample = by_name[outcome.sample]
            if outcome.result is not None and sample.measurement is not None:
                put(sample.measurement, _sweeps(sample), outcome.result)


def _sweeps(sample: Sample) -> tuple[str, ...]:
    return tuple(sweep.id for of_step in sample.job.task.sweeps.values() for sweep in of_step) if sample.job else ()


def _write(journal: JournalWriter, measurement: str, sweeps: Sequence[str], result: FitResult) -> None:
    known = journal.measurement(measurement)
    if known is None:
        return
    columns, payload = curve_columns(result.curves)
    event = FitEvent(
        measurement=known.id,
        sample=known.sample,
        fitter=result.fitter,
        version=result.version,
        sweeps=tuple(sweeps),
        report=report_of(result),
        curves=tuple(curve.step for curve in result.curves),
        columns=columns,
    )
    if journal.answered(event) is None:
        journal.append(event, payload)
