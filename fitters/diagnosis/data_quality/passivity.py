"""Passivity: a passive device absorbs power at every frequency, so Re Z is nowhere negative beyond noise."""

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.true_runs import true_runs
from ....models.sweep import Sweep

_OVER = 9
_BEYOND = 5.0
"""Significance in standard deviations of a mean of `_OVER` points."""


def active_bands(sweep: Sweep, noise: Reals) -> list[tuple[float, float]]:
    """Return the bands in Hz where Re Z is negative beyond `noise` (of Re and Im of ln Z, shape (N,)), lowest first."""
    kernel = np.ones(_OVER) / _OVER
    R = np.convolve(sweep.impedance.real, kernel, mode="valid")
    variance = np.convolve((noise * np.abs(sweep.impedance)) ** 2, kernel, mode="valid") / _OVER
    active = -_BEYOND * np.sqrt(variance) > R
    f = sweep.frequency
    return [(float(f[a]), float(f[min(b + _OVER - 2, f.size - 1)])) for a, b in true_runs(active)]
