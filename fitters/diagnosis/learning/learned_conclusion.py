"""The conclusion of a diagnosis with a learned law: what is named, with which probability, and what else might be."""

from collections.abc import Sequence
from dataclasses import replace

from ....models.effects.learned.learned import LearnedLaw
from ..decision_rules import SUREST
from ..findings import Alternative
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.problem import Candidate, Problem
from ..inference.conclusion import Conclusion, NamedEffect, in_order, remaining_of
from ..inference.effect_size import moved
from .drawn_corrections import PlacedCorrection
from .explanations import Choice

_SAID = 0.01
"""Smallest probability at which an alternative is mentioned."""


def concluded(problem: Problem, conclusion: Conclusion, choice: Choice, final: Hypothesis) -> Conclusion:
    """Return the conclusion from the best explanation."""
    before = {one.candidate: one for one in conclusion.named}
    one_law = choice.law
    named = [
        NamedEffect(
            one_law.candidate,
            choice.probability,
            moved(problem, final, one_law.candidate, choice.best.parent),
            "finding",
            choice.best.parent,
            (),
            _alternatives(choice, conclusion),
        )
    ]
    for effect in choice.best.parent.effects:
        without = choice.without(effect) or _less(problem, final, effect)
        moves, known = moved(problem, final, effect, without), before.get(effect)
        if known is not None:
            named.append(replace(known, moves=moves, without=without))
        else:
            named.append(NamedEffect(effect, choice.inclusion(effect), moves, "finding", without, (), ()))
    return _with(conclusion, final, named)


def concluded_without_law(problem: Problem, conclusion: Conclusion, choice: Choice, found: Hypothesis) -> Conclusion:
    """Return the conclusion from effects of the catalogue that leave nothing if their formulas do not err.

    The conclusion before left something: smooth errors of its effects' formulas had absorbed what others explain.
    """
    known = [one.candidate for one in conclusion.named]
    others = [one for one in known if one not in found.effects]
    instead = [Alternative(one.effect.name, one.where, choice.inclusion(one)) for one in others]
    said = tuple(one for one in instead if one.probability > _SAID)
    named: list[NamedEffect] = []
    for effect in found.effects:
        less = _less(problem, found, effect)
        moves = moved(problem, found, effect, less)
        named.append(NamedEffect(effect, choice.inclusion(effect), moves, "finding", less, (), said))
    return _with(conclusion, found, named)


def as_sure_as_the_list(conclusion: Conclusion) -> Conclusion:
    """Return the conclusion with no effect of the catalogue surer than that what was recorded is in a catalogue."""
    named = [
        one
        if isinstance(one.candidate.effect, LearnedLaw)
        else replace(
            one,
            probability=min(one.probability, SUREST),
            same_as=tuple(replace(same, probability=min(same.probability, SUREST)) for same in one.same_as),
        )
        for one in conclusion.named
    ]
    return replace(conclusion, named=tuple(named))


def _with(conclusion: Conclusion, final: Hypothesis, named: Sequence[NamedEffect]) -> Conclusion:
    """Return the conclusion with other effects."""
    return replace(
        conclusion,
        final=final,
        named=in_order(named),
        remaining=remaining_of(final),
        nearest=None,
        undecided=(),
    )


def _alternatives(choice: Choice, conclusion: Conclusion) -> tuple[Alternative, ...]:
    """Return the named effects that the law replaces, and the other laws, with their probabilities."""
    replaced = [one.candidate for one in conclusion.named if one.candidate not in choice.best.parent.effects]
    catalogue = [Alternative(one.effect.name, one.where, choice.inclusion(one)) for one in replaced]
    by_law: dict[tuple[str, str], float] = {}
    for share, one in zip(choice.shares, choice.explanations, strict=True):
        if one.law is not None:
            key = f"learned ({one.law.effect.law.name})", one.law.placed.place.where
            by_law[key] = by_law.get(key, 0.0) + share
    by_law.pop((f"learned ({choice.law.effect.law.name})", choice.law.placed.place.where), None)
    others = [Alternative(name, where, share) for (name, where), share in sorted(by_law.items(), key=lambda it: -it[1])]
    return tuple(one for one in (*catalogue, *others) if one.probability > _SAID)


def _less(problem: Problem, final: Hypothesis, effect: Candidate) -> Hypothesis:
    """Return the explanation fitted without one of its effects."""
    rest = tuple(one for one in final.effects if one is not effect)
    return fitted(problem, rest, final.values, (final.fit.sizes,), near=True, barred=("tau", "shape"))


def with_its_place(places: Sequence[PlacedCorrection], choice: Choice) -> tuple[PlacedCorrection, ...]:
    """Return the places of smooth corrections, with that of the best law in front if it was found by its sharpness."""
    own = choice.law.placed
    if any(one is own for one in places):
        return tuple(places)
    others = (one for one in places if one.place != own.place)
    rest = [replace(one, probability=one.probability * max(0.0, 1 - choice.probability)) for one in others]
    return (replace(own, probability=choice.probability), *rest)
