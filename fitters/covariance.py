"""Standard uncertainties of a least-squares fit, honest when the model does not describe the data."""

from dataclasses import dataclass

import numpy as np

from ..models.arrays import Reals
from .descent import Descent, chi2_per_point

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
    converged: bool


def estimate(descent: Descent) -> Estimate:
    """Return the covariance and the figures of merit at a minimum.

    Misfit above the noise has been taken as noise by `descent.settle`; the little that remains widens the covariance
    too (Birge ratio).
    """
    objective, x = descent.objective, descent.x
    ratios = objective.log_ratios(x)
    data, dof = 2 * objective.points, max(1, 2 * objective.points - x.size)
    r, J = objective.residual(x), objective.jacobian(x)
    remaining = max(1.0, float(np.sum(r[:data] ** 2)) / dof)
    normal = J[:data].T @ J[:data] / remaining + J[data:].T @ J[data:]
    _, chain = objective.coordinates.forward(x)
    half = chain @ _inverse_root(normal)
    weighted = sum(
        2 * ratio.size * chi2_per_point(recording, ratio)
        for recording, ratio in zip(objective.recordings, ratios, strict=True)
    )
    return Estimate(
        x=x,
        covariance=half @ half.T,
        chi2_per_dof=weighted / dof,
        rms_log_error=float(np.sqrt(np.mean(np.concatenate([np.abs(ratio) ** 2 for ratio in ratios])))),
        converged=descent.converged,
    )


def _inverse_root(normal: Reals) -> Reals:
    """Return H with H H^T = normal^-1; directions that nothing determines get a variance too large to miss."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    eigenvalues, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    floor = _SINGULAR * float(eigenvalues[-1]) if eigenvalues.size else 0.0
    return scale[:, None] * vectors / np.sqrt(np.maximum(eigenvalues, floor))
