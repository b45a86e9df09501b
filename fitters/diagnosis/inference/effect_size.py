"""Size of an effect: the change of the recordings beyond what constants could do, and the change of the constants."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ...engine.recording import rms
from ...error_model.instrument_share import accuracy_of
from ...error_model.marginal_fit import plain
from ...error_model.uncertainty_sources import spread_of
from ...interface import Constant
from ..findings import Size
from ..hypotheses.changes import change_by
from ..hypotheses.hypothesis import Hypothesis, marginal_of
from ..hypotheses.problem import Candidate, Problem
from ..hypotheses.size_priors import shown


def powers_of(problem: Problem, one: Hypothesis) -> dict[Candidate, Reals]:
    """Return, by effect, |change of ln Z|^2 at each point beyond what constants could do, shape (N,)."""
    if not one.effects:
        return {}
    changes = one.projected([change_by(problem, one, effect) for effect in one.effects])
    powers = (changes**2).reshape(2, -1, len(one.effects)).sum(axis=0)
    return dict(zip(one.effects, powers.T, strict=True))


def moved(problem: Problem, one: Hypothesis, effect: Candidate, without: Hypothesis) -> float:
    """Return the smallest rms of ln Z that constants and other effects leave of an effect: what it moves.

    They are fitted by least squares to the recordings as the hypothesis describes them, from where they are and from
    where a fit `without` the effect has ended. Errors of instrument and model take no part: that they could do the same
    makes an effect less certain, not smaller.
    """
    described = one.objective.curves(one.fit.x)
    pairs = zip(problem.recordings, described, strict=True)
    recordings = tuple(replace(own, sweep=replace(own.sweep, impedance=Z)) for own, Z in pairs)
    shown, rest = replace(problem, recordings=recordings), [other for other in one.effects if other is not effect]
    left: list[float] = []
    for start in (one.values, without.values):
        marginal = marginal_of(shown, rest, start)
        x = plain(marginal, [marginal.objective.coordinates.x])
        left.append(rms(*marginal.objective.log_ratios(x)))
    return min(left)


def largest_of(problem: Problem, one: Hypothesis, effect: Candidate) -> float:
    """Return the largest |change of ln Z| at any point beyond what constants could do, in units of the accuracy."""
    change = one.projected([change_by(problem, one, effect)])[:, 0]
    accuracy = np.concatenate([accuracy_of(recording.sweep) for recording in problem.recordings])
    return float(np.max(np.abs(change) / np.tile(accuracy, 2)))


def covariance_of(one: Hypothesis, coarseness: float = 1.0) -> Reals:
    """Return the covariance of all model parameters, constants of ceramics at the resonance.

    `coarseness` is the factor by which ln likelihood counts less (see `hypothesis.probabilities`), and by which the
    covariance is therefore larger; what follows from priors, such as the dimensions of a build, stays as it is.
    """
    return sum(covariances_of(one, coarseness).values(), np.zeros(()))


def covariances_of(one: Hypothesis, coarseness: float = 1.0) -> dict[str, Reals]:
    """Return its parts by source: noise, instrument, model, and dimensions with what else a build states."""
    _, chain = one.objective.coordinates.forward(one.told.x)
    spread, moved = spread_of(one.resonant), one.told.x - one.resonant.x
    of = {
        name: part * (1.0 if name in ("dimensions", "assumptions") else coarseness) for name, part in spread.by.items()
    }
    of["instrument"] = of["instrument"] + np.outer(spread.mean, spread.mean)  # of unknown sizes of smooth errors
    of["dimensions"] = of["dimensions"] + of.pop("assumptions") + np.outer(moved, moved)
    return {name: np.asarray(chain @ part @ chain.T, np.float64) for name, part in of.items()}


def constants_of(problem: Problem, one: Hypothesis, coarseness: float = 1.0) -> dict[str, Constant]:
    """Return the constants with standard uncertainties; for `coarseness` see `covariance_of`."""
    covariance = covariance_of(one, coarseness)
    names = one.objective.coordinates.parameters
    return problem.model.constants(problem.steps, one.told.values, names, covariance)


def resonant_constants(problem: Problem, one: Hypothesis) -> dict[str, Constant]:
    """Return the most probable constants, for whatever values of the build are most probable with them."""
    names = one.objective.coordinates.parameters
    return problem.model.constants(problem.steps, one.resonant.values, names, covariance_of(one))


def parameters_of(candidate: Candidate, one: Hypothesis, coarseness: float = 1.0) -> dict[str, Size]:
    """Return the parameters of an effect as shown to people; for `coarseness` see `covariance_of`."""
    names = one.objective.coordinates.parameters
    covariance = covariance_of(one, coarseness)
    values = shown(one.values, candidate)
    u = {
        knob.name: float(np.sqrt(max(0.0, covariance[k, k])))
        for knob in candidate.effect_parameters
        for k in [names.index(candidate.prefix + knob.name)]
    }
    sizes = {knob.name: Size(values[knob.name], u[knob.name], knob.unit) for knob in candidate.effect_parameters}
    at = [names.index(candidate.prefix + name) for name, own in u.items() if own > 0]
    moved = [candidate.effect.shown({**values, name: values[name] + own}) for name, own in u.items() if own > 0]
    for name, (value, unit) in candidate.effect.shown(values).items():
        slope = np.array([more[name][0] - value for more in moved]) / np.sqrt(np.diag(covariance)[at])
        sizes[name] = Size(value, float(np.sqrt(max(0.0, slope @ covariance[np.ix_(at, at)] @ slope))), unit)
    return sizes


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
