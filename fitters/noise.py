"""Relative noise of a recording, from the recording itself."""

from collections.abc import Sequence
from itertools import pairwise
from math import comb, sqrt

import numpy as np

from ..models.arrays import Complexes
from ..models.sweep import Sweep
from .interface import Noise

_ORDER = 5
# Differences of this order remove all that is smooth over six points; higher orders gain nothing (measured on
# 801-point sweeps of disks: orders 4, 5 and 6 agree within 3 %, order 3 still sees the resonances).
_MAD_TO_SIGMA = 1.4826
_FLOOR = 1e-7
# 4294A data carry seven digits: no recording is better than this.


def _spread(differences: Complexes) -> float:
    """Return the robust standard deviation of real and imaginary parts together."""
    parts = np.concatenate([differences.real, differences.imag])
    return float(_MAD_TO_SIGMA * np.median(np.abs(parts)))


def noise_from_smoothness(sweep: Sweep) -> float | None:
    """Return the standard deviation of Re and Im of ln Z per point, from fifth differences.

    The median makes it blind to the resonances, where even fifth differences hold signal, as long as they fill less
    than half of the points. None for fewer than 20 points.
    """
    if sweep.frequency.size < 20:
        return None
    differences = np.diff(np.log(sweep.impedance), _ORDER)
    return _spread(differences) / sqrt(comb(2 * _ORDER, _ORDER))


def noise_from_repeats(sweeps: Sequence[Sweep]) -> float | None:
    """Return the same from repeats: sweeps on one and the same grid. None where there are none.

    Only what differs from point to point counts: a slow drift between repeats is a mismatch, not noise.
    """
    values: list[float] = []
    for first, second in pairwise(sweeps):
        if first.frequency.shape == second.frequency.shape and np.allclose(
            first.frequency, second.frequency, rtol=1e-9
        ):
            ratio = np.log(second.impedance / first.impedance)
            values.append(_spread(np.diff(ratio)) / 2.0)
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def relative_noise(sweeps: Sequence[Sweep]) -> Noise:
    """Return the noise of one step's sweeps: from repeats where there are some, else from smoothness.

    Falls back to 1e-3, which is the analyzer's accuracy at 1 MHz, for recordings too short to tell.
    """
    repeats = noise_from_repeats(sweeps)
    if repeats is not None:
        return Noise(max(repeats, _FLOOR), "repeats")
    smooth = [value for value in map(noise_from_smoothness, sweeps) if value is not None]
    if smooth:
        return Noise(max(float(np.median(smooth)), _FLOOR), "smoothness")
    return Noise(1e-3, "analyzer accuracy")
