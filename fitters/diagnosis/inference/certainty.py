"""How certain an effect is, averaged over all hypotheses, and which others look like it."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.effects import Effect
from ...engine.recording import log_ratio
from ...error_model.prior_scales import SHAPE
from ..decision_rules import CLASS, CLASS_NATS, ODDS, RIVALS, TOLD, UNFORESEEN
from ..hypotheses.changes import change_by
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate
from ..search.greedy_search import GreedySearch
from .effect_size import powers_of

_NEGLIGIBLE = 1e-4
"""Probability below which a hypothesis is left out."""


@dataclass(frozen=True)
class Certainty:
    """Posterior probability of an effect, or of a look-alike that is a kind of it, and of any of its look-alikes."""

    of_effect: float
    of_class: float
    alike: frozenset[Candidate]


@dataclass(frozen=True, eq=False)
class Certainties:
    """The certainty of effects in the hypotheses of a search."""

    search: GreedySearch
    _itself: WeakKeyDictionary[Hypothesis, dict[Candidate, float]] = field(
        default_factory=WeakKeyDictionary[Hypothesis, dict[Candidate, float]]
    )

    def of(self, one: Hypothesis) -> dict[Candidate, Certainty]:
        """Return the certainty of each effect of a hypothesis.

        Of several of one name, the one that explains second most is as certain as it is that there are two of them.
        """
        found: dict[Candidate, Certainty] = {}
        for effect in one.effects:
            alike = look_alikes(self.search, one, effect)
            rest = {its.effect.name for its in one.effects if its.effect.name != effect.effect.name}
            names = {effect.effect.name, *(its.effect.name for its in alike)} - rest
            own = {effect.effect.name, *kinds_of(effect.effect.name, (its.effect for its in alike))}
            before = self._before(one, effect)
            found[effect] = Certainty(self.present(own, before), self.present(names, before), frozenset(alike))
        return found

    def _before(self, one: Hypothesis, effect: Candidate) -> int:
        """Return how many effects of the same name explain more in a hypothesis."""
        same = [its for its in one.effects if its.effect.name == effect.effect.name]
        if len(same) == 1:
            return 0
        return sorted(same, key=lambda its: self.search.without(one, its).log_weight).index(effect)

    def present(self, names: Collection[str], beside: int = 0) -> float:
        """Return the probability that one of these effects is present, at whatever place, and changes ln Z so much.

        `beside`: how many others of these names have to be present, too. Where none of the hypotheses holds, an effect
        is as probable as beforehand.
        """
        return self.found(names, beside=beside) + self._unforeseen * ODDS

    def found(self, names: Collection[str], where: str | None = None, beside: int = 0) -> float:
        """Return the same of what the hypotheses contain alone; `where`: its place, None for any.

        The sum over hypotheses of their posterior probability, times the probability that the change is due to the
        effect and not to what the hypothesis leaves unexplained.
        """
        whole = 0.0
        for one, part in self.search.posterior:
            if part <= _NEGLIGIBLE:
                continue
            there = [its for its in one.effects if its.effect.name in names and where in (None, its.where)]
            if len(there) > beside:
                itself = self._itself_in(one)
                whole += part * sorted((itself[effect] for effect in there), reverse=True)[beside]
        return (1 - self._unforeseen) * whole

    @property
    def _unforeseen(self) -> float:
        """Probability that none of the hypotheses holds."""
        return 0.0 if self.search.best.fit.exact else UNFORESEEN

    def _itself_in(self, one: Hypothesis) -> dict[Candidate, float]:
        """Return, by effect, the probability that it and not an unnamed cause changes ln Z in a hypothesis.

        Between two causes of random shape the odds are the ratio of their squared sizes, where each point is weighted
        by the effect's squared size there. The formula of a larger effect of the same name may be wrong as usual, and
        where it errs near resonances, too, a second dot of solder cannot be told from what the formula of the first
        leaves.
        """
        if one not in self._itself:
            powers = powers_of(self.search.problem, one)
            self._itself[one] = {effect: self._share(one, effect, powers) for effect in powers}
        return self._itself[one]

    def _share(self, one: Hypothesis, effect: Candidate, powers: Mapping[Candidate, Reals]) -> float:
        """Return the share of an effect beside what a hypothesis leaves unexplained; `powers`: see `powers_of`.

        Slopes of the constants may say that these imitate it, and a refit without it that they cannot: what counts is
        of second order, or priors hold the constants.
        """
        power = powers[effect]
        of_its_name = (own for its, own in powers.items() if its.effect.name == effect.effect.name)
        larger = [own for own in of_its_name if float(own.sum()) > float(power.sum())]
        if larger and effect.effect.errs_roughly and not one.fit.exact:
            return 0.0
        other = sum((SHAPE**2 * own for own in larger), one.unexplained_at)
        share = _ratio(power, other)
        if share > 1 - TOLD:
            return share
        return max(share, _ratio(self.search.without(one, effect).unexplained_at - one.unexplained_at, other))


def kinds_of(name: str, effects: Iterable[Effect]) -> set[str]:
    """Return the names of those effects that are a kind of this one."""
    return {one.name for one in effects if name in one.implies}


def _ratio(power: Reals, other: Reals) -> float:
    """Return the share of squares at each point that are positive where they are any."""
    power = np.maximum(power, 0.0)
    own = float(power @ power)
    return own / max(own + max(float(power @ other), 0.0), 1e-300)


def rivals(search: GreedySearch, one: Hypothesis, effect: Candidate) -> list[tuple[Hypothesis, Candidate]]:
    """Return the best hypotheses with one effect replaced, and the replacement."""
    rest = one.key - {effect}
    instead = [h for h in search.ranked if rest < h.key and len(h.key) == len(one.key) and effect not in h.key]
    pairs = [(h, next(iter(h.key - rest))) for h in instead[:RIVALS]]
    here = effect.effect.name, effect.where
    return [
        (h, other) for h, other in pairs if other.effect.name != UNKNOWN and (other.effect.name, other.where) != here
    ]


def look_alikes(search: GreedySearch, one: Hypothesis, effect: Candidate) -> set[Candidate]:
    """Return the effects that, in place of another, explain what it explains, and that nothing rules out.

    They change ln Z nearly as it does; or, with errors that absorb different parts of what both do, whatever one of
    them explains the other cannot explain again, and they are about as probable.
    """
    own = change_by(search.problem, one, effect)
    within, part = CLASS_NATS * search.temper, {found.key: own for found, own in search.posterior}
    alike: set[Candidate] = set()
    for rival, other in rivals(search, one, effect):
        behind = one.log_evidence - rival.log_evidence
        if behind < within:
            # what the rival does in place of the effect, with all that its constants and further sizes contribute
            instead = [a + b for a, b in zip(own, _apart(one, rival), strict=True)]
            probable = part[rival.key] > part[one.key] * np.exp(-CLASS_NATS)
            if _correlation(one.projected([own, instead])) > CLASS or (
                probable and _shared(search, one, effect, rival) > CLASS
            ):
                alike.add(other)
    return alike


def _shared(search: GreedySearch, one: Hypothesis, effect: Candidate, rival: Hypothesis) -> float:
    """Return which part of the ln evidence that the less of two effects gains alone it does not gain beside the other.

    `rival`: the hypothesis with the other effect in place of `effect`. What was not fitted together promised nothing.
    """
    rest = search.without(one, effect).log_evidence
    gains = [found.log_evidence - rest for found in (one, rival)]
    together = search.found.get(one.key | rival.key)
    both = max(*gains, together.log_evidence - rest if together is not None else 0.0)
    return (sum(gains) - both) / min(gains) if min(gains) > 0 else 0.0


def _apart(one: Hypothesis, other: Hypothesis) -> list[Complexes]:
    """Return the difference of ln Z of two fits, for each recording, shape (N,)."""
    curves = (found.objective.curves(found.fit.x) for found in (other, one))
    return [log_ratio(a, b) for a, b in zip(*curves, strict=True)]


def _correlation(columns: Reals) -> float:
    """Return the absolute correlation of two columns, shape (2N, 2)."""
    norm = np.linalg.norm(columns, axis=0)
    return abs(float(columns[:, 0] @ columns[:, 1])) / max(float(norm[0] * norm[1]), 1e-300)
