"""The learned law as a further effect of a conclusion."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ....models.effects.learned.laws import laws
from ..decision_rules import LEFT, NAMED
from ..findings import Alternative
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.problem import Problem
from ..inference.conclusion import Conclusion, NamedEffect, remaining_of, unexplained
from ..inference.effect_size import sizes_of
from .laws import LearnedCorrection, learned_laws
from .places import PlacedCorrection

_SAID = 0.01
"""Smallest probability at which another law is mentioned."""
_TRIED = 2
"""Budget: number of places at which laws are fitted."""


def with_learned(
    problem: Problem,
    conclusion: Conclusion,
    places: Sequence[PlacedCorrection],
    progress: Callable[[str], None] = lambda _: None,
) -> Conclusion:
    """Return the conclusion with the most probable law as a further effect, if one is more probable than none."""
    likely = [one for one in places if one.probability > (1 - NAMED) / 2][:_TRIED]
    found = [law for one in likely for law in learned_laws(problem, conclusion.final, one, progress)]
    if not found:
        return conclusion
    best = max(found, key=lambda one: one.hypothesis.log_evidence)
    alone = fitted(
        problem, conclusion.final.effects, conclusion.final.values, (conclusion.final.fit.sizes,), near=True, tau=False
    )
    probability = _probability(alone, best, found)
    if probability < NAMED:
        return conclusion
    return _extended(problem, conclusion, best, found, probability)


def learned_instead(
    problem: Problem, conclusion: Conclusion, places: Sequence[PlacedCorrection], progress: Callable[[str], None]
) -> Conclusion:
    """Return the conclusion with a learned law in place of all named effects, if the law is more probable than they.

    What no list holds is imitated by what a list holds, so the two must compete. `places`: of the misfit without
    effects. A law is as probable beforehand as an effect of the catalogue at its place, shared among all laws there.
    """
    likely = [one for one in places if one.probability > (1 - NAMED) / 2][:_TRIED]
    found = [law for one in likely for law in learned_laws(problem, conclusion.null, one, progress)]
    if not found:
        return conclusion
    final = conclusion.final
    named = fitted(problem, final.effects, final.values, (final.fit.sizes,), near=True, tau=False)
    best = max(found, key=lambda one: one.hypothesis.log_weight)
    weights = [
        named.log_weight,
        *(one.hypothesis.log_weight - np.log(len(laws(one.placed.place.quantity))) for one in found),
    ]
    part = np.exp((np.array(weights) - np.max(weights)) / best.hypothesis.coarseness)
    here = [one.placed.place == best.placed.place for one in found]
    probability = float(np.sum(part[1:][here]) / np.sum(part))
    if probability < NAMED:
        return conclusion
    others = tuple(
        Alternative(one.candidate.effect.name, one.candidate.where, one.probability * float(part[0] / np.sum(part)))
        for one in conclusion.named
    )
    bare = replace(conclusion, final=conclusion.null, named=())
    extended = _extended(problem, bare, best, found, probability)
    (law,) = extended.named
    likely_others = tuple(one for one in others if one.probability > _SAID)
    return replace(extended, named=(replace(law, alternatives=(*likely_others, *law.alternatives)),), nearest=None)


def _probability(parent: Hypothesis, best: LearnedCorrection, found: Sequence[LearnedCorrection]) -> float:
    """Return the probability that a law acts at the best law's place, among all laws tried and none."""
    temper = best.hypothesis.coarseness
    weights = np.array([parent.log_evidence, *(one.hypothesis.log_evidence for one in found)]) / temper
    part = np.exp(weights - np.max(weights))
    here = [one.placed.place == best.placed.place for one in found]
    return float(np.sum(part[1:][here]) / np.sum(part))


def _extended(
    problem: Problem,
    conclusion: Conclusion,
    best: LearnedCorrection,
    found: Sequence[LearnedCorrection],
    probability: float,
) -> Conclusion:
    law = best.hypothesis
    final = fitted(problem, law.effects, law.values, (law.fit.sizes,), near=True)
    moves = sizes_of(problem, final)
    others = tuple(
        Alternative(
            f"learned ({one.effect.law.name})", one.placed.place.where, one.placed.probability * one.probability
        )
        for one in found
        if one is not best and one.placed.probability * one.probability > _SAID
    )
    before, after = unexplained(conclusion.final), unexplained(final)
    share = max(0.0, 1 - (after / before) ** 2) if before > 0 else 0.0
    learned = NamedEffect(
        best.candidate, probability, moves[best.candidate], share, "finding", conclusion.final, (), others
    )
    return replace(
        conclusion,
        final=final,
        named=tuple(sorted((*conclusion.named, learned), key=lambda one: -one.moves)),
        remaining=remaining_of(final),
        something_left=unexplained(final) > LEFT,
    )
