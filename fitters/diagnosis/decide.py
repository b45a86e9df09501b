"""Which effects are there: a search that keeps several explanations in sight, everything refitted at each step.

Orthogonal matching pursuit over a small beam. An effect is taken in only where it pays for itself by far more than
noise would, measured in units of what is left over and for as many points as are worth counting.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from ..descent import descend, softened
from .evidence import evidence_lost, gain, price
from .problem import Candidate, Problem
from .score import Score, scores
from .search import ROUGH, Refit, finished, is_there, refit

DESCRIBED = 1.25
"""chi2 per degree of freedom up to which nothing is left to explain."""
SIGNIFICANT = 30.0
"""Gain in chi2, in units of what is left, that an effect must bring: chance gives 16 once in a thousand recordings
for forty candidates, and the noise itself is known to some per cent only."""
_EVIDENT = 18.0
"""What of this gain must remain when the freedom of its knobs is paid for: a line may be anywhere in the band."""
_BEAM = (4, 3, 1)
"""How many explanations with one, two and three effects are kept."""
_AS_GOOD = 4.0
"""chi2 over the best one's, up to which an explanation is pursued: the larger one of two effects leads."""
_WITHIN = 30.0
"""How much less likely (-2 ln) than the best an explanation may be to be pursued, once the best describes all."""
_WORTH_A_REFIT = 0.4
_IMITATED = 1e-2
"""What survives of an effect, part of it, from which its score tells nothing: to first order the constants do all that
it does (a dead layer, a missing bond), and only a refit shows what they cannot."""
_REFITTED_LATER = 10
_REFITTED = 18
_POLISHED = 4
_POLISH = 1e-5
"""Relative tolerance of the fits that are held against each other: a tenth of chi2, where thirty decide."""
_FINER = 1e-7
"""The same for effects that constants imitate: their fits run along narrow valleys and fall little at every step."""
_OUT_OF_REACH = 8.0, 2.0
"""chi2 over the best one's after the rough fit from which no finer one would help; and where the best describes all."""


@dataclass(frozen=True, eq=False)
class Search:
    """Explanations tried so far, so that none is tried twice."""

    problem: Problem
    candidates: tuple[Candidate, ...]
    flaws: tuple[Candidate, ...]
    """Of the instrument: they are held against what was found, and take no part in finding it."""
    progress: Callable[[str], None]
    tried: dict[tuple[tuple[Candidate, ...], frozenset[Candidate]], tuple[Refit, ...]] = field(
        default_factory=dict[tuple[tuple[Candidate, ...], frozenset[Candidate]], tuple[Refit, ...]]
    )
    missed: dict[tuple[Refit, Candidate], Refit] = field(default_factory=dict[tuple[Refit, Candidate], Refit])

    def onward(self, current: Refit, against: Refit | None = None) -> tuple[Refit, ...]:
        """Return refits with one effect more than `current`, of a kind that is not there yet; the best first.

        Those that could not stand `against` an explanation that is known already are left rough.
        """
        return self._all_of(self.candidates, current, against)

    def flawed(self, current: Refit, against: Refit | None = None) -> tuple[Refit, ...]:
        """Return refits with a flaw of the instrument more than `current`; the best first."""
        return self._all_of(self.flaws, current, against)

    def _all_of(self, candidates: tuple[Candidate, ...], current: Refit, against: Refit | None) -> tuple[Refit, ...]:
        key = (candidates, frozenset(current.effects))
        if key not in self.tried:
            self.tried[key] = tuple(_try_all(self.problem, candidates, current, against))
        return self.tried[key]

    def without(self, found: Refit, effect: Candidate) -> Refit:
        """Return the fit with every effect of `found` but this one."""
        if (found, effect) not in self.missed:
            rest = tuple(one for one in found.effects if one is not effect)
            left = refit(resoftened(self.problem, found), rest, found.values, None)
            self.missed[found, effect] = polish(self.problem, left)
        return self.missed[found, effect]


def pursue(search: Search, null: Refit) -> Refit:
    """Return the fit with the effects that are there: until the recordings are described or nothing helps any more."""
    best, beam = null, [null]
    for n, kept in enumerate(_BEAM):
        search.progress(f"looking for effect {n + 1}")
        beam = _next(search, beam)[:kept]
        if not beam:
            break
        if gain(best, beam[0]) > SIGNIFICANT:
            best = beam[0]
        if max(best.chi2) < DESCRIBED:
            beam = [one for one in beam if max(one.chi2) < DESCRIBED and evidence_lost(one, beam[0]) < _WITHIN]
    return best


def _next(search: Search, beam: Sequence[Refit]) -> list[Refit]:
    """Return the best explanations with one effect more than those of the beam."""
    found: dict[frozenset[Candidate], Refit] = {}
    for current in beam:
        for one in search.onward(current):
            if is_there(one) and gain(current, one) > SIGNIFICANT and evidence_lost(current, one) > _EVIDENT:
                found.setdefault(frozenset(one.effects), one)
    ordered = sorted(found.values(), key=price)
    return [one for one in ordered if one.chi2_per_dof < _AS_GOOD * ordered[0].chi2_per_dof]


def null_refit(problem: Problem) -> Refit:
    """Return the fit without effects."""
    objective = problem.objective((), problem.values)
    return finished((), descend(objective, objective.coordinates.x, ROUGH))


def _try_all(problem: Problem, candidates: Sequence[Candidate], current: Refit, against: Refit | None) -> list[Refit]:
    softer = resoftened(problem, current)
    base = refit(softer, current.effects, current.values, None)
    taken = {effect.effect.name for effect in current.effects}
    left = [one for one in candidates if one.effect.name not in taken]
    ranked = _promising(scores(softer, left, base.objective, base.descent.x))
    if max(current.chi2) < DESCRIBED:
        # Near the noise the score test is right about what an effect would bring; far from it, it is only a hint.
        ranked = _worth_a_refit(ranked)
    elif current.effects:
        ranked = ranked[:_REFITTED_LATER]
    rough = [_tried(softer, current, base, score) for score in ranked]
    rough.sort(key=price)
    rivals = [one for one in (*rough[:1], against) if one is not None]
    likely = [*rough[:_POLISHED], *(one for one in rough[_POLISHED:] if not one.descent.converged)]
    fine = {score.candidate: _POLISH if score.survives > _IMITATED else _FINER for score in ranked}
    polished = [
        polish(problem, one, fine[one.effects[-1]])
        for one in likely
        if all(_within_reach(one, best) for best in rivals)
    ]
    return sorted(polished, key=lambda one: (not is_there(one), price(one)))


def _within_reach(rough: Refit, best: Refit) -> bool:
    """Return whether a finer fit could still stand against the best."""
    return rough.chi2_per_dof < _OUT_OF_REACH[max(best.chi2) < DESCRIBED] * best.chi2_per_dof


def _tried(problem: Problem, current: Refit, base: Refit, score: Score) -> Refit:
    effects = (*current.effects, score.candidate)
    start = {**base.values, **score.start}
    if score.survives > _IMITATED:
        return refit(problem, effects, start, score.value)
    # What the score tells of its sizes is as little worth as what it tells of its gain.
    told, first = refit(problem, effects, start, score.value, _FINER), score.candidate.knobs[0]
    if score.value == first.null and all(start[name] == knob.null for name, knob in score.candidate.sizes[1:]):
        return told
    return min(told, refit(problem, effects, base.values, first.null, _FINER), key=price)


def _worth_a_refit(ranked: list[Score]) -> list[Score]:
    """Return the scores that promise something, and of each effect whose score tells nothing the first."""
    promising = [one for one in ranked if one.survives > _IMITATED and one.gain > _WORTH_A_REFIT * SIGNIFICANT]
    silent = {one.candidate.effect.name: one for one in reversed(ranked) if one.survives <= _IMITATED}
    return [*promising, *silent.values()]


def _promising(found: list[Score]) -> list[Score]:
    """Return the scores worth a refit: the best of them, but of each effect at one place at least."""
    seen: set[str] = set()
    first: list[Score] = []
    for score in found:
        if score.candidate.effect.name not in seen:
            seen.add(score.candidate.effect.name)
            first.append(score)
    rest = [score for score in found if score not in first and score.gain > 0]
    return sorted([*first, *rest][: max(_REFITTED, len(first))], key=lambda score: -score.gain)


def resoftened(problem: Problem, current: Refit) -> Problem:
    """Return the problem with its recordings softened by what a refit leaves."""
    ratios = current.objective.log_ratios(current.descent.x)
    soft = tuple(softened(recording, ratio) for recording, ratio in zip(problem.recordings, ratios, strict=True))
    return replace(problem, recordings=soft)


def polish(problem: Problem, rough: Refit, tolerance: float = _POLISH) -> Refit:
    """Return a refit with weights that fit what it leaves over."""
    best = rough
    for _ in range(3):
        again = refit(resoftened(problem, best), best.effects, best.values, None, tolerance)
        if again.chi2_per_dof > 0.97 * best.chi2_per_dof:
            return again if again.chi2_per_dof < best.chi2_per_dof else best
        best = again
    return best


def without_idle(search: Search, found: Refit) -> Refit:
    """Return the refit without the effects whose absence is hardly felt once the others are there."""
    current = found
    for effect in found.effects:
        if len(current.effects) < 2:
            break
        trial = search.without(current, effect)
        if gain(trial, current) < SIGNIFICANT:
            current = trial
    return current


def weightiest(search: Search, found: Refit, most: int) -> Refit:
    """Return the fit with at most so many effects, those left out that are felt least."""
    current = found
    while len(current.effects) > most:
        current = min((search.without(current, effect) for effect in current.effects), key=price)
    return current
