"""One step of the search: whatever promises something beside the effects that are there, fitted with all else free."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...engine.descent import descend, with_model_discrepancy
from ...engine.parameters.assembly import nominal_parameters
from ..hypotheses.problem import Candidate, Problem
from ..inference.evidence import bic_penalty
from .pair_scores import promising
from .refit import ROUGH, Refit, finished, is_there, refit
from .score_test import Score, scores

DESCRIBED = 1.25
"""chi2 per degree of freedom up to which nothing is left to explain."""
SIGNIFICANT = 30.0
"""Gain in chi2, in units of what is left, that an effect must bring: chance gives 16 once in a thousand recordings
for forty candidates, and the noise itself is known to some per cent only."""
_WORTH_A_REFIT = 0.4
_IMITATED = 1e-2
"""What survives of an effect, part of it, from which its score tells nothing: to first order the constants do all that
it does (a dead layer, a missing bond), and only a refit shows what they cannot."""
_NEARLY_IMITATED = 0.05
"""The same where much else is unexplained: what is large shows by what it does to second order."""
_REFITTED_LATER = 10
_REFITTED = 18
_POLISHED = 4
_SHORTER = 0.3
"""Part of the size that a score tells, to begin with where a fit from that size ends worse than without the effect."""
_POLISH = 1e-5
"""Relative tolerance of the fits that are held against each other: a tenth of chi2, where thirty decide."""
FINER = 1e-7
"""The same for effects that constants imitate: their fits run along narrow valleys and fall little at every step."""
_ALIKE = 1e-6
"""Relative difference of scores that say the same."""
_OUT_OF_REACH = 8.0, 2.0
"""chi2 over the best one's after the rough fit from which no finer one would help; and where the best describes all."""
_LOST = 0.4
"""Of ln Z, root mean square: a fit that leaves so much has twisted the constants; what is near them tells nothing."""
_AS_A_PAIR = 3.0
"""chi2 after a rough fit up to which a pair may be all there is; others the search one by one finds as well."""


def null_refit(problem: Problem) -> Refit:
    """Return the fit without effects."""
    objective = problem.objective((), problem.values)
    return finished((), descend(objective, objective.coordinates.x, ROUGH))


def tried_beside(
    problem: Problem, candidates: Sequence[Candidate], current: Refit, against: Refit | None
) -> list[Refit]:
    """Return refits with one candidate more than `current`, of a kind that is not there yet; the best first.

    Those that could not stand `against` an explanation that is known already are left rough.
    """
    softer = resoftened(problem, current)
    base = refit(softer, current.effects, current.values, None)
    taken = {effect.effect.name for effect in current.effects}
    left = [one for one in candidates if one.effect.name not in taken]
    ranked = _promising(scores(softer, left, base.objective, base.descent.x))
    if max(current.chi2) < DESCRIBED:
        # Near the noise the score test is right about what an effect would bring; far from it, it is only a hint.
        ranked = _worth_a_refit(ranked)
    elif current.effects:
        ranked = [*ranked[:_REFITTED_LATER], *_silent(ranked[_REFITTED_LATER:], _NEARLY_IMITATED)]
    firsts, twins = _mirrored(ranked)
    rough = [_tried(softer, current, base, score) for score in firsts]
    if _is_lost(current):
        rough += [_from_the_build(problem, softer, candidate) for candidate in left]
    rough.sort(key=bic_penalty)
    rivals = [one for one in (*rough[:1], against) if one is not None]
    likely = [*rough[:_POLISHED], *(one for one in rough[_POLISHED:] if not one.descent.converged)]
    coarse = _POLISH if _survive(base) else FINER
    fine = {score.candidate: coarse if score.survives > _IMITATED else FINER for score in ranked}
    polished = [
        polish(problem, one, fine.get(one.effects[-1], FINER))
        for one in likely
        if all(_within_reach(one, best) for best in rivals)
    ]
    polished += [_elsewhere(problem, one, twin) for one in polished for twin in twins.get(one.effects[-1], ())]
    return sorted(polished, key=lambda one: (not is_there(one), bic_penalty(one)))


def _is_lost(current: Refit) -> bool:
    """Return whether the fit without effects is so far off that its constants are those of no such device."""
    ratios = current.objective.log_ratios(current.descent.x)
    return not current.effects and max(float(np.mean(np.abs(ratio) ** 2)) for ratio in ratios) > _LOST**2


def _from_the_build(problem: Problem, softer: Problem, candidate: Candidate) -> Refit:
    """Return a refit with a candidate alone, of plausible size, from the constants that the build gives."""
    start = {**problem.values, **nominal_parameters(problem.build)}
    return polish(problem, refit(softer, (candidate,), start, candidate.effect_parameters[0].typical))


def tried_in_pairs(problem: Problem, candidates: Sequence[Candidate], null: Refit) -> list[Refit]:
    """Return refits with two candidates that promise most together; the best first."""
    softer = resoftened(problem, null)
    base = refit(softer, (), null.values, None)
    found = scores(softer, candidates, base.objective, base.descent.x)
    pairs = promising(found, base.objective.residual(base.descent.x))
    rough = [
        refit(softer, tuple(score.candidate for score in pair.scores), {**base.values, **pair.start}, None)
        for pair in pairs
    ]
    rough.sort(key=bic_penalty)
    likely = [one for one in rough if _within_reach(one, rough[0]) and one.chi2_per_dof < _AS_A_PAIR]
    return sorted((polish(problem, one) for one in likely), key=bic_penalty)


def _tried(problem: Problem, current: Refit, base: Refit, score: Score) -> Refit:
    effects = (*current.effects, score.candidate)
    start = {**base.values, **score.start}
    if score.survives > _IMITATED:
        told = refit(problem, effects, start, score.value)
        if told.chi2_per_dof < base.chi2_per_dof or score.value == score.candidate.effect_parameters[0].null:
            return told
        # It went astray: at worst the effect would be absent.
        return min(told, refit(problem, effects, start, _SHORTER * score.value), key=bic_penalty)
    # What the score tells of its sizes is as little worth as what it tells of its gain.
    told, first = refit(problem, effects, start, score.value, FINER), score.candidate.effect_parameters[0]
    if score.value == first.null and all(start[name] == knob.null for name, knob in score.candidate.sizes[1:]):
        return told
    return min(told, refit(problem, effects, base.values, first.null, FINER), key=bic_penalty)


def _within_reach(rough: Refit, best: Refit) -> bool:
    """Return whether a finer fit could still stand against the best."""
    return rough.chi2_per_dof < _OUT_OF_REACH[max(best.chi2) < DESCRIBED] * best.chi2_per_dof


def _survive(found: Refit) -> bool:
    """Return whether what its effects do is more than the free constants could do, to first order."""
    free, J = found.objective.coordinates.free, found.objective.jacobian(found.descent.x)
    own = [free.index(effect.parameters[0]) for effect in found.effects]
    Q, _ = np.linalg.qr(np.delete(J, [k for k, name in enumerate(free) if "@" in name], axis=1))
    G = J[:, own]
    return bool(np.all(np.linalg.norm(G - Q @ (Q.T @ G), axis=0) > _IMITATED * np.linalg.norm(G, axis=0)))


def _mirrored(ranked: Sequence[Score]) -> tuple[list[Score], dict[Candidate, list[Candidate]]]:
    """Return the scores without those that say the same of the same effect, and what these stand for.

    The far face of a disk between equal loads: what it would explain need not be found twice.
    """
    firsts: list[Score] = []
    twins: dict[Candidate, list[Candidate]] = {}
    for score in ranked:
        for first in firsts:
            if _same(first, score):
                twins.setdefault(first.candidate, []).append(score.candidate)
                break
        else:
            firsts.append(score)
    return firsts, twins


def _same(one: Score, other: Score) -> bool:
    a, b = one.candidate, other.candidate
    if a.effect is not b.effect or a.steps != b.steps or a.effect_parameters != b.effect_parameters or one.gain <= 0:
        return False
    return bool(np.allclose([one.gain, one.survives, one.size], [other.gain, other.survives, other.size], rtol=_ALIKE))


def _elsewhere(problem: Problem, found: Refit, where: Candidate) -> Refit:
    """Return the same explanation with its newest effect in a place where it looks the same."""
    newest = found.effects[-1]
    values = {name: value for name, value in found.values.items() if name not in newest.parameters}
    there = zip(where.parameters, newest.parameters, strict=True)
    moved = values | {name: found.values[own] for name, own in there}
    return refit(resoftened(problem, found), (*found.effects[:-1], where), moved, None, _POLISH)


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


def _worth_a_refit(ranked: list[Score]) -> list[Score]:
    """Return the scores that promise something, and those that tell nothing."""
    promising = [one for one in ranked if one.survives > _IMITATED and one.gain > _WORTH_A_REFIT * SIGNIFICANT]
    return [*promising, *_silent(ranked, _IMITATED)]


def _silent(ranked: list[Score], survives: float) -> list[Score]:
    """Return of each effect of which no more than that part survives the first."""
    return list({one.candidate.effect.name: one for one in reversed(ranked) if one.survives <= survives}.values())


def resoftened(problem: Problem, current: Refit) -> Problem:
    """Return the problem with its recordings softened by what a refit leaves."""
    ratios = current.objective.log_ratios(current.descent.x)
    soft = tuple(
        with_model_discrepancy(recording, ratio) for recording, ratio in zip(problem.recordings, ratios, strict=True)
    )
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
