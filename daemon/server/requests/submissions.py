"""Checks of the answers that fitters submit: complete, about existing sweeps, and limited in number."""

from collections.abc import Sequence
from typing import Any

from ...journal.journal_reader import JournalMeasurement
from ...journal.journal_writer import JournalWriter
from ...wire import requests as ask
from ...wire.diagnosis_form import check_diagnosis
from ...wire.events import DiagnosisEvent, FitEvent
from ...wire.frames import WireError, unpack
from ...wire.result_messages import curves_of
from .request_errors import RequestError

MOST_ANSWERS = 100
"""Greatest number of answers of one fitter to one measurement, which differ in version or sweeps."""

MOST_ANSWERED = 64 << 20
"""Greatest size in bytes of all answers to one measurement, since one request reads all of them."""


def checked(
    journal: JournalWriter, known: JournalMeasurement, request: ask.SubmitRequest, raw: Sequence[bytes]
) -> FitEvent | DiagnosisEvent | None:
    """Return the event for a submission, or None if the same was submitted before.

    Raises RequestError if it is not a valid answer, WireError if its columns do not fit the header.
    """
    event = _event(request, known)
    if known.state != "measured":
        raise RequestError("not-measured", f"measurement {known.id!r} is {known.state}; it takes no answers of fitters")
    if fault := _sweeps_fault(journal, known, request.sweeps):
        raise RequestError("no-such-sweep", f"answer of {request.fitter!r}: {fault}")
    curves_of(request.curves, unpack(request.columns, raw))
    if journal.answered(event) is not None:
        return None
    if journal.answers(known.id, request.fitter) >= MOST_ANSWERS:
        raise RequestError(
            "too-many-answers", f"fitter {request.fitter!r} answered this measurement {MOST_ANSWERS} times already"
        )
    if journal.answers_size(known.id) + sum(map(len, raw)) > MOST_ANSWERED:
        raise RequestError("too-many-answers", f"the answers to this measurement have {MOST_ANSWERED >> 20} MB already")
    return event


def _sweeps_fault(journal: JournalWriter, known: JournalMeasurement, sweeps: Sequence[str]) -> str:
    """Return what is wrong with the sweeps of an answer, or an empty string.

    An answer may use the sweeps of the measurement and of the earlier steps of its sample.
    """
    steps = [step.name for step in journal.build(known.id).steps]
    allowed = steps[: steps.index(known.sample.step) + 1]
    for sweep in dict.fromkeys(sweeps):
        of = journal.sample_of_sweep(sweep)
        if of is None:
            return f"the journal holds no sweep {sweep!r}"
        if of.name != known.sample.name or of.step not in allowed:
            return (
                f"sweep {sweep!r} is of {of.name!r} at step {of.step!r}; measurement {known.id!r} is of "
                f"{known.sample.name!r} at step {known.sample.step!r}"
            )
    own_sweeps = {*sweeps} & {*journal.sweep_ids(known.id)}
    return "" if own_sweeps else f"no sweep of measurement {known.id!r} is named"


def _event(request: ask.SubmitRequest, known: JournalMeasurement) -> FitEvent | DiagnosisEvent:
    """Return the event for a fitter's answer. Raises RequestError if it does not hold exactly one answer."""
    given = [name for name in ("report", "error", "diagnosis") if getattr(request, name) is not None]
    if len(given) != 1:
        raise RequestError(
            "bad-answer",
            f"answer of {request.fitter!r} holds {' and '.join(given) or 'nothing'}; "
            "exactly one of report, error, diagnosis is needed",
        )
    fields: dict[str, Any] = {"measurement": known.id, "sample": known.sample}
    fields |= {name: getattr(request, name) for name in ("fitter", "version", "sweeps", "curves", "columns")}
    if request.diagnosis is not None:
        try:
            check_diagnosis(request.diagnosis)
        except WireError as error:
            raise RequestError("bad-answer", f"answer of {request.fitter!r}: {error}") from None
        return DiagnosisEvent(**fields, diagnosis=request.diagnosis)
    return FitEvent(**fields, report=request.report, error=request.error)
