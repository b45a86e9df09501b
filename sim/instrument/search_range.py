"""Partial ranges of a sweep: for marker search (PM p.98) and for waveform analysis (PM p.106)."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .instrument import Instrument

Indices: TypeAlias = NDArray[np.intp]


@dataclass
class SearchBorders:
    """The limits of one trace's search or of waveform analysis; None (not set) means the whole sweep."""

    search: dict[str, float | None] = field(default_factory=lambda: {"SEARMIN": None, "SEARMAX": None})
    """Hz, V or A."""
    analysis: tuple[float, float] | None = None
    segment: int = 1
    """SEGMNUM."""
    analysis_segment: int | None = None
    """ANASEGM; None where the range is not a segment."""


def searched(instrument: "Instrument", trace: str) -> Indices:
    """Return the points that a search of this trace covers: all, those within its limits, or a segment's."""
    borders, state = instrument.borders[trace], instrument.state
    if state["SWPT"] == "LIST" and state.of_trace("SEARNG", trace) == "SEGMENT":
        return _segment(instrument, borders.segment)
    if not state.of_trace("PARS", trace):
        return np.arange(instrument.sweeper.axis.values.size, dtype=np.intp)
    return _between(instrument, borders.search["SEARMIN"], borders.search["SEARMAX"])


def analysed(instrument: "Instrument") -> Indices:
    """Return the points that waveform analysis of the active trace covers."""
    borders = instrument.borders["A"]
    if instrument.state["SWPT"] == "LIST" and borders.analysis_segment is not None:
        return _segment(instrument, borders.analysis_segment)
    return _between(instrument, *(borders.analysis or (None, None)))


def _between(instrument: "Instrument", low: float | None, high: float | None) -> Indices:
    """Return the points between two limits; None means no limit."""
    values = instrument.sweeper.axis.values
    inside = (values >= (-np.inf if low is None else low)) & (values <= (np.inf if high is None else high))
    if not inside.any():  # both limits lie between two points: the nearest point
        return np.array([int(np.argmin(np.abs(values - (low if low is not None else high or 0.0))))], dtype=np.intp)
    return np.flatnonzero(inside)


def _segment(instrument: "Instrument", number: int) -> Indices:
    counts = [s.points for s in instrument.state.table.segments]
    first = sum(counts[: number - 1])
    return np.arange(first, first + counts[number - 1], dtype=np.intp)
