"""Size of an effect: the change of the recordings beyond what constants could do, and the change of the constants."""

from collections.abc import Mapping

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.effects import Device
from ...engine.parameters.assembly import layers_of
from ...engine.recording import log_ratio
from ...error_model.uncertainty_sources import spread_of
from ...interface import Constant
from ...uncertainty.fit_result import fitted_constants
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem


def change_by(problem: Problem, one: Hypothesis, effect: Candidate) -> list[Complexes]:
    """Return ln(Z with / Z without the effect), everything else unchanged, for each recording; shape (N,)."""
    without = [other for other in one.effects if other is not effect]
    curves = one.objective.curves(one.fit.x)
    made: list[Complexes] = []
    for recording, Z in zip(problem.with_effects(without), curves, strict=True):
        model = recording.model
        there = {recording.renamed.get(name, name): name for name in model.parameters()}
        bare = model.replace({own: one.values[n] for n, own in there.items() if n in one.values})
        made.append(log_ratio(Z, bare.impedance(recording.sweep.frequency)) if isinstance(bare, Device) else 0 * Z)
    return made


def projected(one: Hypothesis, changes: list[list[Complexes]]) -> Reals:
    """Return changes of ln Z after projecting out the constants, as columns of shape (2N, K)."""
    free = one.objective.coordinates.free
    effect_parameters = {name for effect in one.effects for name in effect.parameters}
    own = [k for k, name in enumerate(free) if name not in effect_parameters]
    slopes = np.concatenate(one.fit.gram.J)[:, own]
    rows = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(rows, axis=0)
    Q, _ = np.linalg.qr(rows[:, size > 0] / size[size > 0])
    whole = np.stack([np.concatenate(change) for change in changes], axis=1)
    both = np.concatenate([whole.real, whole.imag])
    return both - Q @ (Q.T @ both)


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
