"""The list-sweep table and its editor; changes take effect at EDITDONE.

A segment has at most 201 points and all together 801 (reference 2.3); the most segments there may be, and that they may
not overlap, is our assumption.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

from ..language.messages import CommandError
from .axis import ListSegment, limits, moved_edges
from .settings import TABLE, Number, number

EDGES = ("STAR", "STOP", "CENT", "SPAN")
FIELDS: Mapping[str, str] = {
    **dict.fromkeys(EDGES, ""),
    "POIN": "points",
    "BWFACT": "bandwidth",
    "POWE": "level",
    "DCV": "bias",
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
    """The segment that is being edited."""
    _draft_at: int = 0

    def edit(self) -> None:
        """EDITLIST: open the table."""
        self._written, self._draft = self.segments.copy(), None

    def done(self, in_use: bool) -> None:
        """EDITDONE: apply the edited table without a segment that is still open.

        Raises CommandError if a table that is `in_use` would become empty; it then stays as it was.
        """
        written, self._written, self._draft = self._written, None, None
        if in_use and not written:
            raise CommandError(-221, "SETTINGS CONFLICT; LIST SWEEP IS ON")
        self.segments = self.segments if written is None else written

    def begin(self, fresh: ListSegment, at: int | None = None) -> None:
        """Open the segment with this number (from 1) for editing, or a `fresh` one. Raises CommandError."""
        written = self._open()
        if at is None:
            if len(written) >= SEGMENTS:
                raise CommandError(-223, "TOO MUCH DATA")
            self._draft_at, self._draft = len(written), fresh
        elif 1 <= at <= len(written):
            self._draft_at, self._draft = at - 1, written[at - 1]
        else:
            raise CommandError(-222, "DATA OUT OF RANGE")

    def clear(self) -> None:
        """Drop every segment. Raises CommandError where the table is not being edited."""
        self._open().clear()

    def edits(self, mnemonic: str) -> bool:
        """Return whether this setting now belongs to the edited segment."""
        return self._draft is not None and mnemonic in FIELDS

    def set(self, mnemonic: str, argument: bytes, level: Number) -> None:
        """Set a value of the edited segment; `level` is the range of the oscillator level. Raises CommandError."""
        draft = self._edited()
        fields = vars(draft).copy()
        if mnemonic in EDGES:
            kind = limits("STAR", "FREQ", "LIN")
            fields["start"], fields["stop"] = moved_edges(mnemonic, argument, draft.start, draft.stop, kind)
        elif mnemonic == "POIN":
            fields["points"] = round(min(max(number(argument), 2), SEGMENT_POINTS))
        else:
            kind = level if mnemonic == "POWE" else TABLE[mnemonic]
            fields[FIELDS[mnemonic]] = kind.parse(argument)
        self._draft = ListSegment(**fields)

    def query(self, mnemonic: str, level: Number) -> str:
        """Return the reply to a query of the segment that is edited. Raises CommandError."""
        draft = self._edited()
        if mnemonic in EDGES:
            return limits("STAR", "FREQ", "LIN").answer(edge(mnemonic, draft.start, draft.stop))
        kind = level if mnemonic == "POWE" else TABLE[mnemonic]
        return kind.answer(vars(draft)[FIELDS[mnemonic]])

    def finish(self) -> None:
        """Put the edited segment into the table. Raises CommandError if the table would not be a valid sweep."""
        segments = self._open().copy()
        segments[self._draft_at : self._draft_at + 1] = [self._edited()]
        self._draft = None
        if sum(s.points for s in segments) > LIST_POINTS:
            raise CommandError(-223, "TOO MUCH DATA")
        if any(b.start < a.stop for a, b in pairwise(segments)):
            raise CommandError(-221, "SETTINGS CONFLICT; SEGMENTS OVERLAP")
        self._written = segments

    def _open(self) -> list[ListSegment]:
        if self._written is None:
            raise CommandError(-221, "SETTINGS CONFLICT; EDITLIST FIRST")
        return self._written

    def _edited(self) -> ListSegment:
        if self._draft is None:
            raise CommandError(-221, "SETTINGS CONFLICT; NO SEGMENT IS BEING EDITED")
        return self._draft
