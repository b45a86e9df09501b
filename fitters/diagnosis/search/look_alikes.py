"""Look-alikes of an effect: those that change the recordings as it does, in its place and where they are as large."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ....models.base.arrays import Complexes
from ..hypotheses.changes import change_by
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem
from .screening import STRETCH, ScreenedCandidate
from .trial_changes import changer, is_finite, lines_for, stretched, trial_changes

_BROUGHT = 5
"""Budget: times that sizes are brought nearer to where a change is as large as another."""


def resembling(
    problem: Problem, one: Hypothesis, effect: Candidate, rest: Hypothesis, candidates: Sequence[Candidate]
) -> list[ScreenedCandidate]:
    """Return the candidates that change ln Z in place of an effect of a hypothesis as that does, most similar first.

    Beside its other effects and at its constants: those of `rest`, which lacks the effect, may have gone far to imitate
    it; only where lines stand out is read from its residual. Constants are projected out; the gain of each is its
    correlation, 0 to 1. A large change has the shape of another only where it is as large, so that sizes are brought
    there.
    """
    own, lines = change_by(problem, one, effect), lines_for(rest, candidates)
    others = [other for other in one.effects if other is not effect]
    changers = {other: changer(problem, others, one.values, other) for other in candidates}
    changes = [
        (other, trial_changes(problem, rest, other, lines.get(other.step, []), changers[other])) for other in candidates
    ]
    trials = [(other, values, change) for other, tried in changes for values, change in tried]
    if not trials:
        return []
    best: dict[Candidate, ScreenedCandidate] = {}
    nearest: dict[Candidate, tuple[dict[str, float], float]] = {}
    for (other, values, _), like in zip(trials, _likeness(one, own, trials), strict=True):
        if other not in best or like.correlation > best[other].gain:
            stretch = float(np.clip(like.along, 1 / STRETCH, STRETCH))
            best[other] = ScreenedCandidate(other, like.correlation, stretched(other, values, stretch))
            nearest[other] = values, like.length
    for _ in range(_BROUGHT):
        moved = [(other, stretched(other, *near)) for other, near in nearest.items() if _grows(other)]
        made = [(other, values, changers[other](values)) for other, values in moved]
        trials = [trial for trial in made if is_finite(trial[2])]
        nearest = {}
        for (other, values, _), like in zip(trials, _likeness(one, own, trials), strict=True):
            nearest[other] = values, like.length
            if like.correlation > best[other].gain:
                best[other] = ScreenedCandidate(other, like.correlation, values)
    return sorted(best.values(), key=lambda promise: -promise.gain)


class _Likeness(NamedTuple):
    """How a change of ln Z is like another one."""

    correlation: float
    """Without its sign, 0 to 1."""
    along: float
    """Factor by which it is nearest to the other one."""
    length: float
    """Factor by which it is as large as the other one."""


def _likeness(
    one: Hypothesis, own: Sequence[Complexes], trials: Sequence[tuple[Candidate, dict[str, float], list[Complexes]]]
) -> list[_Likeness]:
    """Return how each change is like `own` beyond what the constants of a hypothesis could do."""
    columns = one.projected([list(own), *(change for *_, change in trials)])
    norm = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    along = columns[:, 0] @ columns / norm**2
    return [
        _Likeness(abs(factor) * size / float(norm[0]), factor, float(norm[0]) / size)
        for factor, size in zip(along[1:].tolist(), norm[1:].tolist(), strict=True)
    ]


def _grows(one: Candidate) -> bool:
    """Return whether a change grows with all sizes of an effect, from none."""
    return all(knob.from_nothing for _, knob in one.sizes)
