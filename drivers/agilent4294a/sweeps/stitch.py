"""Joins several sweeps of one segment, and estimates noise and drift from their overlaps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Frequencies, Impedances
from .grid import OVERLAP_POINTS


@dataclass(frozen=True, eq=False)
class Stitched:
    """One segment joined from its sweeps."""

    frequency: Frequencies
    """Hz, shape (N,)."""
    impedance: Impedances
    """ohm, shape (N,); in the overlaps the mean of both sweeps."""
    noise: float | None
    """Standard deviation of Re and Im of a single point, relative to |Z|; None where there was no overlap."""
    drift: tuple[complex, ...]
    """Mean of ln(later sweep / earlier sweep) for each overlap: the real part is the change of |Z|."""


def stitch(sweeps: Sequence[tuple[Frequencies, Impedances]]) -> Stitched:
    """Join `sweeps`, which are in rising order and overlap by `OVERLAP_POINTS`.

    The difference of two sweeps over their overlap has twice a point's variance; its mean is taken as drift, the
    scatter around the mean as noise.
    """
    frequency, impedance = sweeps[0]
    drift: list[complex] = []
    scatter: list[float] = []
    for later_frequency, later_impedance in sweeps[1:]:
        m = OVERLAP_POINTS
        change = np.log(later_impedance[:m] / impedance[-m:])
        drift.append(complex(np.mean(change)))
        scatter.append(float(np.sum(np.abs(change - drift[-1]) ** 2) / (2 * (m - 1))))
        shared = (later_impedance[:m] + impedance[-m:]) / 2
        impedance = np.concatenate([impedance[:-m], shared, later_impedance[m:]])
        frequency = np.concatenate([frequency, later_frequency[m:]])
    noise = float(np.sqrt(np.mean(scatter) / 2)) if scatter else None
    return Stitched(frequency, impedance, noise, tuple(drift))
