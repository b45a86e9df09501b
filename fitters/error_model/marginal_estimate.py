"""The fit at the bench with the error model: constants, and uncertainties by source, from a least-squares minimum."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..engine.objective import Objective
from .error_sizes import ErrorSizes
from .marginal_fit import Marginal, MarginalFit, fit
from .uncertainty_sources import spread_of


@dataclass(frozen=True, eq=False)
class MarginalEstimate:
    """A fit's answer with errors of instrument, fixture and model in it."""

    values: Mapping[str, float]
    """Every model parameter."""
    x: Reals
    covariance: Reals
    """Of the model parameters in the order of `Coordinates.parameters`, shape (P, P), SI."""
    by: Mapping[str, Reals]
    """Standard uncertainty of each by source, shape (P,)."""
    sizes: ErrorSizes
    """How large the errors were found to be."""
    found: MarginalFit


def marginal_estimate(objective: Objective, x: Reals) -> MarginalEstimate:
    """Return the answer of the error model, begun at a minimum `x` of least squares."""
    found = fit(Marginal.of(objective), x, rounds=2)
    values, chain = objective.coordinates.forward(found.x)
    spread = spread_of(found)
    covariance = chain @ spread.whole @ chain.T
    return MarginalEstimate(values, found.x, np.asarray(covariance), spread.of(chain), found.sizes, found)
