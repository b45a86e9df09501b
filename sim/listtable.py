"""The list-sweep table: segments, and the one that is being edited.

A segment has at most 201 points and all together 801 (reference 2.3); the most segments there may be, and that they may
not overlap, is our assumption.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

from .axis import Segment, limits, moved_edges
from .messages import CommandError
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
"""Settings that a segment has for itself."""

SEGMENT_POINTS = 201
LIST_POINTS = 801
SEGMENTS = 18


def edge(mnemonic: str, start: float, stop: float) -> float:
    """Return what STAR, STOP, CENT or SPAN is of a range."""
    return {"STAR": start, "STOP": stop, "CENT": (start + stop) / 2, "SPAN": stop - start}[mnemonic]


@dataclass
class ListTable:
    """The table, and the editor at work on it."""

    segments: list[Segment] = field(default_factory=list[Segment])
    draft: Segment | None = None
    """The segment that is being edited."""
    editing: bool = False
    _draft_at: int = 0

    def begin(self, fresh: Segment, at: int | None = None) -> None:
        """Open the segment with this number (from 1) for editing, or a `fresh` one. Raises CommandError."""
        if not self.editing:
            raise CommandError(-221, "SETTINGS CONFLICT; EDITLIST FIRST")
        if at is None:
            if len(self.segments) >= SEGMENTS:
                raise CommandError(-223, "TOO MUCH DATA")
            self._draft_at, self.draft = len(self.segments), fresh
        elif 1 <= at <= len(self.segments):
            self._draft_at, self.draft = at - 1, self.segments[at - 1]
        else:
            raise CommandError(-222, "DATA OUT OF RANGE")

    def clear(self) -> None:
        """Drop every segment. Raises CommandError where the table is not being edited."""
        if not self.editing:
            raise CommandError(-221, "SETTINGS CONFLICT; EDITLIST FIRST")
        self.segments.clear()

    def edits(self, mnemonic: str) -> bool:
        """Return whether this setting is that of a segment now."""
        return self.draft is not None and mnemonic in FIELDS

    def set(self, mnemonic: str, argument: bytes, level: Number) -> None:
        """Set a value of the edited segment; `level` is what an oscillator level may be. Raises CommandError."""
        draft = self._edited()
        have = vars(draft).copy()
        if mnemonic in EDGES:
            kind = limits("STAR", "FREQ", "LIN")
            have["start"], have["stop"] = moved_edges(mnemonic, argument, draft.start, draft.stop, kind)
        elif mnemonic == "POIN":
            have["points"] = round(min(max(number(argument), 2), SEGMENT_POINTS))
        else:
            kind = level if mnemonic == "POWE" else TABLE[mnemonic]
            have[FIELDS[mnemonic]] = kind.parse(argument)
        self.draft = Segment(**have)

    def query(self, mnemonic: str, level: Number) -> str:
        """Return the reply to a query of the segment that is edited. Raises CommandError."""
        draft = self._edited()
        if mnemonic in EDGES:
            return limits("STAR", "FREQ", "LIN").answer(edge(mnemonic, draft.start, draft.stop))
        kind = level if mnemonic == "POWE" else TABLE[mnemonic]
        return kind.answer(vars(draft)[FIELDS[mnemonic]])

    def finish(self) -> None:
        """Put the edited segment into the table. Raises CommandError where the table would not be a sweep."""
        segments = self.segments.copy()
        segments[self._draft_at : self._draft_at + 1] = [self._edited()]
        self.draft = None
        if sum(s.points for s in segments) > LIST_POINTS:
            raise CommandError(-223, "TOO MUCH DATA")
        if any(b.start < a.stop for a, b in pairwise(segments)):
            raise CommandError(-221, "SETTINGS CONFLICT; SEGMENTS OVERLAP")
        self.segments = segments

    def _edited(self) -> Segment:
        if self.draft is None:
            raise CommandError(-221, "SETTINGS CONFLICT; NO SEGMENT IS BEING EDITED")
        return self.draft
