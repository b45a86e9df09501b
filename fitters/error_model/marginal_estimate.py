"""Constants and uncertainties by source from the error model, starting at a least-squares minimum."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..engine.objective import Objective
from .error_sizes import ErrorSizes
from .marginal import Marginal
from .marginal_fit import MarginalFit, fit
from .uncertainty_sources import spread_of


@dataclass(frozen=True, eq=False)
class MarginalEstimate:
    """Result of a fit with errors of instrument, fixture and model."""

    values: Mapping[str, float]
    """Every model parameter."""
    x: Reals
    covariance: Reals
    """Covariance of the model parameters in the order of `Coordinates.parameters`, shape (P, P), SI."""
    by: Mapping[str, Reals]
    """Standard uncertainty of each parameter by source, shape (P,)."""
    sizes: ErrorSizes
    """Estimated sizes of the errors."""
    found: MarginalFit


def marginal_estimate(objective: Objective, x: Reals) -> MarginalEstimate:
    """Fit with the error model, starting at a minimum `x` of least squares."""
    found = fit(Marginal.of(objective), x, rounds=2, compared=False)
    values, chain = objective.coordinates.forward(found.x)
    spread = spread_of(found)
    covariance = chain @ spread.whole @ chain.T
    return MarginalEstimate(values, found.x, np.asarray(covariance), spread.of(chain), found.sizes, found)
