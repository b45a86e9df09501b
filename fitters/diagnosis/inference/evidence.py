"""How much one explanation is worth against another: misfit, what was known beforehand, and what freedom costs."""

from collections.abc import Collection

import numpy as np

from ....models.effects import EffectParameter
from ...engine.descent import lag_one
from ..hypotheses.problem import Candidate
from ..search.refit import Refit

_DECADES = 9.0
"""ln(10^4): before it is measured, any size from the smallest that shows to ten thousand times as much is as likely."""
_NONE_YET = 2.0
"""Standard uncertainties up to which a size is none."""


def gain(before: Refit, after: Refit) -> float:
    """Return how far chi2 falls, in units of what is left over and of points worth counting.

    What was known beforehand counts too: a fit that reaches the noise by a density five uncertainties off has paid.
    """
    ratios = after.objective.log_ratios(after.descent.x)
    n = np.array([recording.sweep.frequency.size for recording in after.objective.recordings], float)
    fall = np.array(before.chi2) - np.array(after.chi2)
    rho = np.array([min(max(0.0, lag_one(ratio) - 2 / np.sqrt(ratio.size)), 0.99) for ratio in ratios])
    worth = 2 * n * (1 - rho) / (1 + rho)
    eased = before.against - after.against
    return float(np.sum(worth * fall / np.maximum(1.0, np.array(after.chi2)))) + eased


def bic_penalty(found: Refit) -> float:
    """Return chi2 plus the penalty of the Bayesian information criterion for each parameter, per degree of freedom."""
    points = 2 * found.objective.points
    effect_parameters = sum(len(effect.effect_parameters) for effect in found.effects)
    return (found.chi2_per_dof + found.against / points) * (1 + effect_parameters * float(np.log(points)) / points)


def evidence_lost(rival: Refit, final: Refit) -> float:
    """Return by how much a rival is worse: -2 ln of the ratio of evidences, by Laplace's approximation.

    Effects common to both models cancel; their poorly determined parameters must not decide the comparison.
    """
    shared = {*rival.effects} & {*final.effects}
    return gain(rival, final) + _freedom(rival, shared) - _freedom(final, shared)


def _freedom(found: Refit, shared: Collection[Candidate]) -> float:
    """Return what its other effects cost: -2 ln(odds of each, and part of what was possible that is left of it).

    A size may be anything over some decades; any other parameter anything between its limits. One that the recording
    leaves open costs nothing, whatever a criterion that counts parameters says.
    D. J. C. MacKay, Neural Comput. 4 (1992) 415.
    """
    cost = 0.0
    sigmas = _sigmas(found)
    for effect in found.effects:
        if effect in shared:
            continue
        sizes = dict(effect.sizes)
        cost -= 2 * float(np.log(effect.effect.odds))
        for name, knob in zip(effect.parameters, effect.effect_parameters, strict=True):
            value, sigma = found.values[name], sigmas[name]
            cost += 2 * float(np.log1p(_possible(value, sigma, knob, size=name in sizes) / sigma))
    return cost


def _possible(value: float, sigma: float, knob: EffectParameter, size: bool) -> float:
    """Return the width of what a parameter may be, in its unit: of a size, on a logarithmic scale around what it is.

    A size of two standard uncertainties or less is none yet: that fits end with it or without is chance.
    """
    away = abs(value - knob.null)
    if size or knob.from_nothing:
        return _DECADES * float(np.sqrt(max(0.0, away**2 - (_NONE_YET * sigma) ** 2)))
    width = knob.upper - knob.lower
    if knob.lower > 0:
        width = value * float(np.log(knob.upper / knob.lower))
    return (width if np.isfinite(width) else 10 * max(away, knob.typical)) / float(np.sqrt(2 * np.pi))


def _sigmas(found: Refit) -> dict[str, float]:
    """Return the uncertainty of each parameter; the constants and earlier parameters are free, later ones held."""
    coordinates = found.objective.coordinates
    names = [name for effect in found.effects for name in effect.parameters]
    if not names:
        return {}
    own = [coordinates.free.index(name) for name in names]
    J = found.objective.jacobian(found.descent.x)
    others = [k for k in range(J.shape[1]) if k not in own]
    _, R = np.linalg.qr(J[:, [*others, *own]])
    _, chain = coordinates.forward(found.descent.x)
    slopes = [abs(float(chain[coordinates.parameters.index(name), k])) for name, k in zip(names, own, strict=True)]
    norms = np.abs(np.diag(R))[len(others) :]
    return {name: slope / norm if norm > 0 else np.inf for name, slope, norm in zip(names, slopes, norms, strict=True)}
