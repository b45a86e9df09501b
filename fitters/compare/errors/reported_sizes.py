"""The sizes of changes as they are reported: averaged over the sizes of the errors, with what they imitate."""

from collections.abc import Sequence
from math import log

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ...error_model.point_covariance import Kernel
from .drift import DRIFTS
from .imitation import USUAL_DRIFT
from .linearised import Linearised, Outcome
from .pair_errors import PairErrors
from .pair_sizes import Sizes, log_density, posterior_of, scale_of

_NEGLIGIBLE = 1e-3
"""Probability of sizes of the errors below which they are left out of an average."""


def sized(
    errors: PairErrors, at: Linearised, outcome: Outcome, main: Sequence[tuple[int, float]]
) -> tuple[Reals, Reals]:
    """Return the coordinates including the part imitated by drift, and their covariance, shapes (P,) and (P, P).

    Averaged over the sizes of the errors, each varied by itself. `main`: of each change, the coordinate of its
    main size and how much it moves for a unit relative error in the middle of the band (0: the size is the one
    that fits the whole band best, with the part of the formula's error that it imitates).
    """
    X, where = errors.columns(at)
    kernel = Kernel([errors.points(at)], outcome.sizes.colour, (outcome.sizes.rest, 0.0))
    G = kernel.white([np.hstack([X, _of_set_up(errors, at)])]).squared()
    numbers = 2 * int(np.count_nonzero(np.isfinite(errors.pair.noise_after)))
    T = _reported(errors, at, where, main, G.shape[0] - 1)
    trials = [(one, _density(G, where, one, numbers)) for one in outcome.sizes.neighbours()]
    logs = np.array([value for _, value in trials])
    chances = np.exp(logs - np.logaddexp.reduce(logs))
    mean, square, drift = np.zeros(at.x.size), np.zeros((at.x.size, at.x.size)), _of_drift(errors, at)
    for chance, (sizes, _) in zip(chances, trials, strict=True):
        if chance < _NEGLIGIBLE:
            continue
        inverse, a = posterior_of(G / sizes.noise**2, scale_of(where, sizes, G.shape[0]))
        x = T @ a
        mean = mean + chance * x
        square = square + chance * (T @ inverse @ T.T + drift + np.outer(x, x))
    total = float(np.sum(chances[chances >= _NEGLIGIBLE]))
    mean = mean / total
    return mean, square / total - np.outer(mean, mean)


def _density(G: Reals, where: dict[str, slice], sizes: Sizes, numbers: int) -> float:
    """Return ln of the residual's density times prior, but for a constant."""
    scale = scale_of(where, sizes, G.shape[0])
    return log_density(G / sizes.noise**2, 2 * numbers * log(sizes.noise), scale) + sizes.log_prior


def _reported(
    errors: PairErrors, at: Linearised, where: dict[str, slice], main: Sequence[tuple[int, float]], count: int
) -> Reals:
    """Return the coordinates that are reported, by the coefficients of all columns, shape (P, M)."""
    T = np.zeros((at.x.size, count))
    own, formula = where["x"], where["shape"]
    T[:, own.start - 1 : own.stop - 1] = np.eye(at.x.size)
    drift = [k for name in DRIFTS for k in range(where[name].start - 1, where[name].stop - 1)]
    T[:, drift] = errors.shares(at)
    width = errors.shape.shape[1]
    middle = errors.shape[int(np.argmin(np.abs(errors.pair.log_f - np.mean(errors.pair.log_f[[0, -1]]))))]
    for k, (row, moves) in enumerate(main):
        if not moves:
            continue
        first = formula.start - 1 + 2 * width * k
        T[row, first : first + width] += moves * middle
    return T


def _of_drift(errors: PairErrors, at: Linearised) -> Reals:
    """Return the covariance of changes in the device by the usual drift, which they include, shape (P, P)."""
    share = errors.shares(at)
    return USUAL_DRIFT**2 * share @ share.T


def _of_set_up(errors: PairErrors, at: Linearised) -> Complexes:
    """Return the residual of another fixture where something was put in or taken out, shape (N, M).

    The terminals are opened for it, so that each recording has a residual of its own: this is the second one.
    """
    return errors.instrument.fixture(errors.pair.after)[:, : None if at.exact else 0]
