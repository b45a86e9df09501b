"""Size of an effect: the change of the recordings beyond what constants could do, and the change of the constants."""

from collections.abc import Mapping

import numpy as np

from ....models.base.arrays import Reals
from ...engine.parameters.assembly import layers_of
from ...error_model.uncertainty_sources import spread_of
from ...interface import Constant
from ...uncertainty.fit_result import fitted_constants
from ..hypotheses.changes import change_by, projected
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem


def powers_of(problem: Problem, one: Hypothesis) -> dict[Candidate, Reals]:
    """Return, by effect, |change of ln Z|^2 at each point beyond what constants could do, shape (N,)."""
    if not one.effects:
        return {}
    changes = projected(one, [change_by(problem, one, effect) for effect in one.effects])
    powers = (changes**2).reshape(2, -1, len(one.effects)).sum(axis=0)
    return dict(zip(one.effects, powers.T, strict=True))


def sizes_of(problem: Problem, one: Hypothesis) -> dict[Candidate, float]:
    """Return, by effect, the rms change of ln Z beyond what constants could do."""
    return {effect: float(np.sqrt(np.mean(power))) for effect, power in powers_of(problem, one).items()}


def largest_of(problem: Problem, one: Hypothesis, effect: Candidate) -> float:
    """Return the largest |change of ln Z| at any point beyond what constants could do."""
    change = projected(one, [change_by(problem, one, effect)])[:, 0]
    return float(np.max(np.abs(change)))


def covariance_of(one: Hypothesis) -> Reals:
    """Return the covariance of all model parameters."""
    _, chain = one.objective.coordinates.forward(one.fit.x)
    return np.asarray(chain @ spread_of(one.fit).whole @ chain.T, np.float64)


def constants_of(problem: Problem, one: Hypothesis) -> dict[str, Constant]:
    """Return the constants with standard uncertainties."""
    covariance = covariance_of(one)
    names = one.objective.coordinates.parameters
    layers = layers_of(problem.build, problem.steps)
    return fitted_constants(layers, one.values, names, covariance)


def moves_a_constant(before: Mapping[str, Constant], after: Mapping[str, Constant]) -> bool:
    """Return whether any constant changes by more than its standard uncertainty."""
    for name, own in after.items():
        other = before.get(name)
        if other is None or not own.free:
            continue
        if own.u_re and abs(own.re - other.re) > own.u_re:
            return True
        if own.u_im and abs(own.im - other.im) > own.u_im:
            return True
    return False
