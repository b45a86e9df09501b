"""The list-sweep table and its editor; changes take effect at EDITDONE (PM p.44-45, 415-436).

A segment has at most 201 points, the table 18 segments and 801 points. A new segment starts from the present settings,
later ones from the segment before. A command that does not belong to the table discards the open segment.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..language.messages import CommandError
from .axis import ListSegment, limits, moved_edges
from .settings import TABLE, Number, whole

EDGES = ("STAR", "STOP", "CENT", "SPAN")
FIELDS: Mapping[str, str] = {
    **dict.fromkeys(EDGES, ""),
    "POIN": "points",
    "BWFACT": "bandwidth",
    "POWMOD": "mode",
    "POWE": "level",
    "DCMOD": "bias_mode",
    "DCV": "bias",
    "DCI": "bias_current",
    "PAVERFACT": "point_average",
}
"""Settings that each segment has of its own."""

SEGMENT_POINTS = 201
LIST_POINTS = 801
SEGMENTS = 18


def edge(mnemonic: str, start: float, stop: float) -> float:
    """Return STAR, STOP, CENT or SPAN of a range."""
    return {"STAR": start, "STOP": stop, "CENT": (start + stop) / 2, "SPAN": stop - start}[mnemonic]


@dataclass
class ListTable:
    """The table and its editor."""

    segments: list[ListSegment] = field(default_factory=list[ListSegment])
    """The segments that are swept."""
    _written: list[ListSegment] | None = None
    """The edited table; None while nobody edits it."""
    _draft: ListSegment | None = None
    """The segment that is open."""
    _draft_at: int = 0
    _is_new: bool = False
    """Whether the open segment is not in the table yet."""
    _target: int = 0
    """The segment, from 1, that SADD, SEDI and SDEL use when no number is given."""

    @property
    def is_open(self) -> bool:
        """Whether a segment is open."""
        return self._draft is not None

    @property
    def target(self) -> int:
        """`SEGM?`: 0 while nobody edits the table."""
        return 0 if self._written is None else self._target

    def start(self) -> None:
        """EDITLIST: begin to edit a copy of the table in force. Raises CommandError where a segment is open."""
        self.edit()
        self._written, self._target = self.segments.copy(), len(self.segments)

    def edit(self) -> list[ListSegment]:
        """Begin to edit unless the table is being edited already. Raises CommandError where a segment is open."""
        if self._draft is not None:
            raise CommandError(75)
        if self._written is None:
            self._written, self._target = self.segments.copy(), len(self.segments)
        return self._written

    def choose(self, at: int) -> None:
        """SEGM: choose the target. Raises CommandError."""
        self._target = min(max(at, 1), max(len(self.edit()), 1))

    def add(self, first: ListSegment, at: int | None = None) -> None:
        """SADD: open a new segment below the given one (from 1) or the target; in an empty table it is `first`.

        Raises CommandError 77 where the table is full, and opens the target instead.
        """
        written = self.edit()
        below = self._within(at)
        left = LIST_POINTS - sum(s.points for s in written)
        if left < 2 or len(written) >= SEGMENTS:
            self.open(at)
            raise CommandError(77)
        self._draft, self._draft_at, self._is_new = first, below, True
        if written:
            before = written[max(below, 1) - 1]
            self._draft = replace(before, start=before.stop, points=min(SEGMENT_POINTS, left))

    def open(self, at: int | None = None) -> None:
        """SEDI: open a segment that exists. Raises CommandError where there is none."""
        written = self.edit()
        if not written:
            raise CommandError(124)
        self._draft_at, self._is_new = max(self._within(at), 1) - 1, False
        self._draft = written[self._draft_at]

    def delete(self, at: int | None = None) -> None:
        """SDEL: delete a segment; the target is then the segment that takes over its number. Raises CommandError."""
        written = self.edit()
        if not written:
            raise CommandError(124)
        del written[max(self._within(at), 1) - 1]
        self._target = min(self._target, len(written))

    def clear(self) -> None:
        """CLEL: drop every segment. Raises CommandError where one is open."""
        self.edit().clear()
        self._target = 0

    def finish(self) -> None:
        """SDON: put the open segment into the table. Raises CommandError where none is open."""
        if self._draft is None or self._written is None:
            raise CommandError(-221)
        self._written[self._draft_at : self._draft_at + (not self._is_new)] = [self._draft]
        self._draft, self._target = None, self._draft_at + 1

    def scratch(self) -> None:
        """Drop the open segment. Raises CommandError to report it where one was open."""
        if self._draft is not None:
            self._draft = None
            raise CommandError(74)

    def done(self, in_use: bool) -> None:
        """EDITDONE: put the edited table in force.

        Raises CommandError where a segment was open (it is lost), and where a table that is `in_use` would become
        empty: the old table then stays in force.
        """
        written, self._written = self._written, None
        if in_use and not written:
            self._draft = None
            raise CommandError(124)
        self.segments = self.segments if written is None else written
        self.scratch()

    def edits(self, mnemonic: str) -> bool:
        """Return whether this setting now belongs to the open segment."""
        return self._draft is not None and mnemonic in FIELDS

    def set(self, mnemonic: str, argument: bytes, parameter: str) -> None:
        """Set a value of the open segment; `parameter` is what is swept. Raises CommandError."""
        draft = self._edited()
        if mnemonic in EDGES:
            kind = limits("STAR", parameter, "LIN")
            start, stop = moved_edges(mnemonic, argument, draft.start, draft.stop, kind)
            self._draft = replace(draft, start=start, stop=stop)
        elif mnemonic == "POIN":
            others = sum(s.points for k, s in enumerate(self._written or ()) if self._is_new or k != self._draft_at)
            self._draft = replace(draft, points=whole(argument, 2, min(SEGMENT_POINTS, LIST_POINTS - others)))
        else:
            kind = level_kind(draft.mode) if mnemonic == "POWE" else TABLE[mnemonic]
            fields: dict[str, Any] = {**vars(draft), FIELDS[mnemonic]: kind.parse(argument)}
            self._draft = ListSegment(**fields)

    def query(self, mnemonic: str) -> str:
        """Return the reply to a query of the open segment. Raises CommandError."""
        draft = self._edited()
        if mnemonic in EDGES:
            return limits("STAR", "FREQ", "LIN").answer(edge(mnemonic, draft.start, draft.stop))
        kind = level_kind(draft.mode) if mnemonic == "POWE" else TABLE[mnemonic]
        return kind.answer(vars(draft)[FIELDS[mnemonic]])

    def _within(self, at: int | None) -> int:
        """Return the number of the nearest existing segment, or 0 in an empty table."""
        return min(max(self._target if at is None else at, 0), len(self._written or ()))

    def _edited(self) -> ListSegment:
        if self._draft is None:
            raise CommandError(-221)
        return self._draft


def level_kind(mode: str) -> Number:
    """Return range and default of the oscillator level, by POWMOD."""
    if mode == "VOLT":
        return Number(5e-3, 1.0, 0.5, "V", 1e-3)
    return Number(200e-6, 20e-3, 200e-6, "A", 10e-6)
