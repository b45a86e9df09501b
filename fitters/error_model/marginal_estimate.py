"""Constants and uncertainties by source from the error model, starting at a least-squares minimum."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..engine.held_constants import held_constants
from ..engine.objective import Objective
from .at_resonance import at_resonance
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
    of_x: Reals
    """Covariance of the free coordinates, shape (M, M)."""
    covariance: Reals
    """Covariance of the model parameters in the order of `Coordinates.parameters`, shape (P, P), SI; held ones are
    exact."""
    with_held: Reals
    """The same, held ones off by as much of their tolerances as the recordings make probable: what is measured directly
    does not depend on them."""
    by: Mapping[str, Reals]
    """Standard uncertainty of each parameter by source, shape (P,)."""
    sizes: ErrorSizes
    """Estimated sizes of the errors."""
    found: MarginalFit


def marginal_estimate(objective: Objective, x: Reals) -> MarginalEstimate:
    """Fit with the error model, starting at a minimum `x` of least squares."""
    found = fit(Marginal.of(objective), x, rounds=2, compared=False)
    told = at_resonance(found)
    spread = spread_of(told)
    x = told.x + spread.mean
    values, chain = objective.coordinates.forward(x)
    of_x = spread.whole
    covariance = np.asarray(chain @ of_x @ chain.T)
    _, tolerances = held_constants(objective.coordinates, values)
    moved = np.zeros((len(chain), len(spread.held)))
    for k, name in enumerate(spread.held):
        if name in objective.coordinates.parameters:
            moved[objective.coordinates.parameters.index(name), k] = tolerances[name]
    across = chain @ spread.beside @ moved.T
    with_held = covariance + across + across.T + moved @ spread.of_held @ moved.T
    return MarginalEstimate(values, x, of_x, covariance, with_held, spread.of(chain), found.sizes, found)
