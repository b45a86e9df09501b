"""Laws of resonances and echoes, begun where the residual shows them."""

from collections.abc import Callable

from ....models.effects.learned.several import MOST, numbered, resonant, several
from ...interface import UNCOMPUTABLE
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem
from .delays import echo_starts
from .drawn_corrections import drawn_law
from .law_fits import LearnedCorrection, Made, best_fit, has_already, law_candidate, weighed
from .places import all_places
from .sharp import SharpCorrection, resonance_at, sharp_corrections, worth_of_resonance


def sharp_laws(
    problem: Problem, parent: Hypothesis, residual: Hypothesis, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return resonances and echoes in addition to a hypothesis, at the places where they explain most of a residual."""
    found: list[LearnedCorrection] = []
    for sharp in sharp_corrections(problem, residual, all_places(problem, loads=True)):
        if has_already(problem, parent, sharp.place, sharp.steps, sharp.law):
            continue
        try:
            found += _sharp(problem, parent, sharp, progress)
        except UNCOMPUTABLE:
            continue
    return tuple(found)


def _sharp(
    problem: Problem, parent: Hypothesis, sharp: SharpCorrection, progress: Callable[[str], None]
) -> tuple[LearnedCorrection, ...]:
    """Return the fit of an echo, or of a resonance and of as many more at its place as evidence asks for."""
    effect, one = law_candidate(problem, parent, sharp.place, sharp.steps, sharp.law)
    progress(f"trying the law {sharp.law.name} of {sharp.place.says}")
    start = {one.prefix + name: value for name, value in effect.physical(sharp.start).items()}
    starts = [(parent.values, start)] if start else [(parent.values, own) for own in echo_starts(effect, one, parent)]
    best = best_fit(problem, parent, one, starts, (parent.fit.sizes,))
    if best is None:
        return ()
    made = effect, one, best
    for count in range(2, MOST + 1) if resonant(sharp.law) else ():
        more = _with_one_more(problem, parent, sharp, made, count)
        if more is None or more[2].log_evidence <= made[2].log_evidence:
            break
        made = more
    return weighed(drawn_law(*made), [made])


def _with_one_more(problem: Problem, parent: Hypothesis, sharp: SharpCorrection, made: Made, count: int) -> Made | None:
    """Return the fit with one more resonance at the same place, where the fit without it leaves most."""
    _, before, found = made
    likely = resonance_at(problem, found, sharp.place, sharp.steps, sharp.law)
    if found.fit.shortfall == 0 or not likely or likely[0].explained < worth_of_resonance(count):
        return None
    effect, one = law_candidate(problem, parent, sharp.place, sharp.steps, several(sharp.law, count))
    more = effect.physical({numbered(name, count): value for name, value in likely[0].start.items()})
    known = {name: found.values[name] for name in before.parameters}
    start = known | {one.prefix + name: value for name, value in more.items()}
    values = {name: value for name, value in found.values.items() if name not in known}
    best = best_fit(problem, parent, one, [(values, start)], (found.fit.sizes, parent.fit.sizes))
    return None if best is None else (effect, one, best)
