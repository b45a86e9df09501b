"""Repeatability: compare successive sweeps of one step on the same frequency grid, whatever their direction."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ....models.sweep import Sweep
from ...engine.noise import noise_from_smoothness
from .data_issues import DataIssue

_OVER = 15
_BEYOND = 8.0
"""Mean chi2 over `_OVER` points of the difference of two sweeps above which they are not repeatable."""


def differences(sweeps: Sequence[Sweep]) -> list[tuple[DataIssue, ...]]:
    """Return, for each sweep, where it differs from the sweep before it; the first has nothing to compare with."""
    found: list[tuple[DataIssue, ...]] = [()] if sweeps else []
    return [*found, *(_difference(before, after) for before, after in pairwise(sweeps))]


def _difference(before: Sweep, after: Sweep) -> tuple[DataIssue, ...]:
    common, i, j = np.intersect1d(before.frequency, after.frequency, return_indices=True)
    first, second = noise_from_smoothness(before), noise_from_smoothness(after)
    if first is None or second is None or common.size < before.frequency.size / 2:
        return ()
    excess = np.abs(np.log(after.impedance[j] / before.impedance[i])) ** 2 / (first[i] ** 2 + second[j] ** 2) / 2
    smooth = np.convolve(excess, np.ones(_OVER) / _OVER, mode="same")
    guilty = np.flatnonzero(smooth > _BEYOND)
    if not guilty.size:
        return ()
    band = float(common[guilty[0]]), float(common[guilty[-1]])
    return (DataIssue("not repeated", band, None, float(np.mean(excess))),)
