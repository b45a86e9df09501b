"""Standard uncertainties of a least-squares fit, honest when the model does not describe the data."""

from dataclasses import dataclass

import numpy as np

from ..models.arrays import Complexes, Reals
from .objective import Objective

_SINGULAR = 1e-12


@dataclass(frozen=True, eq=False)
class Estimate:
    """A minimum and its covariance."""

    x: Reals
    """Moving coordinates, shape (M,)."""
    covariance: Reals
    """Of the model parameters in the order of `Coordinates.parameters`, shape (P, P), SI."""
    chi2_per_dof: float
    rms_log_error: float
    """Root mean square of |ln(Z_model/Z_measured)|."""
    inflation: float
    """Factor on the noise variance that the covariance carries: 1 where the model describes the data."""
    converged: bool


def lag_one(r: Complexes) -> float:
    """Return the correlation of neighbouring residuals, Re and Im together."""
    norm = float(np.sum(np.abs(r) ** 2))
    return float(np.real(np.sum(r[1:] * np.conj(r[:-1])))) / norm if norm > 0 else 0.0


def variance_inflation(ratios: tuple[Complexes, ...], chi2_per_dof: float) -> float:
    """Return the factor on the noise variance that the residuals call for.

    Misfit above the noise is taken as noise that nobody knew of (Birge ratio), correlated as its neighbours are:
    n correlated points are worth n (1 - rho)/(1 + rho) independent ones.
    """
    n = sum(r.size for r in ratios)
    rho = float(np.average([lag_one(r) for r in ratios], weights=[r.size for r in ratios]))
    rho = min(max(0.0, rho - 2 / np.sqrt(n)), 0.999)
    return max(1.0, chi2_per_dof) * (1 + rho) / (1 - rho)


def estimate(objective: Objective, x: Reals, converged: bool) -> Estimate:
    """Return the covariance and the figures of merit at a minimum."""
    ratios = objective.log_ratios(x)
    data = 2 * objective.points
    r, J = objective.residual(x), objective.jacobian(x)
    dof = max(1, data - x.size)
    chi2_per_dof = float(np.sum(r[:data] ** 2)) / dof
    inflation = variance_inflation(ratios, chi2_per_dof)
    normal = J[:data].T @ J[:data] / inflation + J[data:].T @ J[data:]
    _, chain = objective.coordinates.forward(x)
    half = chain @ _inverse_root(normal)
    squares = np.concatenate([np.abs(ratio) ** 2 for ratio in ratios])
    return Estimate(
        x=x,
        covariance=half @ half.T,
        chi2_per_dof=chi2_per_dof,
        rms_log_error=float(np.sqrt(np.mean(squares))),
        inflation=inflation,
        converged=converged,
    )


def _inverse_root(normal: Reals) -> Reals:
    """Return H with H H^T = normal^-1; directions that nothing determines get a variance too large to miss."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    eigenvalues, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    floor = _SINGULAR * float(eigenvalues[-1]) if eigenvalues.size else 0.0
    return scale[:, None] * vectors / np.sqrt(np.maximum(eigenvalues, floor))
