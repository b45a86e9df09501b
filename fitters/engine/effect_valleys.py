"""Minima of a fit in the parameters of effects that ripple over frequency: there is one for each number of ripples."""

from collections.abc import Sequence

import numpy as np

from ...models.base.arrays import Reals
from .descent import Descent, settle
from .objective import Objective
from .parameters.known_effects import KnownEffect

_REACH = 3.0
"""Standard uncertainties around the value of the build that are searched."""
_PLACES = 200
"""Budget: places in that range, at each of which the model is computed once."""
_TRIED = 3
"""Budget: minima of the others along the range from which descents start."""


def deepest_valley(found: Descent, known: Sequence[KnownEffect]) -> Descent:
    """Return the deepest minimum along each rippling parameter of the effects that a build states.

    `found` itself where it describes the recordings to their noise.
    """
    for one in known:
        for name, knob in one.parameters:
            if (knob.ripples or knob.delay) and name in found.objective.coordinates.free:
                stated = one.spec.values[knob.name]
                reach = _REACH * stated.u
                low = stated.re**2 / (stated.re + reach) if knob.lower == 0 else max(knob.lower, stated.re - reach)
                found = _deepest(found, name, np.linspace(low, min(stated.re + reach, knob.upper), _PLACES))
    return found


def _deepest(found: Descent, name: str, places: Reals) -> Descent:
    """Return the deepest minimum along one parameter, with all others where linear derivatives put them."""
    objective = found.objective
    if all(recording.misfit == 0 for recording in objective.recordings):
        return found
    coordinates = objective.coordinates
    k, values = coordinates.free.index(name), coordinates.forward(found.x)[0]
    others = np.delete(objective.jacobian(found.x), k, axis=1)
    starts: list[Reals] = []
    left: list[float] = []
    for place in places.tolist():
        x = coordinates.inverse({**values, name: place})
        r = objective.residual(x)
        step = -np.linalg.lstsq(others, r, rcond=None)[0]
        starts.append(np.insert(np.delete(x, k) + step, k, x[k]))
        left.append(float(np.sum((r + others @ step) ** 2)))
    inner = np.array(left)[1:-1]
    minima = 1 + np.flatnonzero((inner <= left[:-2]) & (inner <= left[2:]))
    lowest = sorted(minima.tolist(), key=lambda n: left[n])[:_TRIED]
    tried = [settle(objective.recordings, coordinates, objective.priors, starts[n]) for n in lowest]
    return min((found, *tried), key=lambda one: _misfit(one.objective, one.x))


def _misfit(objective: Objective, x: Reals) -> float:
    """Return the misfit in units of the noise alone."""
    pairs = zip(objective.recordings, objective.log_ratios(x), strict=True)
    return sum(float(np.sum(np.abs(ratio / one.noise) ** 2)) for one, ratio in pairs)
