"""How sure a finding is: what else could stand in its place, once all other findings are there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .decide import Stage, gain, polish, resoftened
from .findings import Alternative
from .problem import Candidate, Problem
from .search import Refit, refit

_RIVALS = 3
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
        rivals = [_instead(problem, final, rest, rival) for rival in _rivals(stages, candidate)]
        odds = [float(np.exp(-0.5 * max(gain(rival, final), 0.0))) for rival in rivals]
        total = 1.0 + sum(odds)
        alternatives = [
            Alternative(rival.effects[-1].effect.name, rival.effects[-1].where, share / total)
            for rival, share in zip(rivals, odds, strict=True)
        ]
        ordered = tuple(sorted(alternatives, key=lambda one: -one.probability))
        found.append(Weighed(candidate, without, min(1 / total, _CERTAIN), ordered))
    return sorted(found, key=lambda one: -gain(one.without, final))


def _rivals(stages: Sequence[Stage], candidate: Candidate) -> list[Refit]:
    """Return the best refits that were tried where this effect was taken in."""
    for stage in stages:
        if stage.after.effects[-1] is candidate:
            return [rival for rival in stage.rivals if rival.effects[-1] is not candidate][:_RIVALS]
    return []


def _instead(problem: Problem, final: Refit, rest: tuple[Candidate, ...], rival: Refit) -> Refit:
    """Return the final fit with a rival in the place of an effect."""
    one = rival.effects[-1]
    values = {**final.values, **{name: rival.values[name] for name in one.parameters}}
    soft = resoftened(problem, final)
    return polish(problem, refit(soft, (*rest, one), values, values[one.parameters[0]]))
