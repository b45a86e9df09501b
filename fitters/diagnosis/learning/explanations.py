"""Explanations of a misfit with and without a learned law, and which of them is the most probable."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.face_loads import FACES
from ....models.effects.learned.laws import laws
from ....models.effects.learned.parts import laws_of_parts
from ....models.effects.learned.sweep_laws import laws_of_sweeps
from ...error_model.prior_scales import LEFT_AT_MOST
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate
from .law_fits import LearnedCorrection, left_by
from .places import TWINS


@dataclass(frozen=True, eq=False)
class Explanation:
    """A hypothesis with a law, or without one."""

    hypothesis: Hypothesis
    law: LearnedCorrection | None
    parent: Hypothesis
    """The hypothesis without the law."""

    def log_weight(self, temper: float) -> float:
        """Return ln (marginal likelihood times prior odds).

        A law is as probable beforehand as a catalogue effect at its place, shared among all laws there.
        """
        forms = 1
        if self.law is not None:
            quantity = self.law.placed.place.quantity
            forms = len(laws(quantity)) + len(laws_of_sweeps(quantity)) + len(laws_of_parts(quantity))
        return self.hypothesis.log_evidence / temper + self.hypothesis.log_odds - float(np.log(forms))


@dataclass(frozen=True, eq=False)
class Choice:
    """The best law among all explanations."""

    explanations: tuple[Explanation, ...]
    shares: tuple[float, ...]
    """Probability of each."""
    best: Explanation
    law: LearnedCorrection

    @property
    def probability(self) -> float:
        """Probability that a law acts at the place of the best one."""
        here = self.law.placed.place
        return self._of(lambda one: one.law is not None and one.law.placed.place == here)

    def inclusion(self, effect: Candidate) -> float:
        """Return the probability that a catalogue effect is present."""
        return self._of(lambda one: effect in one.parent.effects)

    @property
    def without_law(self) -> Hypothesis | None:
        """The most probable explanation, if it is one by catalogue effects that leaves no more than usual errors."""
        best, _ = max(zip(self.explanations, self.shares, strict=True), key=lambda pair: pair[1])
        return best.parent if best.law is None and best.parent.effects and best.parent.fit.shortfall == 0 else None

    def _of(self, which: Callable[[Explanation], bool]) -> float:
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


def enough(explanations: Sequence[Explanation], parent: Hypothesis) -> list[Explanation]:
    """Return the laws beside some of a parent's effects that leave no more than noise and what good devices leave.

    Next to a sharp resonance, rough errors of a usual size describe some per cent of ln Z, which may have a law, too.
    """
    return [
        one
        for one in explanations
        if one.law is not None
        and one.parent.key <= parent.key
        and one.hypothesis.fit.shortfall == 0
        and one.hypothesis.unexplained <= LEFT_AT_MOST
    ]


def explains(law: LearnedCorrection, parent: Hypothesis) -> bool:
    """Return whether a law leaves less than the hypothesis to which it is added.

    One that leaves more has moved the constants to where the device is so sensitive that errors describe anything.
    """
    return left_by(law.hypothesis) <= max(left_by(parent), LEFT_AT_MOST)


def distinct(explanations: Sequence[Explanation]) -> list[Explanation]:
    """Return the best of all explanations by the same law at the same place beside the same effects.

    A law on the other face of a symmetric device is the same explanation: counted as two, each had at most one half.
    """
    best: dict[object, Explanation] = {}
    for one in explanations:
        law = None if one.law is None else (one.law.effect.place, one.law.candidate.steps, one.law.effect.law.name)
        key = one.parent.key, law
        if key not in best or one.hypothesis.log_evidence > best[key].hypothesis.log_evidence:
            best[key] = one
    different: list[Explanation] = []
    for one in best.values():
        if not any(_are_twins(one, other) for other in different):
            different.append(one)
    return different


def _are_twins(one: Explanation, other: Explanation) -> bool:
    """Return whether two explanations are the same law on one and on the other face, which nothing tells apart."""
    if one.law is None or other.law is None or one.parent.key != other.parent.key:
        return False
    own, its = one.law.effect, other.law.effect
    faces = own.place.where in FACES and its.place.where in FACES and own.place.quantity == its.place.quantity
    same = own.law.name == its.law.name and one.law.candidate.steps == other.law.candidate.steps
    return faces and same and abs(one.hypothesis.log_evidence - other.hypothesis.log_evidence) < TWINS


def chosen(explanations: Sequence[Explanation]) -> Choice | None:
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
    return Choice(tuple(explanations), tuple((part / np.sum(part)).tolist()), best, best.law)


def better(final: Hypothesis, best: Explanation, found: Hypothesis) -> bool:
    """Return whether a law is more probable than what the errors of a good device explain without it."""
    temper = max(final, found, key=lambda one: one.log_evidence).coarseness
    own = replace(best, hypothesis=final).log_weight(temper)
    return own > found.log_evidence / temper + found.log_odds
