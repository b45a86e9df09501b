"""Standard uncertainties of a least-squares fit, valid also when the model does not describe the data."""

from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from .descent import Descent, chi2_per_point
from .objective import Objective
from .recording import Posterior, rms

_SINGULAR = 1e-12
_FLATTEST = 1e-6
# Slope of a load below which its coordinate has diverged: the load is known to be practically zero and nothing more.
_NOTHING = 1e-60
# Information on a coordinate that counts as none, small enough to give a conspicuously large uncertainty.


@dataclass(frozen=True, eq=False)
class Estimate:
    """A minimum and its covariance."""

    x: Reals
    """Free coordinates, shape (M,)."""
    covariance: Reals
    """Covariance of the model parameters in the order of `Coordinates.parameters`, shape (P, P), SI."""
    chi2_per_dof: float
    rms_log_error: float
    """Root mean square of |ln(Z_model/Z_measured)|."""
    converged: bool


@dataclass(frozen=True, eq=False)
class Curvature:
    """Curvature of an objective at its minimum, in the free coordinates."""

    rows: Reals
    """d residual / d x of all residuals, shape (R, M); rows of recordings are divided by the remaining misfit."""
    data: int
    """Number of rows of recordings; the others are priors."""
    spread: Reals
    """Standard deviation of each residual, shape (R,)."""
    half: Reals
    """Root of the covariance, shape (M, M): half half^T = (rows^T rows)^-1."""
    scale: float
    """Divisor of the rows of recordings."""

    @property
    def answer(self) -> Reals:
        """Response of x to each residual, times its standard deviation, shape (M, R)."""
        return self.half @ (self.half.T @ (self.rows * self.spread[:, None]).T)

    def covariance(self, chain: Reals) -> Reals:
        """Return the covariance of parameters with d parameter / d x = `chain`, shape (P, M).

        If the weights differ from the noise (the thesis's objective), this is the sandwich estimator of P. J. Huber
        (1967).
        """
        half = chain @ self.half
        uneven = np.flatnonzero(self.spread != 1)
        moved = half @ (self.half.T @ self.rows[uneven].T)
        return half @ half.T + (moved * (self.spread[uneven] ** 2 - 1)) @ moved.T


def remaining(objective: Objective, x: Reals) -> float:
    """Return the misfit per degree of freedom that the weights do not account for, at least 1 (Birge ratio squared)."""
    data = 2 * objective.points
    return max(1.0, float(np.sum(objective.residual(x)[:data] ** 2)) / max(1, data - x.size))


def curvature(objective: Objective, x: Reals) -> Curvature:
    """Return the curvature of the objective at its minimum `x`."""
    data, rows = 2 * objective.points, objective.jacobian(x).copy()
    scale = float(np.sqrt(remaining(objective, x)))
    rows[:data] /= scale
    spread = np.concatenate([objective.spread, np.ones(len(rows) - data)])
    return Curvature(rows, data, spread, _inverse_root(rows), scale)


def posterior(descent: Descent, layer: str = "") -> Posterior:
    """Return the posterior of a descent as a prior for a later step: its minimum and its full curvature.

    `layer`: of the coordinates of this layer alone, marginalised over all others; empty: of all coordinates.
    """
    objective, free = descent.objective, descent.objective.coordinates.free
    own = [k for k, name in enumerate(free) if not layer or name.startswith(f"{layer}.")]
    mean, slope = objective.straight(descent.x)
    rows = curvature(objective, descent.x).rows / np.maximum(slope, _FLATTEST)
    rest, rows = np.delete(rows, own, axis=1), rows[:, own]
    if rest.size:
        rows = rows - rest @ np.linalg.lstsq(rest, rows, rcond=_SINGULAR)[0]
    return Posterior(tuple(free[k] for k in own), mean[own], np.asarray(np.linalg.qr(rows, mode="r")))


def estimate(descent: Descent, judged: Objective | None = None) -> Estimate:
    """Return covariance and figures of merit at a minimum; `judged` is an objective over the recordings of all steps.

    `descent.settle` has already counted misfit above the noise as noise; the remainder widens the covariance (Birge
    ratio).
    """
    objective, x = descent.objective, descent.x
    _, chain = objective.coordinates.forward(x)
    judged = judged or objective
    ratios = judged.log_ratios(x)
    dof = max(1, 2 * judged.points - x.size)
    weighted = sum(
        2 * ratio.size * chi2_per_point(recording, ratio)
        for recording, ratio in zip(judged.recordings, ratios, strict=True)
    )
    return Estimate(
        x=x,
        covariance=curvature(objective, x).covariance(chain),
        chi2_per_dof=weighted / dof,
        rms_log_error=rms(*ratios),
        converged=descent.converged,
    )


def _inverse_root(rows: Reals) -> Reals:
    """Return H with H H^T = (rows^T rows)^-1; undetermined directions get a conspicuously large variance.

    Computed in two passes: the normal equations have half the digits, and the posterior of an earlier step needs them
    all.
    """
    half = _whitening(rows)
    return half @ _whitening(rows @ half)


def _whitening(rows: Reals) -> Reals:
    normal = rows.T @ rows
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), _NOTHING))
    eigenvalues, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    floor = _SINGULAR * float(eigenvalues[-1]) if eigenvalues.size else 0.0
    return scale[:, None] * vectors / np.sqrt(np.maximum(eigenvalues, floor))
