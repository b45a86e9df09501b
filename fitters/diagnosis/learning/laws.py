"""The law of a smooth correction: causal, passive laws of growing order are compared by evidence."""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ....models.base.arrays import Complexes, Reals
from ....models.effects import EffectParameter
from ....models.effects.learned.corrections import Place, places
from ....models.effects.learned.laws import Law, laws
from ....models.effects.learned.learned import LearnedLaw
from ....models.stack import Stack
from ...error_model.error_columns import stack_of
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem
from .delays import echo_starts
from .drawn_corrections import PlacedCorrection
from .law_fits import LearnedCorrection, Made, Start, best_fit, has_already, law_candidate, weighed
from .rational_laws import rational_law

_TRIALS = 6
"""Start values of a frequency over its range."""
_FLOOR = 0.05
"""Smallest uncertainty of a drawn correction that is used, relative to its largest value."""


def learned_laws(
    problem: Problem, parent: Hypothesis, placed: PlacedCorrection, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return the laws fitted at a place in addition to a hypothesis, most probable first."""
    made: list[Made] = []
    for place, law in _forms(placed.place, stack_of(problem.recordings[-1].model)):
        if has_already(problem, parent, place, placed.steps, law):
            continue
        effect, one = law_candidate(problem, parent, place, placed.steps, law)
        progress(f"trying the law {law.name} of {place.says}")
        sizes = placed.hypothesis.fit.sizes, parent.fit.sizes
        best = best_fit(problem, parent, one, _starts(effect, one, placed, parent), sizes)
        if best is not None:
            made.append((effect, one, best))
    progress(f"trying a sum of laws of {placed.place.says}")
    total = rational_law(problem, parent, placed)
    if total is not None:
        made.append(total)
    return weighed(placed, made)


def _forms(place: Place, stack: Stack) -> list[tuple[Place, Law]]:
    """Return the laws of a place; a load can also be corrected by a factor, as by an echo inside of it."""
    found = [(place, law) for law in laws(place.quantity)]
    factor = Place(place.where, "load")
    if place.quantity == "impedance" and factor in places(stack):
        found += [(factor, law) for law in laws(factor.quantity)]
    return found


def _starts(effect: LearnedLaw, one: Candidate, placed: PlacedCorrection, parent: Hypothesis) -> list[Start]:
    """Return the starts of a law's fit: from the smooth correction, or from the residual's periods for an echo."""
    if any(knob.name == "delay" for knob in one.effect_parameters):
        return [(parent.values, start) for start in echo_starts(effect, one, parent)]
    smooth = placed.hypothesis.effects[-1].prefix
    values = {name: value for name, value in placed.hypothesis.values.items() if not name.startswith(smooth)}
    return [(values, start) for start in _start(effect, one, placed)]


def _start(effect: LearnedLaw, one: Candidate, placed: PlacedCorrection) -> list[dict[str, float]]:
    """Return the parameters with which the law is closest to the smooth correction, from the best of many starts."""
    knobs = one.effect_parameters
    largest = float(np.max(np.abs(placed.correction)))
    u = np.hypot(np.hypot(placed.u_re, placed.u_im), _FLOOR * largest)
    grids = [_grid(knob, placed, largest * effect.natural) for knob in knobs]

    def parameters(z: Reals) -> dict[str, float]:
        return {knob.name: _value(knob, float(at)) for knob, at in zip(knobs, z, strict=True)}

    def residual(z: Reals) -> Reals:
        off: Complexes = (effect.correction(parameters(z))(placed.frequency) - placed.correction) / u
        return np.nan_to_num(np.concatenate([off.real, off.imag]), nan=1e6, posinf=1e6, neginf=-1e6)

    tried: list[tuple[float, Reals]] = []
    for start in product(*grids):
        z = np.array([_coordinate(knob, value) for knob, value in zip(knobs, start, strict=True)])
        tried.append((float(np.sum(residual(z) ** 2)), z))
    tried.sort(key=lambda pair: pair[0])
    ends = [least_squares(residual, z, max_nfev=60) for _, z in tried[:3]]
    ends.sort(key=lambda end: float(end.cost))
    return [{one.prefix + name: value for name, value in parameters(end.x).items()} for end in ends[:1]]


def _grid(knob: EffectParameter, placed: PlacedCorrection, size: float) -> Sequence[float]:
    if knob.name == "size":
        return (0.3 * size, size, 3 * size)
    if knob.unit == "Hz":
        return tuple(np.geomspace(knob.lower * 1.01, knob.upper * 0.99, _TRIALS).tolist())
    return (knob.null,)


def _coordinate(knob: EffectParameter, value: float) -> float:
    """Return a parameter without limits: a logarithm, or a logit between its limits."""
    if not np.isfinite(knob.upper) or knob.lower <= 0:
        return float(np.log(max(value, 1e-12 * knob.typical)))
    share = np.clip((value - knob.lower) / (knob.upper - knob.lower), 1e-6, 1 - 1e-6)
    return float(np.log(share / (1 - share)))


def _value(knob: EffectParameter, at: float) -> float:
    if not np.isfinite(knob.upper) or knob.lower <= 0:
        return float(np.exp(np.clip(at, -600, 600)))
    return float(knob.lower + (knob.upper - knob.lower) / (1 + np.exp(-np.clip(at, -60, 60))))
