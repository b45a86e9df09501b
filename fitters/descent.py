"""Going downhill, and what to do where the model does not describe a recording to its noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from ..models.arrays import Complexes, Reals
from .coordinates import Coordinates
from .objective import Objective, Posterior, Prior, Recording

_MAX_EVALUATIONS = 200
ROUGH, _FINE = 1e-4, 1e-10
# Relative tolerances: enough to see where a descent leads, and enough for the minimum that is reported.
_ROUNDS = 8
_DESCRIBED = 1.3
# chi2 per degree of freedom up to which a recording counts as described: the noise estimate is good to a few per
# cent, and 1600 residuals scatter by 3.5 %.
_SETTLED = 0.1


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a local descent began and ended."""

    objective: Objective
    start: Reals
    x: Reals
    cost: float
    converged: bool
    evaluations: int


def descend(objective: Objective, x: Reals, tolerance: float = _FINE, most: int = _MAX_EVALUATIONS) -> Descent:
    """Go downhill from `x` by Levenberg-Marquardt with the exact Jacobian.

    J. J. More, The Levenberg-Marquardt algorithm: implementation and theory (1977), as MINPACK's `lmder`; on 1600 x 12
    its own QR is faster than a trust region by singular values, and needs no threads.
    """
    before = objective.evaluations
    if x.size == 0:
        cost = float(np.sum(objective.residual(x) ** 2)) / 2
        return Descent(objective, x, x, cost, converged=True, evaluations=1)
    # From zero, so that tolerances refer to the way travelled and not to logarithms of stiffnesses.
    found = least_squares(
        lambda way: objective.residual(x + way),
        np.zeros_like(x),
        jac=lambda way: objective.jacobian(x + way),
        method="lm",
        x_scale="jac",
        xtol=tolerance,
        ftol=tolerance,
        gtol=tolerance,
        max_nfev=most,
    )
    tried = objective.evaluations - before
    return Descent(objective, x, x + np.asarray(found.x), float(found.cost), bool(found.status > 0), tried)


def chi2_per_point(recording: Recording, ratio: Complexes) -> float:
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise alone."""
    return float(np.mean(np.abs(ratio / recording.noise) ** 2)) / 2


def softened(recording: Recording, ratio: Complexes) -> Recording:
    """Return the recording with the misfit that its residuals `ratio` call for taken as further noise.

    Where the model describes the recording, that is none. Elsewhere a model that is wrong must not be fitted as if
    it were right to the last digit: it would drag well-known dimensions and earlier steps' constants away with it.
    Correlated residuals count for what they are worth, (1 - rho)/(1 + rho) of the points.
    """
    if chi2_per_point(recording, ratio) < _DESCRIBED:
        return replace(recording, misfit=0.0, correlation=1.0)
    excess = float(np.mean(np.abs(ratio) ** 2)) / 2 - float(np.mean(recording.noise**2))
    rho = min(max(0.0, lag_one(ratio) - 2 / np.sqrt(ratio.size)), 0.999)
    return replace(recording, misfit=float(np.sqrt(max(excess, 0.0))), correlation=(1 + rho) / (1 - rho))


def lag_one(ratio: Complexes) -> float:
    """Return the correlation of neighbouring residuals, Re and Im together."""
    norm = float(np.sum(np.abs(ratio) ** 2))
    return float(np.real(np.sum(ratio[1:] * np.conj(ratio[:-1])))) / norm if norm > 0 else 0.0


def _settled(before: Sequence[Recording], after: Sequence[Recording]) -> bool:
    return all(
        abs(old.misfit - new.misfit) <= _SETTLED * max(old.misfit, new.misfit)
        for old, new in zip(before, after, strict=True)
    )


def settle(
    recordings: Sequence[Recording], coordinates: Coordinates, priors: Sequence[Prior | Posterior], x: Reals
) -> Descent:
    """Go downhill from `x`, each recording softened by its own misfit, until the misfits no longer change.

    Begins with the misfits the recordings come with; a large one makes the first descent a cautious one.
    """
    evaluations = 0
    start, now = x, tuple(recordings)
    for _ in range(_ROUNDS):
        rough = descend(Objective(now, coordinates, priors), x, ROUGH)
        evaluations, x, before = evaluations + rough.evaluations, rough.x, now
        now = tuple(map(softened, before, rough.objective.log_ratios(x)))
        if _settled(before, now):
            break
    last = descend(Objective(now, coordinates, priors), x)
    return replace(last, start=start, evaluations=evaluations + last.evaluations)
