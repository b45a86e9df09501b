"""Sampling: count the points within the width of the sharpest resonance."""

import numpy as np
from numpy.typing import NDArray

from ....models.base.arrays import Frequencies
from .pole_fit import PoleFit, linear_fit

_PAYS = 100.0
"""Smallest decrease of chi2 for which a pole is certainly a resonance."""
_INSIDE = 2
"""Points that a resonance must have on either side: a pole at the edge of the band may stand for poles beyond it."""


def points_per_linewidth(
    fit: PoleFit, frequency: Frequencies, disturbed: NDArray[np.bool_] | None = None
) -> tuple[float, float] | None:
    """Return the fewest points within f/Q of any resonance in the band, and its frequency (Hz); None without one.

    A pole at one of the `disturbed` points, shape (N,), is no resonance: it may stand for the edges of a glitch.
    """
    s = np.asarray(fit.frame.s.imag, np.float64)
    steps = 2 * fit.frame.least_width
    best: tuple[float, float] | None = None
    for k in np.flatnonzero((fit.poles.imag > s[_INSIDE - 1]) & (fit.poles.imag < s[-_INSIDE])):
        pole = complex(fit.poles[int(k)])
        points = float(-2 * pole.real / np.interp(pole.imag, s, steps))
        if best is not None and points >= best[0]:
            continue
        if disturbed is not None and disturbed[int(np.argmin(np.abs(s - pole.imag)))]:
            continue
        if linear_fit(fit.frame, np.delete(fit.poles, int(k))).cost - fit.cost > _PAYS * max(1.0, fit.chi2_per_dof):
            best = points, float(np.interp(pole.imag, s, frequency))
    return best
