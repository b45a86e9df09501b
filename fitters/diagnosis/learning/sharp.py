"""Corrections that are too sharp for a smooth one to find their place: resonances and echoes, read from the residual.

To first order, the best resonance and the best echo of every place are those that explain most of the squared residual
beside the constants. Both are found by trying frequencies and quality factors, and delays, on a grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.base.face_loads import FACES
from ....models.effects.learned.corrections import Place
from ....models.effects.learned.laws import Law, laws
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.several import MOST, resonant
from ...error_model.error_columns import stack_of
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem
from .delays import delays_at, linearised

_QUALITIES = (2.0, 6.0, 20.0, 60.0, 200.0)
_PER_WIDTH = 2.0
"""Frequencies tried per width of a resonance."""
_BEST = 8
"""Budget: number of resonances and of echoes that are fitted, those of both faces of a symmetric device as one; those
of several places explain the same to first order. The right one of a strong resonance was the seventh: what it does is
not linear in it."""
_EQUAL = 1e-9
"""Difference of what two explain, both faces of a symmetric device, that is rounding error."""
_WORTH_ECHO = 1 / 2
"""Part of the squared residual beside the constants that an echo must explain: more than it leaves."""


@dataclass(frozen=True, eq=False)
class SharpCorrection:
    """A resonance, an echo or a law of a part of the area at one place, to first order."""

    place: Place
    steps: tuple[str, ...]
    law: Law
    explained: float
    """Part of the squared residual beside the constants that it explains."""
    start: dict[str, float]
    """Its parameters in the law's units; empty where a fit finds its own, as for an echo."""


def sharp_corrections(
    problem: Problem, parent: Hypothesis, everywhere: Sequence[tuple[Place, tuple[str, ...]]]
) -> tuple[SharpCorrection, ...]:
    """Return the resonances and the echoes that explain most of what a hypothesis leaves."""
    resonances: list[SharpCorrection] = []
    echoes: list[SharpCorrection] = []
    for place, steps in everywhere:
        for law in laws(place.quantity):
            if resonant(law):
                resonances += resonance_at(problem, parent, place, steps, law)
            elif any(knob.name == "delay" for knob in law.parameters):
                echoes += _echo(problem, parent, place, steps, law)
    return (*_best(resonances, worth_of_resonance(1)), *_best(echoes, _WORTH_ECHO))


def worth_of_resonance(k: int) -> float:
    """Return the part of the squared residual that resonance number `k` of a place must explain.

    Of those that may still come, it is the largest: it explains more than if what is left were shared by one more.
    """
    return 1 / (MOST - k + 2)


def _best(found: Sequence[SharpCorrection], worth: float) -> list[SharpCorrection]:
    """Return the corrections that explain most, those of one place one after the other."""
    best: dict[Place, float] = {}
    for one in found:
        best[one.place] = max(best.get(one.place, 0.0), one.explained)
    ranked = sorted(found, key=lambda one: (-best[one.place], -one.explained))
    return without_twins([one for one in ranked if one.explained > worth])[:_BEST]


def without_twins(found: Sequence[SharpCorrection]) -> list[SharpCorrection]:
    """Return the corrections in their order, each that both faces of a symmetric device can have at one of them."""
    different: list[SharpCorrection] = []
    for one in found:
        if not any(_are_twins(one, other) for other in different):
            different.append(one)
    return different


def _are_twins(one: SharpCorrection, other: SharpCorrection) -> bool:
    """Return whether two corrections are the same on one and on the other face, which nothing tells apart."""
    faces = one.place.where in FACES and other.place.where in FACES and one.place.quantity == other.place.quantity
    same = one.law is other.law and one.steps == other.steps
    return faces and same and abs(one.explained - other.explained) < _EQUAL


def _echo(
    problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...], law: Law
) -> list[SharpCorrection]:
    """Return the echo of a place that explains most; its delay is found again by its fit."""
    stack = stack_of(problem.recordings[-1].model)
    knobs = {knob.name: knob for knob in LearnedLaw(place, law, stack).effect_parameters(stack, place.where)}
    likely = delays_at(parent, place, steps, knobs["delay"].lower, knobs["delay"].upper)
    if not likely:
        return []
    _, _, J, r = linearised(parent, place, steps)
    target = beside_constants(orthonormal(J), as_real(r[:, None]))[:, 0]
    return [SharpCorrection(place, steps, law, likely[0].explained / float(target @ target), {})]


def resonance_at(
    problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...], law: Law
) -> list[SharpCorrection]:
    """Return the resonance of a place that explains most with a positive strength."""
    frequency, slope, J, r = linearised(parent, place, steps)
    if frequency.size <= J.shape[1]:
        return []
    f0 = LearnedLaw(place, law, stack_of(problem.recordings[-1].model)).reference
    x = frequency / f0
    known = orthonormal(J)
    target = beside_constants(known, as_real(r[:, None]))[:, 0]
    tried = [(at, q) for q in _QUALITIES for at in _grid(float(x.min()), float(x.max()), q)]
    columns = np.stack([slope * law.of(x, {"size": 1.0, "at": at, "q": q}) for at, q in tried], axis=1)
    beside = beside_constants(known, as_real(columns))
    along, power = -(beside.T @ target), np.einsum("np,np->p", beside, beside)
    size = np.maximum(along, 0.0) / np.maximum(power, 1e-300)
    explained = size * np.maximum(along, 0.0) / float(target @ target)
    k = int(np.argmax(explained))
    if size[k] <= 0:
        return []
    (at, q), strength = tried[k], float(size[k])
    start = {"size": strength, "at": at, "q": q}
    return [SharpCorrection(place, steps, law, float(explained[k]), start)]


def _grid(low: float, high: float, q: float) -> list[float]:
    return np.exp(np.arange(np.log(low), np.log(high), 1 / (_PER_WIDTH * q))).tolist()


def orthonormal(J: Complexes) -> Reals:
    """Return orthonormal columns that span what the constants do, from the derivatives by them."""
    known, _ = np.linalg.qr(as_real(J))
    return np.asarray(known, np.float64)


def as_real(columns: Complexes) -> Reals:
    """Return real over imaginary parts, shape (2N, P)."""
    return np.concatenate([columns.real, columns.imag])


def beside_constants(known: Reals, columns: Reals) -> Reals:
    """Return columns without what the constants could do."""
    return columns - known @ (known.T @ columns)
