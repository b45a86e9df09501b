"""What changed between two measurements of the journal, for the page."""

from typing import Any

import msgspec

from ...models.base.errors import PzctlError
from ...models.sweep import Sweep
from ..report.json_output.comparison_json import comparison_json
from ..report.probability import probability_text
from ..samples.sample_record import sample_record
from ..samples.sample_selection import open_journal
from .page_json import numbers_json
from .worker_process import PATIENCE, NoAnswer, WorkerProcess


class PageComparisonError(PzctlError):
    """A comparison gave no answer, or one of its sweeps does not exist."""


class Recorded(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A sweep of a measurement."""

    measurement: str
    segment: int = 1
    """Counted from 1."""


class ComparisonRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A request of the page: the sweep that was kept, and the one it is compared with."""

    before: Recorded
    after: Recorded


def compared(worker: WorkerProcess, request: ComparisonRequest) -> dict[str, Any]:
    """Return what changed, with the curves. Raises PzctlError."""
    try:
        return worker.ask(_answer, request)
    except NoAnswer:
        raise PageComparisonError(
            f"the comparison gave no answer within {PATIENCE:g} s, or its process ended"
        ) from None


def allowed_sweeps(count: int) -> str:
    """Return which sweeps of a measurement with so many there are, in words."""
    return f"allowed are 1 to {count}" if count else "it has none yet"


def _answer(request: ComparisonRequest) -> dict[str, Any]:
    """Compare two sweeps; runs in the worker's process."""
    from ...fitters.compare.compare import compare

    journal = open_journal()
    try:
        sweeps: list[Sweep] = []
        for wanted in (request.before, request.after):
            step, *others = sample_record(journal, wanted.measurement).steps
            if others:
                raise PageComparisonError(f"{wanted.measurement} is no measurement but a sample; give the id of one")
            if not 1 <= wanted.segment <= len(step.sweeps):
                raise PageComparisonError(
                    f"{wanted.measurement} has no sweep {wanted.segment}; {allowed_sweeps(len(step.sweeps))}"
                )
            sweeps.append(step.sweeps[wanted.segment - 1])
    finally:
        journal.close()
    comparison = compare([sweeps[0]], [sweeps[1]])
    curve, found = comparison.curve, comparison_json(comparison)
    return found | {
        "findings": [one | {"probability_text": probability_text(one["probability"])} for one in found["findings"]],
        "curve": {
            "f": curve.frequency.tolist(),
            "before": numbers_json(curve.before),
            "after": numbers_json(curve.after),
            "explained": numbers_json(curve.explained),
        },
    }
