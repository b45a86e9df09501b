"""Local descent, and the treatment of recordings that the model does not describe to their noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import leastsq

from ...models.base.arrays import Complexes, Reals
from .objective import Objective
from .parameters.coordinates import Coordinates
from .recording import Posterior, Prior, Recording, along_curve

_MAX_EVALUATIONS = 200
ROUGH, _FINE, _FINEST = 1e-4, 1e-10, 1e-13
# Relative tolerances: of an exploratory descent; of the reported minimum; and of a minimum where a coordinate has
# diverged (such as a load that vanishes), which shortens the steps of all others.
_SURE = 1e-2
# Part of a tolerance below which a predicted decrease stops the descent without a further step.
_FAR, _KEPT = 100.0, 0.75
# Longest step, in standard uncertainties, and part of the predicted decrease that it must achieve: MINPACK's first
# trust radius, and the ratio from which it enlarges it.
_RUN_OFF = 1e3
_TOO_MANY = 5
# MINPACK's status at the evaluation limit; 1 to 4 mean convergence, 6 to 8 convergence to rounding.
_ROUNDS = 8
_DESCRIBED = 1.3
# chi2 per degree of freedom up to which a recording counts as described: the noise estimate has a few per cent of
# uncertainty, and 1600 residuals scatter by 3.5 %.
_SETTLED = 0.1


@dataclass(frozen=True, eq=False)
class Descent:
    """Start and end of a local descent."""

    objective: Objective
    start: Reals
    x: Reals
    cost: float
    converged: bool
    evaluations: int


def descend(objective: Objective, x: Reals, tolerance: float = _FINE, most: int = _MAX_EVALUATIONS) -> Descent:
    """Minimise from `x`: by Gauss-Newton while steps achieve the predicted decrease, else by Levenberg-Marquardt.

    J. J. More, The Levenberg-Marquardt algorithm: implementation and theory (1977), in MINPACK's `lmder`. `leastsq`
    calls it directly; the overhead of `least_squares` costs as much as a small recording.
    """
    before = objective.evaluations
    if x.size == 0:
        cost = float(np.sum(objective.residual(x) ** 2)) / 2
        return Descent(objective, x, x, cost, converged=True, evaluations=1)
    near, cost, converged = _straight_down(objective, x, tolerance, most)
    if converged:
        return Descent(objective, x, near, cost, converged, objective.evaluations - before)
    # Relative to `near`, so that tolerances refer to the shift and not to logarithms of stiffnesses.
    with np.errstate(over="ignore", invalid="ignore"):  # of the covariance, which leastsq computes but nobody needs
        shift, _, info, _, ended = leastsq(
            lambda shift: objective.residual(near + shift),
            np.zeros_like(x),
            Dfun=lambda shift: objective.jacobian(near + shift).T,
            full_output=True,
            col_deriv=True,
            xtol=tolerance,
            ftol=tolerance,
            gtol=tolerance,
            maxfev=most,
        )
    cost = float(np.sum(np.asarray(info["fvec"]) ** 2)) / 2
    tried = objective.evaluations - before
    return Descent(objective, x, near + np.asarray(shift), cost, ended not in (0, _TOO_MANY), tried)


def _straight_down(objective: Objective, x: Reals, tolerance: float, most: int) -> tuple[Reals, float, bool]:
    """Take Gauss-Newton steps; return the last point, its cost, and whether it is the minimum.

    These are the steps that MINPACK would take first, at a third of the time: normal equations instead of QR, and no
    evaluation for a step that would gain nothing. Badly conditioned or strongly curved problems are left to MINPACK.
    """
    r = objective.residual(x)
    cost = float(r @ r) / 2
    for _ in range(most):
        slopes = objective.jacobian(x).T
        normal, gradient = slopes @ slopes.T, slopes @ r
        size = np.sqrt(np.diag(normal))
        if not np.all(size > 0):
            break
        try:
            step = -cho_solve(cho_factor(normal / size / size[:, None]), gradient / size)
        except np.linalg.LinAlgError:
            break
        fall = -float(gradient / size @ step) / 2
        if fall <= _SURE * tolerance * cost:
            return x, cost, True
        if float(np.linalg.norm(step)) > _FAR:
            break
        before, there = cost, x + step / size
        r = objective.residual(there)
        cost = float(r @ r) / 2
        if cost < before:
            x = there
        if before - cost < _KEPT * fall:
            break
    return x, cost, False


def chi2_per_point(recording: Recording, ratio: Complexes) -> float:
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise alone."""
    return float(np.mean(np.abs(ratio / recording.noise) ** 2)) / 2


def with_model_discrepancy(recording: Recording, ratio: Complexes) -> Recording:
    """Return the recording with the excess of its residuals `ratio` over noise counted as further noise.

    The excess is zero where the model describes the recording. Elsewhere a wrong model must not be fitted as if it were
    exact: it would pull well-known dimensions and earlier steps' constants away. Correlated residuals are weighted by
    the effective number of points, (1 - rho)/(1 + rho) of them.
    """
    if chi2_per_point(recording, ratio) < _DESCRIBED:
        return replace(recording, misfit=0.0, correlation=1.0)
    excess = float(np.mean(np.abs(ratio) ** 2)) / 2 - float(np.mean(recording.noise**2))
    rho = min(max(0.0, lag_one(ratio) - 2 / np.sqrt(ratio.size)), 0.999)
    return replace(recording, misfit=float(np.sqrt(max(excess, 0.0))), correlation=(1 + rho) / (1 - rho))


def thinned(recording: Recording) -> Recording:
    """Return the recording reduced to a hundred points at most, densest at resonances."""
    sweep = recording.sweep
    at = along_curve(sweep.impedance)
    return replace(recording, sweep=sweep.at(at), noise=recording.noise[at])


def lag_one(ratio: Complexes) -> float:
    """Return the correlation of neighbouring residuals, of Re and Im together."""
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
    """Minimise from `x`, reweighting each recording by its own misfit until the misfits no longer change.

    The initial misfits are those of the recordings; a large one makes the first descent cautious.
    """
    last = approach(recordings, coordinates, priors, x)
    evaluations = last.evaluations
    for _ in range(_ROUNDS):
        last = descend(last.objective, last.x, _FINE if np.all(np.abs(last.x) < _RUN_OFF) else _FINEST)
        evaluations += last.evaluations
        after = _judged(last)
        if _settled(last.objective.recordings, after):
            break
        last = approach(after, coordinates, priors, last.x)
        evaluations += last.evaluations
    return replace(last, start=x, evaluations=evaluations)


def approach(
    recordings: Sequence[Recording], coordinates: Coordinates, priors: Sequence[Prior | Posterior], x: Reals
) -> Descent:
    """Do the same with rough descents only; the objective has the misfits after the last of them."""
    rough = descend(Objective(recordings, coordinates, priors), x, ROUGH)
    evaluations = rough.evaluations
    for _ in range(_ROUNDS):
        before, after = rough.objective.recordings, _judged(rough)
        if all(_weight(old) == _weight(new) for old, new in zip(before, after, strict=True)):
            break
        objective = Objective(after, coordinates, priors)
        if _settled(before, after):
            rough = replace(rough, objective=objective)
            break
        rough = descend(objective, rough.x, ROUGH)
        evaluations += rough.evaluations
    return replace(rough, start=x, evaluations=evaluations)


def _judged(descent: Descent) -> tuple[Recording, ...]:
    objective = descent.objective
    return tuple(map(with_model_discrepancy, objective.recordings, objective.log_ratios(descent.x)))


def _weight(recording: Recording) -> tuple[float, float]:
    return recording.misfit, recording.correlation
