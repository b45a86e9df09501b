"""A learned law as a further effect of a conclusion, beside named effects or in place of them, as the evidence says."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.errors import PzctlError
from ....models.effects.learned.laws import laws
from ....models.effects.learned.learned import NAME
from ...error_model.error_sizes import ErrorSizes
from ..decision_rules import LEFT, NAMED
from ..findings import Alternative
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate, Problem
from ..inference.conclusion import Conclusion, NamedEffect, remaining_of
from ..inference.effect_size import sizes_of
from ..search.weak_lines import with_weak_lines
from ..validation.forecast import forecast_of
from .laws import LearnedCorrection, learned_laws, sharp_laws
from .places import PlacedCorrection, placed_corrections

_SAID = 0.01
"""Smallest probability at which an alternative is mentioned."""
_TRIED = 2
"""Budget: number of places at which laws are fitted, beside those that are as likely."""
_AS_LIKELY = 0.5
"""Probability relative to the likeliest place from which a place counts as likely as it."""
_PARENTS = 4
"""Budget: number of sets of catalogue effects beside which laws are fitted."""
_LAWS = 2
"""Budget: number of laws learned one after the other."""


@dataclass(frozen=True, eq=False)
class _Explanation:
    """A hypothesis with a law, or without one."""

    hypothesis: Hypothesis
    law: LearnedCorrection | None
    parent: Hypothesis
    """The hypothesis without the law."""

    def log_weight(self, temper: float) -> float:
        """Return ln (marginal likelihood times prior odds).

        A law is as probable beforehand as a catalogue effect at its place, shared among all laws there.
        """
        forms = 1 if self.law is None else len(laws(self.law.placed.place.quantity))
        return self.hypothesis.log_evidence / temper + self.hypothesis.log_odds - float(np.log(forms))


@dataclass(frozen=True, eq=False)
class _Choice:
    """The best law among all explanations."""

    explanations: tuple[_Explanation, ...]
    shares: tuple[float, ...]
    """Probability of each."""
    best: _Explanation
    law: LearnedCorrection

    @property
    def probability(self) -> float:
        """Probability that a law acts at the place of the best one."""
        here = self.law.placed.place
        return self._of(lambda one: one.law is not None and one.law.placed.place == here)

    def inclusion(self, effect: Candidate) -> float:
        """Return the probability that a catalogue effect is present."""
        return self._of(lambda one: effect in one.parent.effects)

    def _of(self, which: Callable[[_Explanation], bool]) -> float:
        return sum(share for share, one in zip(self.shares, self.explanations, strict=True) if which(one))

    def without(self, effect: Candidate) -> Hypothesis | None:
        """Return the best law beside the same effects except one, if it was fitted."""
        rest = frozenset(self.best.parent.effects) - {effect}
        same = [
            one.hypothesis
            for one in self.explanations
            if one.law is not None and one.law.placed.place == self.law.placed.place and one.parent.key == rest
        ]
        return max(same, key=lambda one: one.log_evidence, default=None)


@dataclass(frozen=True, eq=False)
class Learning:
    """The search for laws beside hypotheses of catalogue effects."""

    problem: Problem
    progress: Callable[[str], None] = lambda _: None
    jobs: int = 1

    def learned(
        self, conclusion: Conclusion, tried: Sequence[Hypothesis]
    ) -> tuple[Conclusion, tuple[PlacedCorrection, ...]]:
        """Return the conclusion with learned laws, and the places of the misfit that the first one describes.

        What no list holds is imitated by what a list holds. Laws are therefore fitted beside the named effects, beside
        fewer of them, beside none, and beside the best single effects that were `tried`, and all compete. Artefacts of
        unknown cause are no such effects: they imitate nothing.
        """
        parents = [conclusion.final, *(one.without for one in conclusion.named), conclusion.null]
        single = (one for one in tried if len(one.effects) == 1 and one.effects[0].effect.name != UNKNOWN)
        found, places = self.extended(conclusion, [*parents, *single])
        for _ in range(_LAWS - 1):
            if found is conclusion or not found.something_left:
                break
            conclusion = found
            found, _ = replace(self, problem=self._beside_lines_of(found.final)).extended(found, [found.final])
        return self._validated(found), places

    def _validated(self, conclusion: Conclusion) -> Conclusion:
        """Return the conclusion with the forecast of held-out data, if a law was learned."""
        if not any(one.candidate.effect.name == NAME for one in conclusion.named):
            return conclusion
        try:
            return replace(conclusion, forecast=forecast_of(self.problem, conclusion.final))
        except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
            return conclusion

    def _beside_lines_of(self, one: Hypothesis) -> Problem:
        """Return the problem with the weak lines beside which a hypothesis was fitted."""
        return replace(self.problem, lines=one.fit.marginal.lines)

    def extended(
        self, conclusion: Conclusion, parents: Sequence[Hypothesis]
    ) -> tuple[Conclusion, tuple[PlacedCorrection, ...]]:
        """Return the conclusion with one more law, if one is more probable than none."""
        different: dict[frozenset[Candidate], Hypothesis] = {}
        for one in parents:
            different.setdefault(one.key, one)
        explanations: list[_Explanation] = []
        places: dict[Hypothesis, tuple[PlacedCorrection, ...]] = {}
        for one in sorted(list(different.values())[:_PARENTS], key=lambda one: len(one.effects)):
            parent = self._alone(one)
            explanations.append(_Explanation(parent, None, parent))
            enough = _enough(explanations, parent)
            if enough:
                places[parent] = places[enough[0].parent]
                explanations += self._the_same_beside(parent, enough)
                continue
            places[parent], least = self._places(parent, conclusion.something_left)
            for placed in _likely(places[parent], least):
                made = learned_laws(self.problem, parent, placed, self.progress)
                explanations += [_Explanation(law.hypothesis, law, parent) for law in made if _explains(law, parent)]
            if parent.unexplained > LEFT and not _enough(explanations, parent):
                made = sharp_laws(self.problem, parent, self._plain(parent), self.progress)
                explanations += [_Explanation(law.hypothesis, law, parent) for law in made if _explains(law, parent)]
        choice = _chosen(explanations)
        if choice is None or choice.probability < NAMED:
            return conclusion, next(iter(places.values()))
        final = self._final(choice)
        problem = self._beside_lines_of(final)
        if not conclusion.something_left and not _better(final, choice.best, _beside(problem, conclusion.final)):
            return conclusion, places[choice.best.parent]
        return _concluded(problem, conclusion, choice, final), _with_its_place(places[choice.best.parent], choice)

    def _the_same_beside(self, parent: Hypothesis, enough: Sequence[_Explanation]) -> list[_Explanation]:
        """Return the best law that leaves nothing beside fewer effects, fitted beside those of another parent.

        It leaves nothing for a law at another place; whether the further effects are there as well is left to evidence.
        """
        best = max(enough, key=lambda one: one.hypothesis.log_evidence)
        law, known = best.law, best.hypothesis
        if law is None:
            return []
        effects, values = (*parent.effects, law.candidate), {**parent.values, **known.values}
        try:
            made = fitted(self.problem, effects, values, (known.fit.sizes, parent.fit.sizes), near=True, tau=False)
        except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
            return []
        return [_Explanation(made, replace(law, hypothesis=made), parent)]

    def _alone(self, one: Hypothesis) -> Hypothesis:
        """Return a hypothesis fitted without smooth errors of the model, which would absorb what a law describes."""
        made = [
            fitted(self.problem, one.effects, one.values, (one.fit.sizes,), near=near, tau=False, shape=False)
            for near in ((True, False) if one.fit.sizes.shape > 0 else (True,))
        ]
        return max(made, key=lambda hypothesis: hypothesis.log_evidence)

    def _places(self, parent: Hypothesis, something_left: bool) -> tuple[tuple[PlacedCorrection, ...], float]:
        """Return the places of what a hypothesis leaves, and the probability from which one is tried.

        If none is more likely than not, they are looked for again from the minimum of plain least squares.
        """
        found = placed_corrections(self.problem, parent, self.progress, self.jobs)
        if something_left and max((one.probability for one in found), default=0.0) < NAMED:
            return placed_corrections(self.problem, self._plain(parent), self.progress, self.jobs), _SAID
        return found, (1 - NAMED) / 2

    def _plain(self, one: Hypothesis) -> Hypothesis:
        """Return a hypothesis at the minimum of plain least squares, from which places are looked for.

        Where much is left, the errors of the model have absorbed it at the minimum of the marginal likelihood, and no
        place explains more than they do to first order.
        """
        return fitted(self.problem, one.effects, one.values, (ErrorSizes(),), near=False, rounds=0)

    def _final(self, choice: _Choice) -> Hypothesis:
        """Return the best explanation beside its own lines, with smooth errors of the constants if these are better.

        Lines that the catalogue's best explanation has left are no lines of the device if a law explains them. They
        would absorb whatever constants that are slightly wrong leave at these frequencies.
        """
        best = choice.best.hypothesis
        try:
            problem = with_weak_lines(self.problem, best)
            best = _beside(problem, best, tau=False)
            made = fitted(problem, best.effects, best.values, (best.fit.sizes,), near=True)
        except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
            return best
        return max(best, made, key=lambda hypothesis: hypothesis.log_evidence)


def _beside(problem: Problem, one: Hypothesis, *, tau: bool = True) -> Hypothesis:
    """Return a hypothesis fitted beside the weak lines of a problem; `tau`: whether smooth errors are allowed."""
    if set(one.fit.marginal.lines) == set(problem.lines):
        return one
    return fitted(problem, one.effects, one.values, (one.fit.sizes, ErrorSizes()), near=True, tau=tau)


def _with_its_place(places: Sequence[PlacedCorrection], choice: _Choice) -> tuple[PlacedCorrection, ...]:
    """Return the places of smooth corrections, with that of the best law in front if it was found by its sharpness."""
    own = choice.law.placed
    if any(one is own for one in places):
        return tuple(places)
    others = (one for one in places if one.place != own.place)
    rest = [replace(one, probability=one.probability * max(0.0, 1 - choice.probability)) for one in others]
    return (replace(own, probability=choice.probability), *rest)


def _enough(explanations: Sequence[_Explanation], parent: Hypothesis) -> list[_Explanation]:
    """Return the laws beside some of a parent's effects that leave no more than noise and the usual errors."""
    return [
        one
        for one in explanations
        if one.law is not None and one.parent.key <= parent.key and one.hypothesis.fit.shortfall == 0
    ]


def _explains(law: LearnedCorrection, parent: Hypothesis) -> bool:
    """Return whether a law leaves less than the hypothesis to which it is added.

    One that leaves more has moved the constants to where the device is so sensitive that errors describe anything.
    """
    return _left(law.hypothesis) <= max(_left(parent), LEFT)


def _left(one: Hypothesis) -> float:
    """Return the rms of ln Z that a model leaves without any errors."""
    return float(np.sqrt(np.mean(np.abs(np.concatenate(one.fit.left_by_the_model)) ** 2)))


def _likely(places: Sequence[PlacedCorrection], least: float) -> list[PlacedCorrection]:
    """Return the places of at least this probability at which a law is looked for.

    None, if it is likely that the misfit has no place.
    """
    if sum(one.probability for one in places) < NAMED:
        return []
    best = max(one.probability for one in places)
    said = [one for one in places if one.probability > least]
    return [one for k, one in enumerate(said) if k < _TRIED or one.probability >= _AS_LIKELY * best]


def _chosen(explanations: Sequence[_Explanation]) -> _Choice | None:
    """Return the best law and the probability of every explanation."""
    with_law = [one for one in explanations if one.law is not None]
    if not with_law:
        return None
    temper = max(explanations, key=lambda one: one.log_weight(1.0)).hypothesis.coarseness
    weight = np.array([one.log_weight(temper) for one in explanations])
    part = np.exp(weight - np.max(weight))
    best = max(with_law, key=lambda one: one.log_weight(temper))
    if best.law is None:
        return None
    return _Choice(tuple(explanations), tuple((part / np.sum(part)).tolist()), best, best.law)


def _better(final: Hypothesis, best: _Explanation, found: Hypothesis) -> bool:
    """Return whether a law is more probable than what the errors of a good device explain without it."""
    temper = max(final, found, key=lambda one: one.log_evidence).coarseness
    own = replace(best, hypothesis=final).log_weight(temper)
    return own > found.log_evidence / temper + found.log_odds


def _concluded(problem: Problem, conclusion: Conclusion, choice: _Choice, final: Hypothesis) -> Conclusion:
    """Return the conclusion from the best explanation."""
    moves = sizes_of(problem, final)
    before = {one.candidate: one for one in conclusion.named}
    one_law = choice.law
    named = [
        NamedEffect(
            one_law.candidate,
            choice.probability,
            moves[one_law.candidate],
            _share(choice.best.parent, final),
            "finding",
            choice.best.parent,
            (),
            _alternatives(choice, conclusion),
        )
    ]
    for effect in choice.best.parent.effects:
        without = choice.without(effect) or _less(problem, final, effect)
        share, known = _share(without, final), before.get(effect)
        if known is not None:
            named.append(replace(known, moves=moves[effect], share=share, without=without))
        else:
            sure = choice.inclusion(effect)
            named.append(NamedEffect(effect, sure, moves[effect], share, "finding", without, (), ()))
    return replace(
        conclusion,
        final=final,
        named=tuple(sorted(named, key=lambda one: -one.moves)),
        remaining=remaining_of(final),
        something_left=final.unexplained > LEFT,
        nearest=None,
    )


def _alternatives(choice: _Choice, conclusion: Conclusion) -> tuple[Alternative, ...]:
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
    return fitted(problem, rest, final.values, (final.fit.sizes,), near=True, tau=False, shape=False)


def _share(without: Hypothesis, final: Hypothesis) -> float:
    """Return the part of the squared misfit that an effect explains."""
    before, after = without.unexplained, final.unexplained
    return max(0.0, 1 - (after / before) ** 2) if before > 0 else 0.0
