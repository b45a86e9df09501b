"""How sure a finding is: what else could stand in its place, once all other findings are there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .decide import Stage, gain, polish, resoftened
from .findings import Alternative
from .problem import Candidate, Problem
from .search import Refit, refit

_RIVALS = 3
_DECIDED = 12.0
_CERTAIN = 0.995
"""No finding is said with more: the model itself may be wrong in a way that nobody has thought of."""


@dataclass(frozen=True, eq=False)
class Weighed:
    """A finding with its weight."""

    candidate: Candidate
    without: Refit
    """The fit with everything but this effect."""
    probability: float
    alternatives: tuple[Alternative, ...]


def weigh(problem: Problem, final: Refit, stages: Sequence[Stage]) -> list[Weighed]:
    """Return every effect of the final fit with its probability, the weightiest first."""
    found: list[Weighed] = []
    for candidate in final.effects:
        rest = tuple(effect for effect in final.effects if effect is not candidate)
        without = polish(problem, refit(resoftened(problem, final), rest, final.values, None))
        rivals = [_instead(problem, final, rest, rival) for rival in _rivals(stages, candidate, rest)]
        odds = [float(np.exp(-0.5 * min(max(deficit(rival, final), -_DECIDED), 1400.0))) for rival in rivals]
        total = 1.0 + sum(odds)
        alternatives = [
            Alternative(rival.effects[-1].effect.name, rival.effects[-1].where, share / total)
            for rival, share in zip(rivals, odds, strict=True)
        ]
        ordered = tuple(sorted(alternatives, key=lambda one: -one.probability))
        found.append(Weighed(candidate, without, min(1 / total, _CERTAIN), ordered))
    return sorted(found, key=lambda one: -gain(one.without, final))


def deficit(rival: Refit, final: Refit) -> float:
    """Return how much worse a rival describes the recordings, by the Bayesian information criterion."""
    knobs = sum(len(effect.knobs) for effect in rival.effects) - sum(len(effect.knobs) for effect in final.effects)
    return gain(rival, final) + knobs * float(np.log(2 * final.objective.points))


def better_instead(problem: Problem, final: Refit, stages: Sequence[Stage]) -> Refit:
    """Return the final fit with look-alikes in the place of effects wherever they do as well with fewer knobs."""
    current = final
    for candidate in final.effects:
        rest = tuple(effect for effect in current.effects if effect is not candidate)
        for rival in _rivals(stages, candidate, rest):
            trial = _instead(problem, current, rest, rival)
            if deficit(trial, current) < 0:
                current = trial
                break
    return current


def _rivals(stages: Sequence[Stage], candidate: Candidate, rest: Sequence[Candidate]) -> list[Refit]:
    """Return the best refits that were tried where this effect was taken in, of kinds that are not there anyway."""
    there = {effect.effect.name for effect in rest}
    for stage in stages:
        tried = (stage.after, *stage.rivals)
        if any(one.effects[-1] is candidate for one in tried):
            others = (one for one in tried if one.effects[-1] is not candidate)
            return [one for one in others if one.effects[-1].effect.name not in there][:_RIVALS]
    return []


def _instead(problem: Problem, final: Refit, rest: tuple[Candidate, ...], rival: Refit) -> Refit:
    """Return the final fit with a rival in the place of an effect."""
    one = rival.effects[-1]
    values = {**final.values, **{name: rival.values[name] for name in one.parameters}}
    soft = resoftened(problem, final)
    return polish(problem, refit(soft, (*rest, one), values, values[one.parameters[0]]))
