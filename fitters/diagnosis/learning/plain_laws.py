"""Smooth laws that plain least squares find: some change a device by more than a correction to first order shows.

So are those of a sweep found, which no correction over frequency shows.
"""

from collections.abc import Callable

from ....models.effects import EffectParameter
from ....models.effects.base.effect import SWEEP
from ....models.effects.learned.corrections import Place
from ....models.effects.learned.laws import Law, laws
from ....models.effects.learned.sweep_laws import IN_TIME, swept_places
from ...error_model.error_columns import stack_of
from ...error_model.error_sizes import ErrorSizes
from ...interface import UNCOMPUTABLE
from ..hypotheses.candidates import step_groups
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.problem import Problem
from .drawn_corrections import drawn_law
from .law_fits import LearnedCorrection, Made, best_fit, has_already, law_candidate, left_by, weighed
from .places import all_places

_ROUGHLY = 3
"""Budget: number of laws found by plain least squares that are fitted by marginal likelihood."""


def plainly_better_laws(
    problem: Problem, parent: Hypothesis, residual: Hypothesis, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return the smooth laws with which plain least squares leave least at all places, in addition to a hypothesis.

    A law may change the device by so much that no correction is found to first order. `residual`: the hypothesis at
    the minimum of plain least squares, where each begins.
    """
    progress("trying smooth laws of all places by plain least squares")
    found: list[tuple[float, Made]] = []
    for place, steps, law in _forms(problem):
        sharp = any(knob.name in ("delay", "q") for knob in law.parameters)
        if sharp or has_already(problem, parent, place, steps, law):
            continue
        effect, one = law_candidate(problem, parent, place, steps, law)
        values = {**residual.values, **dict(zip(one.parameters, map(_middle, one.effect_parameters), strict=True))}
        try:
            made = fitted(problem, (*parent.effects, one), values, (ErrorSizes(),), rounds=0, compared=False)
        except UNCOMPUTABLE:
            continue
        found.append((left_by(made), (effect, one, made)))
    best = sorted(found, key=lambda one: one[0])[:_ROUGHLY]
    better = [one for left, one in best if left < left_by(residual)]
    return tuple(law for one in better for law in from_plain(problem, parent, one))


def _forms(problem: Problem) -> list[tuple[Place, tuple[str, ...], Law]]:
    """Return every law at every place, with the steps that have it; what happened in a sweep may be of one step."""
    found = [(place, steps, law) for place, steps in all_places(problem, loads=True) for law in laws(place.quantity)]
    for place, law in swept_places(stack_of(problem.recordings[-1].model)):
        groups = step_groups(SWEEP, problem.steps) if law in IN_TIME else [problem.steps]
        found += [(place, steps, law) for steps in groups]
    return found


def _middle(knob: EffectParameter) -> float:
    """Return a value of a parameter from which plain least squares can go anywhere."""
    return knob.expected[0] if knob.from_nothing else knob.null


def from_plain(problem: Problem, parent: Hypothesis, found: Made) -> tuple[LearnedCorrection, ...]:
    """Return a law fitted by marginal likelihood from where plain least squares ended; none if that fails."""
    effect, one, plain = found
    best = best_fit(problem, parent, one, [(plain.values, {})], (parent.fit.sizes, ErrorSizes()))
    if best is None:
        return ()
    try:
        return weighed(drawn_law(effect, one, best), [(effect, one, best)])
    except UNCOMPUTABLE:
        return ()
