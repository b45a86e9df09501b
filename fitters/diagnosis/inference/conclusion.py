"""From all fitted hypotheses to a verdict: named effects, their probabilities, look-alikes, and the residual."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.effects.base.effect import TERMINALS
from ...engine.recording import log_ratio
from ...error_model.instrument_share import accuracy_of
from ...error_model.uncertainty_sources import taken_up
from ..decision_rules import CLASS, CLASS_NATS, LEFT, NAMED, RIVALS, TOLERATED
from ..findings import Alternative, Remaining, Verdict
from ..hypotheses.changes import change_by
from ..hypotheses.hypothesis import Hypothesis, probabilities
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate
from ..search.greedy_search import GreedySearch
from ..validation.forecast import Forecast
from .effect_size import constants_of, largest_of, moves_a_constant, powers_of, sizes_of

Kind = Literal["finding", "remark"]


@dataclass(frozen=True, eq=False)
class NamedEffect:
    """An effect that is named in the verdict."""

    candidate: Candidate
    probability: float
    moves: float
    share: float
    kind: Kind
    without: Hypothesis
    same_as: tuple[Alternative, ...]
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True, eq=False)
class Conclusion:
    """Conclusion from all hypotheses of a search."""

    null: Hypothesis
    final: Hypothesis
    named: tuple[NamedEffect, ...]
    """Largest rms change of ln Z first."""
    remaining: Remaining
    something_left: bool
    """Whether no effect explains a residual larger than the instrument's error."""
    something_else: float
    """Probability of anything beside the named effects: of another effect, or of what no effect explains."""
    nearest: tuple[Candidate, float] | None
    """The single effect that explains most, and its part of the misfit; None if no effect explains half of it."""
    forecast: Forecast | None = None
    """How what was learned predicts held-out data; None if nothing was."""

    @property
    def refuted(self) -> bool:
        """Whether held-out data contradict what was learned."""
        return self.forecast is not None and self.forecast.failed

    @property
    def findings(self) -> tuple[NamedEffect, ...]:
        """Named effects that matter for the constants or the residual."""
        return tuple(one for one in self.named if one.kind == "finding")

    @property
    def verdict(self) -> Verdict:
        """The verdict."""
        physics = [one for one in self.findings if one.candidate.effect.name != UNKNOWN]
        flawed = len(physics) < len(self.findings)
        if physics:
            return "partly-explained" if flawed or self.something_left or self.refuted else "explained"
        return "unexplained" if flawed or self.something_left else "no-mismatch"


def conclude(search: GreedySearch) -> Conclusion:
    """Conclude from the fitted hypotheses: drop effects that are too improbable, and name the others."""
    null, best = search.found[frozenset()], search.best
    sure = _certainty(search, best)
    while unsure := [one for one in best.effects if sure[one].of_class < NAMED]:
        best = search.without(best, min(unsure, key=lambda one: sure[one].of_class))
        sure = _certainty(search, best)
    there = _at_its_places(search, best)
    if there is not best:
        sure = _certainty(search, there)
    final = _most_probable_alike(search, there, sure)
    if final is not there:
        sure = _certainty(search, final)
    moves = sizes_of(search.problem, final)
    after = constants_of(search.problem, final)
    accuracy = max(accuracy_of(recording.sweep) for recording in search.problem.recordings)
    named: list[NamedEffect] = []
    for one in sorted(final.effects, key=lambda one: -moves[one]):
        without = search.without(final, one)
        sizes = final.fit.sizes
        artefact = one.effect.name == UNKNOWN  # an error of the instrument itself
        error = accuracy * max(sizes.slow, sizes.fast, TOLERATED if artefact else 0.0)
        matters = largest_of(search.problem, final, one) > error
        if not artefact:
            matters = matters or moves_a_constant(constants_of(search.problem, without), after)
        matters = matters and not (error > 0 and _is_the_fixture(search, one, final))
        share = max(0.0, 1 - _rms(final) ** 2 / max(_rms(without) ** 2, 1e-300))
        same, others = _alternatives(search, final, one, sure[one].alike)
        named.append(
            NamedEffect(
                one,
                sure[one].of_effect,
                moves[one],
                share,
                "finding" if matters else "remark",
                without,
                same,
                others,
            )
        )
    left = final.unexplained > LEFT
    return Conclusion(
        null, final, tuple(named), remaining_of(final), left, _something_else(search, final.key), _nearest(search, null)
    )


def _at_its_places(search: GreedySearch, one: Hypothesis) -> Hypothesis:
    """Return the most probable hypothesis with these effects, at whatever places: what was dropped had moved them."""
    names = sorted(effect.effect.name for effect in one.effects)
    return next(own for own in search.probable if sorted(effect.effect.name for effect in own.effects) == names)


def _most_probable_alike(search: GreedySearch, one: Hypothesis, sure: Mapping[Candidate, "_Certainty"]) -> Hypothesis:
    """Return the hypothesis with those of its effects and of their look-alikes that are most probably present."""
    choices = product(*((effect, *sure[effect].alike) for effect in one.effects))
    keys = [key for choice in choices if (key := frozenset(choice)) in search.found and len(key) == len(one.key)]
    names = {effect.effect.name for key in keys for effect in key}
    present = {name: search.inclusion({name}) for name in names}
    return search.found[max(keys, key=lambda key: sum(present[effect.effect.name] for effect in key))]


def remaining_of(one: Hypothesis) -> Remaining:
    """Return what a hypothesis leaves of ln Z, and the most probable causes of it."""
    taken = taken_up(one.fit)
    return Remaining(
        total=_size(one.fit.left_by_the_model),
        instrument=_size(taken.instrument),
        device=_size(taken.usual),
        constants=_size(taken.model),
        noise=_size(taken.left),
    )


def _something_else(search: GreedySearch, named: frozenset[Candidate]) -> float:
    """Return the posterior probability of hypotheses that have other effects than these, or leave too much."""
    parts = zip(search.ranked, probabilities(search.ranked).tolist(), strict=True)
    enough = sum(part for one, part in parts if one.key <= named and one.unexplained <= LEFT)
    return max(0.0, 1.0 - enough)


@dataclass(frozen=True)
class _Certainty:
    """Posterior probability of an effect, and of it or any of its look-alikes."""

    of_effect: float
    of_class: float
    alike: frozenset[Candidate]


def _certainty(search: GreedySearch, one: Hypothesis) -> dict[Candidate, _Certainty]:
    """Return the probability of each effect of a hypothesis.

    This is its posterior inclusion probability, times the probability that the change of ln Z is due to the effect and
    not to an unnamed cause. Between two causes of random shape the odds are the ratio of their squared sizes, where
    each point is weighted by the effect's squared size there.
    """
    other = one.unexplained_at
    found: dict[Candidate, _Certainty] = {}
    for effect, power in powers_of(search.problem, one).items():
        alike = _look_alikes(search, one, effect)
        rest = {its.effect.name for its in one.effects if its is not effect}
        names = {effect.effect.name, *(its.effect.name for its in alike)} - rest
        itself = float(power @ power) / max(float(power @ power) + max(float(power @ other), 0.0), 1e-300)
        found[effect] = _Certainty(
            search.inclusion({effect.effect.name}) * itself, search.inclusion(names) * itself, frozenset(alike)
        )
    return found


def _nearest(search: GreedySearch, null: Hypothesis) -> tuple[Candidate, float] | None:
    alone = [h for h in search.ranked if len(h.effects) == 1 and h.effects[0].effect.name != UNKNOWN]
    if not alone:
        return None
    share = 1 - _rms(alone[0]) ** 2 / max(_rms(null) ** 2, 1e-300)
    return (alone[0].effects[0], share) if share > NAMED else None


def _is_the_fixture(search: GreedySearch, one: Candidate, final: Hypothesis) -> bool:
    """Return whether what an effect at the terminals does is no more than the usual residual of a compensated fixture.

    Relative to it, root mean square over all points: half an ohm is none, though its lead may hardly have inductance.
    """
    if one.where != TERMINALS:
        return False
    columns = final.fit.gram.columns
    usual = np.array([part == "fixture" for part in columns.parts], dtype=bool)
    deviations = [np.sqrt(np.sum(np.abs(block[:, usual]) ** 2, axis=1)) for block in columns.blocks]
    changes = change_by(search.problem, final, one)
    ratios = [np.abs(own) / size for own, size in zip(changes, deviations, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(ratios) ** 2))) < TOLERATED


def _rms(one: Hypothesis) -> float:
    return _size(one.fit.gram.r)


def _size(parts: Sequence[np.ndarray]) -> float:
    return float(np.sqrt(np.mean(np.abs(np.concatenate(parts)) ** 2)))


def _rivals(search: GreedySearch, one: Hypothesis, effect: Candidate) -> list[tuple[Hypothesis, Candidate]]:
    """Return the best hypotheses with one effect replaced, and the replacement."""
    rest = one.key - {effect}
    instead = [h for h in search.ranked if rest < h.key and len(h.key) == len(one.key) and effect not in h.key]
    pairs = [(h, next(iter(h.key - rest))) for h in instead[:RIVALS]]
    here = effect.effect.name, effect.where
    return [
        (h, other) for h, other in pairs if other.effect.name != UNKNOWN and (other.effect.name, other.where) != here
    ]


def _look_alikes(search: GreedySearch, one: Hypothesis, effect: Candidate) -> set[Candidate]:
    """Return the effects that, in place of another, change ln Z nearly as it does, and that nothing rules out."""
    own = change_by(search.problem, one, effect)
    within = CLASS_NATS * one.coarseness
    alike: set[Candidate] = set()
    for rival, other in _rivals(search, one, effect):
        behind = one.log_evidence - rival.log_evidence
        if behind < within:
            # what the rival does in place of the effect, with all that its constants and further sizes contribute
            instead = [a + b for a, b in zip(own, _apart(one, rival), strict=True)]
            if _correlation(one.projected([own, instead])) > CLASS:
                alike.add(other)
    return alike


def _apart(one: Hypothesis, other: Hypothesis) -> list[Complexes]:
    """Return the difference of ln Z of two fits, for each recording, shape (N,)."""
    curves = (found.objective.curves(found.fit.x) for found in (other, one))
    return [log_ratio(a, b) for a, b in zip(*curves, strict=True)]


def _correlation(columns: Reals) -> float:
    """Return the absolute correlation of two columns, shape (2N, 2)."""
    norm = np.linalg.norm(columns, axis=0)
    return abs(float(columns[:, 0] @ columns[:, 1])) / max(float(norm[0] * norm[1]), 1e-300)


def _alternatives(
    search: GreedySearch, final: Hypothesis, one: Candidate, alike: Collection[Candidate]
) -> tuple[tuple[Alternative, ...], tuple[Alternative, ...]]:
    """Return the alternatives that the recordings cannot distinguish from an effect, and all that were tried."""
    said = [
        (other in alike, Alternative(other.effect.name, other.where, search.inclusion({other.effect.name})))
        for _, other in _rivals(search, final, one)
    ]
    twins = [Alternative(one.effect.name, twin.where, 0.0) for twin in search.twins.get(one, ())]
    same = [*twins, *(entry for is_alike, entry in said if is_alike)]
    return tuple(dict.fromkeys(same)), tuple(dict.fromkeys(entry for _, entry in said))
