"""Date and fixture of the compensation of each sweep, with a note if it is too old or not dated."""

import dataclasses
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from ....models.sweep import Sweep
from ...files.compensation_record import CompensationRecord, record_of

UNDATED = "The instrument uses a compensation of unknown date and fixture; `pzctl compensate` makes a dated one."
"""The note of a sweep whose compensation is not recorded, or differs from the record."""


class CompensationCheck:
    """Adds the record of the compensation to a sweep; it never refuses one."""

    def __init__(self, record: Path, days: float | None) -> None:
        """`record` is the file that `pzctl compensate` writes; a compensation is valid for `days` (None: for ever)."""
        self._record = record
        self._days = days

    def __call__(self, sweep: Sweep) -> Sweep:
        """Return the sweep with date and fixture of its compensation in its settings, and with a note if needed."""
        in_use: list[str] = sweep.settings.get("compensation") or []
        if not in_use:
            return sweep
        known = record_of(self._record, str(sweep.settings.get("instrument")))
        if known is None or not _is(known, in_use, sweep.settings.get("adapter")):
            return dataclasses.replace(sweep, notes=(*sweep.notes, UNDATED))
        settings = {**sweep.settings, "compensation_taken": known.taken, "compensation_fixture": known.fixture}
        old = self._too_old(known, sweep.time)
        return dataclasses.replace(sweep, settings=settings, notes=(*sweep.notes, old) if old else sweep.notes)

    def _too_old(self, known: CompensationRecord, when: str) -> str | None:
        """Return the note of a sweep started at `when`, or None if the compensation was still valid."""
        age, fixture = _days_between(known.taken, when), f" of fixture {known.fixture!r}" if known.fixture else ""
        if age is None:
            return UNDATED
        if self._days is None or age <= self._days:
            return None
        return (
            f"The compensation{fixture} was {age:.1f} days old, taken on {known.taken[:10]}; this bench allows "
            f"{self._days:g} days (compensation_days)."
        )


def _is(known: CompensationRecord, in_use: Sequence[str], adapter: str | None) -> bool:
    """Return whether the recorded compensation is the one that the instrument uses."""
    return sorted(known.standards) == sorted(in_use) and known.adapter == adapter


def _days_between(taken: str, when: str) -> float | None:
    """Return the days between two RFC 3339 times, or None if the first is not valid."""
    try:
        end = datetime.fromisoformat(when) if when else datetime.now(UTC)
        return (end - datetime.fromisoformat(taken)).total_seconds() / 86400
    except (ValueError, TypeError):
        return None
