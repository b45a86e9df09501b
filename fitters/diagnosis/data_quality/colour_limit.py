"""The largest correlation that the noise of neighbouring points can have: noise is part of what a pole fit leaves.

Poles describe any causal linear device, so what they leave is noise and whatever they miss, and never less than the
noise. Beside a model, coloured noise looks like a model error: where the size of the noise is known from differences of
neighbouring points, more colour means more noise, and it could stand for a misfit of any cause. How much a pole fit
takes away of coloured noise is computed from its own columns.
"""

import numpy as np
from scipy.linalg import solveh_banded

from ....models.base.arrays import Reals
from ...error_model.point_covariance import spread_of_variance, under_colour
from ...error_model.prior_scales import COLOURS
from .pole_fit import PoleFit

_SURE = 2.33
"""Standard deviations by which the pole fit has to leave less than the noise would be: one right colour of a hundred is
excluded."""


def colour_limit(fit: PoleFit) -> float:
    """Return the largest of the grid's correlations of neighbouring points' noise that a recording allows.

    `fit`: that of the recording, whose weights are the noise of Re and Im of ln Z if it were white.
    """
    columns = _columns(fit)
    return next((one for one in COLOURS[:0:-1] if fit.cost > _left(columns, fit.frame.points, one)), 0.0)


def _left(columns: Reals, points: int, colour: float) -> float:
    """Return chi2, in units of the noise if it were white, below which noise of this colour hardly ever comes.

    The noise of single points was estimated from differences, which underestimate it.
    """
    taken = sum(_squared(part, colour) for part in np.split(columns, 2))
    of_noise = (1 + colour**2) / (1 - colour**2) / points  # relative variance of its mean square
    spread = np.hypot(np.sqrt(of_noise), spread_of_variance(points))
    return float((2 * points - taken) / under_colour(colour) ** 2 * max(0.0, 1 - _SURE * spread))


def _squared(Q: Reals, colour: float) -> float:
    """Return the trace of Q^T R Q, R_ij = colour^|i-j|, which is the inverse of a tridiagonal matrix."""
    inverse = np.full((2, len(Q)), -colour)
    inverse[1] = 1 + colour**2
    inverse[1, [0, -1]] = 1.0
    return float(np.sum(Q * solveh_banded(inverse / (1 - colour**2), Q)))


def _columns(fit: PoleFit) -> Reals:
    """Return orthonormal columns of all that a pole fit can take away, places and widths of poles included."""
    moved = fit.tangent()
    length = np.linalg.norm(moved, axis=0)
    Q, _ = np.linalg.qr(np.hstack([fit.basis, moved[:, length > 0] / length[length > 0]]))
    return np.asarray(Q, np.float64)
