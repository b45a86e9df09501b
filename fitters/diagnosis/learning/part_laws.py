"""Laws of a part of the area: a mass on a part of a face, a gap in a part of a bond.

No correction over frequency shows them: what they do to the impedance has satellites of the device's own resonances.
To first order in its size each is a known change of ln Z, whose other parameters are tried on a grid.
"""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from ....models.base.arrays import Reals
from ....models.effects.learned.corrections import Place
from ....models.effects.learned.laws import Law
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.parts import laws_of_parts
from ....models.stack import Stack
from ...error_model.error_sizes import ErrorSizes
from ...interface import UNCOMPUTABLE
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.problem import Problem
from .delays import Probe, changed_by
from .law_fits import LearnedCorrection, Made, has_already, law_candidate, left_by
from .places import all_places
from .plain_laws import from_plain
from .sharp import SharpCorrection, as_real, beside_constants, orthonormal, without_twins

_SMALL = 0.01
"""Size at which a change is computed, in units of a typical one."""
_TRIED = 24
"""Values of a further parameter over its range: a mass moves its satellite by less than a width from each to the
next."""
_STARTED = 6
"""Budget: number of starts of plain least squares, at all places together."""
_FITTED = 2
"""Budget: number of laws that are fitted by marginal likelihood."""


def part_laws(
    problem: Problem, parent: Hypothesis, residual: Hypothesis, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return laws of a part of the area in addition to a hypothesis, at the places where they explain most.

    `residual`: the hypothesis at the minimum of plain least squares, whose residual they are looked for in.
    """
    progress("trying laws of a part of the area")
    starts = [
        start
        for place, steps in all_places(problem)
        for law in laws_of_parts(place.quantity)
        if not has_already(problem, parent, place, steps, law)
        for start in _starts(residual, place, steps, law)
    ]
    starts = without_twins(sorted(starts, key=lambda one: -one.explained))
    found: dict[tuple[Place, tuple[str, ...], str], Made] = {}
    for start in starts[:_STARTED]:
        made = _plain(problem, parent, residual, start)
        key = start.place, start.steps, start.law.name
        if made is not None and (key not in found or left_by(made[2]) < left_by(found[key][2])):
            found[key] = made
    best = sorted(found.values(), key=lambda one: left_by(one[2]))[:_FITTED]
    better = [one for one in best if left_by(one[2]) < left_by(residual)]
    return tuple(law for one in better for law in from_plain(problem, parent, one))


def _starts(residual: Hypothesis, place: Place, steps: tuple[str, ...], law: Law) -> list[SharpCorrection]:
    """Return the starts of a law at a place that explain something with a positive part of the area."""
    size = law.parameters[0]
    grids = [np.geomspace(knob.lower, knob.upper, _TRIED).tolist() for knob in law.parameters[1:]]
    small = _SMALL * size.typical
    names = [knob.name for knob in law.parameters[1:]]
    tried = [dict(zip(names, values, strict=True)) for values in product(*grids)]

    def probes(stack: Stack) -> Sequence[Probe]:
        effect = LearnedLaw(place, law, stack)
        return [(effect, effect.physical({size.name: small, **values})) for values in tried]

    frequency, changes, J, r = changed_by(residual, steps, probes)
    if frequency.size <= J.shape[1]:
        return []
    known = orthonormal(J)
    target = beside_constants(known, as_real(r[:, None]))[:, 0]
    columns: Reals = beside_constants(known, as_real(changes / small))
    along, power = -(columns.T @ target), np.einsum("np,np->p", columns, columns)
    best = np.maximum(along, 0.0) / np.maximum(power, 1e-300)
    explained = best * np.maximum(along, 0.0) / float(target @ target)
    return [
        SharpCorrection(place, steps, law, float(part), {size.name: min(float(own), size.upper / 2), **values})
        for values, own, part in zip(tried, best, explained, strict=True)
        if own > 0
    ]


def _plain(problem: Problem, parent: Hypothesis, residual: Hypothesis, start: SharpCorrection) -> Made | None:
    """Return the law fitted by plain least squares."""
    effect, one = law_candidate(problem, parent, start.place, start.steps, start.law)
    own = {one.prefix + name: value for name, value in effect.physical(start.start).items()}
    try:
        made = fitted(problem, (*parent.effects, one), residual.values | own, (ErrorSizes(),), rounds=0, compared=False)
    except UNCOMPUTABLE:
        return None
    return effect, one, made
