"""Frequencies of a 4294A's points, and the division of a segment of more than 801 points into several sweeps."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ....models.base.arrays import Frequencies
from ....models.sweep_plan import Segment
from ..capabilities import MOST_POINTS

OVERLAP_POINTS = 16
"""Points that two neighbouring sweeps of one segment share: 32 real numbers to estimate noise and drift from."""


@dataclass(frozen=True)
class GridPart:
    """One sweep of a segment: its points `first` to `last`, both included, counted from 0."""

    segment: Segment
    first: int
    last: int


def points(segment: Segment) -> Frequencies:
    """Return the frequencies of `segment` in Hz, shape (points,), rising, on the instrument's grid of 1 mHz.

    Linear or geometric steps, rounded to 1 mHz, ends exact, as in the export files of three instruments.
    """
    i = np.arange(segment.points) / (segment.points - 1)
    start, stop = round(segment.start_Hz, 3), round(segment.stop_Hz, 3)  # the ends as they are set
    exact = start * (stop / start) ** i if segment.spacing == "log" else start + (stop - start) * i
    return np.round(exact, 3)


def parts(segment: Segment) -> tuple[GridPart, ...]:
    """Return the sweeps, each of at most 801 points, that together cover `segment`; neighbours overlap.

    Their lengths are as equal as possible.
    """
    if segment.points <= MOST_POINTS:
        return (GridPart(segment, 0, segment.points - 1),)
    fresh = MOST_POINTS - OVERLAP_POINTS
    count = -(-(segment.points - OVERLAP_POINTS) // fresh)
    edges = np.linspace(0, segment.points - OVERLAP_POINTS, count + 1).round().astype(int)
    return tuple(GridPart(segment, int(a), int(b) + OVERLAP_POINTS - 1) for a, b in pairwise(edges))


def of_part(part: GridPart) -> Segment:
    """Return the segment that the instrument is to sweep for `part`.

    Its grid equals that of the whole except for the rounding of its own ends: 1 mHz or, in a log sweep, 1 mHz relative
    to its start.
    """
    grid = points(part.segment)
    start, stop = float(grid[part.first]), float(grid[part.last])
    return Segment(start, stop, part.last - part.first + 1, part.segment.spacing)
