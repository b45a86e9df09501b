"""Limit lines: the table of one trace, its editor, and the test of a sweep (PM p.46-47, 91, 324-340, 380)."""

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.base.arrays import Reals
from ..language.messages import CommandError

SEGMENTS = 18
NOT_TESTED, FAILED, PASSED = -1.0, 0.0, 1.0


@dataclass(frozen=True)
class LimitSegment:
    """One line of the table; limits run straight from its start to its stop."""

    start: float
    stop: float
    upper_start: float = 0.0
    upper_stop: float = 0.0
    lower_start: float = 0.0
    lower_stop: float = 0.0
    tested: bool = True


@dataclass
class LimitTable:
    """The table of one trace and its editor; segment commands open the table and the segment if necessary."""

    segments: list[LimitSegment] = field(default_factory=list[LimitSegment])
    """In force."""
    _written: list[LimitSegment] | None = None
    _draft: LimitSegment | None = None
    _draft_at: int = 0
    _is_new: bool = False
    _target: int = 0

    @property
    def target(self) -> int:
        """`LIMSEGM?`: 0 while nobody edits the table."""
        return 0 if self._written is None else self._target

    def start(self) -> None:
        """EDITLIML: begin to edit a copy of the table in force. Raises CommandError where a segment is open."""
        self.edit()
        self._written, self._target = self.segments.copy(), len(self.segments)

    def edit(self) -> list[LimitSegment]:
        """Begin to edit unless the table is being edited already. Raises CommandError where a segment is open."""
        if self._draft is not None:
            raise CommandError(75)
        if self._written is None:
            self._written, self._target = self.segments.copy(), len(self.segments)
        return self._written

    def choose(self, at: int) -> None:
        """LIMSEGM. Raises CommandError."""
        self._target = min(max(at, 1), max(len(self.edit()), 1))

    def add(self, first: LimitSegment, at: int | None = None) -> None:
        """LIMSADD: open a new segment below the given one or the target. Raises CommandError."""
        written = self.edit()
        if len(written) >= SEGMENTS:
            raise CommandError(64)
        self._draft_at, self._is_new = self._within(at), True
        self._draft = written[max(self._draft_at, 1) - 1] if written else first

    def open(self, first: LimitSegment, at: int | None = None) -> None:
        """LIMSEDI: open a segment, or a new one in an empty table. Raises CommandError."""
        if not self.edit():
            self.add(first)
            return
        self._draft_at, self._is_new = max(self._within(at), 1) - 1, False
        self._draft = self.edit()[self._draft_at]

    def delete(self, at: int | None = None) -> None:
        """LIMSDEL. Raises CommandError."""
        written = self.edit()
        if not written:
            raise CommandError(-221)
        del written[max(self._within(at), 1) - 1]
        self._target = min(self._target, len(written))

    def clear(self) -> None:
        """LIMCLEL. Raises CommandError where a segment is open."""
        self.edit().clear()
        self._target = 0

    def change(self, first: LimitSegment, **fields: float | bool) -> None:
        """Set values of the open segment, opening the target where none is. Raises CommandError."""
        self._draft = replace(self.draft(first), **fields)

    def draft(self, first: LimitSegment) -> LimitSegment:
        """Return the open segment, opening the target where none is. Raises CommandError."""
        if self._draft is None:
            self.open(first)
        if self._draft is None:
            raise CommandError(-221)
        return self._draft

    def finish(self) -> None:
        """LIMSDON: put the open segment into the table. Raises CommandError where none is open."""
        if self._draft is None or self._written is None:
            raise CommandError(-221)
        self._written[self._draft_at : self._draft_at + (not self._is_new)] = [self._draft]
        self._draft, self._target = None, self._draft_at + 1

    def abandon(self) -> None:
        """LIMSQUI: discard the changes of the open segment."""
        self._draft = None

    def done(self) -> None:
        """LIMEDONE: put the table in force."""
        self._draft = None
        self.segments = self.segments if self._written is None else self._written
        self._written = None

    def _within(self, at: int | None) -> int:
        return min(max(self._target if at is None else at, 0), len(self._written or ()))


@dataclass(frozen=True, eq=False)
class Tested:
    """The test of a sweep. Every array has the shape (N,)."""

    result: Reals
    """PASSED, FAILED or NOT_TESTED."""
    upper: Reals
    lower: Reals


def tested(segments: list[LimitSegment], x: Reals, y: Reals, shift_x: float, shift_y: float) -> Tested:
    """Test a trace against the table; LIMIPRMO and LIMIAMPO shift its limits."""
    result, upper, lower = np.full(x.size, NOT_TESTED), np.zeros(x.size), np.zeros(x.size)
    for s in segments:
        start, stop = sorted((s.start + shift_x, s.stop + shift_x))
        inside = (x >= start) & (x <= stop) & s.tested
        share = (x[inside] - start) / (stop - start) if stop > start else np.zeros(int(inside.sum()))
        upper[inside] = s.upper_start + (s.upper_stop - s.upper_start) * share + shift_y
        lower[inside] = s.lower_start + (s.lower_stop - s.lower_start) * share + shift_y
        passed = (y[inside] <= upper[inside]) & (y[inside] >= lower[inside])
        result[inside] = np.where(passed & (result[inside] != FAILED), PASSED, FAILED)
    return Tested(result, upper, lower)
