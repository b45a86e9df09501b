"""Contiguous frequency bands of a misfit."""

from collections.abc import Sequence

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Reals
from ....models.base.true_runs import true_runs

_SMOOTH = 15
_GUILTY = 4.0
_OF_WORST = 0.01
"""A stretch belongs to a band if its mean squared residual over `_SMOOTH` points exceeds four times the noise and a
hundredth of the worst; a large misfit extends far, and the user needs its centre."""


def guilty_bands(frequency: Frequencies, excess: Reals) -> tuple[tuple[float, float], ...]:
    """Return the bands where `excess` (1 on average without misfit) stands out: worst first, five at most."""
    kernel = np.ones(_SMOOTH) / _SMOOTH
    smooth = np.convolve(excess, kernel, mode="same")
    guilty = smooth > max(_GUILTY, _OF_WORST * float(np.max(smooth, initial=0.0)))
    merged: list[tuple[int, int]] = []
    for a, b in true_runs(guilty):
        if merged and a - merged[-1][1] < _SMOOTH:
            merged[-1] = (merged[-1][0], b)
        else:
            merged.append((a, b))
    merged.sort(key=lambda band: -float(np.sum(excess[band[0] : band[1]])))
    last = frequency.size - 1
    return tuple((float(frequency[a]), float(frequency[min(b, last)])) for a, b in merged[:5])


def excess_of(before: Sequence[Complexes], after: Sequence[Complexes]) -> tuple[Reals, ...]:
    """Return the decrease of the squared residuals at each point, in units of noise, by recording."""
    return tuple((np.abs(b) ** 2 - np.abs(a) ** 2) / 2 for b, a in zip(before, after, strict=True))
