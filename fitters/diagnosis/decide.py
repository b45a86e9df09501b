"""Which effects are there: greedy search, substitution by look-alikes, removal of what is not needed.

Orthogonal matching pursuit with everything refitted at each stage. An effect is taken in only where it pays for itself
by far more than noise would, measured in units of what is left over and for as many points as are worth counting.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..descent import descend, lag_one, softened
from .problem import Candidate, Problem
from .score import Score, scores
from .search import ROUGH, Refit, finished, refit

DESCRIBED = 1.25
"""chi2 per degree of freedom up to which nothing is left to explain."""
SIGNIFICANT = 30.0
"""Gain in chi2, in units of what is left, that an effect must bring: chance gives 16 once in a thousand recordings
for forty candidates, and the noise itself is known to some per cent only."""
_MOST_EFFECTS = 3
_SIZED = 3.0
_WORTH_A_REFIT = 0.4
_REFITTED_LATER = 8
_REFITTED = 16
_POLISHED = 3


@dataclass(frozen=True, eq=False)
class Stage:
    """One effect taken in, and what else was tried in its place."""

    before: Refit
    after: Refit
    rivals: tuple[Refit, ...]
    """Refits with another effect in its place, best first."""


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


def price(found: Refit) -> float:
    """Return chi2 per degree of freedom with a price for each knob, as the Bayesian information criterion has it."""
    points = 2 * found.objective.points
    knobs = sum(len(effect.knobs) for effect in found.effects)
    return (found.chi2_per_dof + found.against / points) * (1 + knobs * float(np.log(points)) / points)


def null_refit(problem: Problem) -> Refit:
    """Return the fit without effects."""
    objective = problem.objective((), problem.values)
    return finished((), descend(objective, objective.coordinates.x, ROUGH))


def pursue(
    problem: Problem, candidates: Sequence[Candidate], null: Refit, progress: Callable[[str], None]
) -> list[Stage]:
    """Return the effects taken in, one stage each, until the recordings are described or nothing helps any more."""
    stages: list[Stage] = []
    current = null
    while len(stages) < _MOST_EFFECTS:
        progress(f"looking for effect {len(stages) + 1}")
        tried = _try_all(problem, candidates, current)
        if not tried or gain(current, tried[0]) < SIGNIFICANT:
            break
        stages.append(Stage(current, tried[0], tuple(tried[1:])))
        current = tried[0]
    return stages


def _try_all(problem: Problem, candidates: Sequence[Candidate], current: Refit) -> list[Refit]:
    """Return refits with one effect more, best first; of a kind that is not there yet."""
    softer = resoftened(problem, current)
    base = refit(softer, current.effects, current.values, None)
    taken = {effect.effect.name for effect in current.effects}
    left = [one for one in candidates if one.effect.name not in taken]
    ranked = _promising(scores(softer, left, base.objective, base.descent.x))
    if max(current.chi2) < DESCRIBED:
        # Near the noise the score test is right about what an effect would bring; far from it, it is only a hint.
        ranked = [score for score in ranked if score.gain > _WORTH_A_REFIT * SIGNIFICANT]
    elif current.effects:
        ranked = ranked[:_REFITTED_LATER]
    rough = [_tried(softer, current, base, score) for score in ranked]
    rough.sort(key=price)
    polished = [polish(problem, one) for one in rough[:_POLISHED]]
    return sorted(polished, key=lambda one: (not _is_there(one), price(one)))


def _tried(problem: Problem, current: Refit, base: Refit, score: Score) -> Refit:
    return refit(problem, (*current.effects, score.candidate), {**base.values, **score.start}, score.value)


def _promising(found: list[Score]) -> list[Score]:
    """Return the scores worth a refit: the best of them, but of each effect at one place at least."""
    seen: set[str] = set()
    first: list[Score] = []
    for score in found:
        if score.candidate.effect.name not in seen:
            seen.add(score.candidate.effect.name)
            first.append(score)
    rest = [score for score in found if score not in first and score.gain > 0]
    return [*first, *rest][:_REFITTED] if len(first) < _REFITTED else first


def _is_there(found: Refit) -> bool:
    """Return whether the newest effect has a size: without its first knob it would be another effect's other knobs."""
    coordinates = found.objective.coordinates
    name = found.effects[-1].parameters[0]
    k = coordinates.free.index(name)
    J = found.objective.jacobian(found.descent.x)
    others = np.delete(J, k, axis=1)
    own = J[:, k] - others @ np.linalg.lstsq(others, J[:, k], rcond=1e-12)[0]
    sigma = 1 / max(float(np.linalg.norm(own)), 1e-300)
    away = float(found.descent.x[k] - coordinates.inverse({**found.values, name: found.effects[-1].knobs[0].null})[k])
    return abs(away) > _SIZED * sigma


def resoftened(problem: Problem, current: Refit) -> Problem:
    """Return the problem with its recordings softened by what a refit leaves."""
    ratios = current.objective.log_ratios(current.descent.x)
    soft = tuple(softened(recording, ratio) for recording, ratio in zip(problem.recordings, ratios, strict=True))
    return replace(problem, recordings=soft)


def polish(problem: Problem, rough: Refit) -> Refit:
    """Return a refit with weights that fit what it leaves over."""
    best = rough
    for _ in range(3):
        again = refit(resoftened(problem, best), best.effects, best.values, None, tolerance=1e-8)
        if again.chi2_per_dof > 0.97 * best.chi2_per_dof:
            return again if again.chi2_per_dof < best.chi2_per_dof else best
        best = again
    return best


def without_idle(problem: Problem, found: Refit) -> Refit:
    """Return the refit without the effects whose absence is hardly felt once the others are there."""
    current = found
    for effect in found.effects:
        if len(current.effects) < 2:
            break
        rest = tuple(one for one in current.effects if one is not effect)
        trial = polish(problem, refit(resoftened(problem, current), rest, current.values, None))
        if gain(trial, current) < SIGNIFICANT:
            current = trial
    return current
