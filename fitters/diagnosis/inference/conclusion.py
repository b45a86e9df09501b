"""From all hypotheses to a verdict: what is named, with which probability, what looks alike, what is left."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ....models.effects.base.effect import TERMINALS
from ...error_model.prior_scales import FIXTURE
from ...error_model.uncertainty_sources import AttributedErrors, taken_up
from ..findings import Alternative, Remaining, Verdict
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate
from ..search.greedy_search import GreedySearch
from .decision_rules import CLASS, CLASS_NATS, INSTRUMENT, NAMED, SOMETHING, TOLERATED
from .effect_size import change_by, constants_of, largest_of, moves_a_constant, projected, sizes_of

Kind = Literal["finding", "remark"]


@dataclass(frozen=True, eq=False)
class NamedEffect:
    """An effect that is named."""

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
    """What follows from a search."""

    null: Hypothesis
    final: Hypothesis
    named: tuple[NamedEffect, ...]
    """By what they move, the most first."""
    remaining: Remaining
    something_left: bool
    """Whether more than the instrument's error is left that no effect explains."""

    @property
    def findings(self) -> tuple[NamedEffect, ...]:
        """Those that matter."""
        return tuple(one for one in self.named if one.kind == "finding")

    @property
    def verdict(self) -> Verdict:
        """The verdict."""
        physics = [one for one in self.findings if one.candidate.effect.name != UNKNOWN]
        flawed = len(physics) < len(self.findings)
        if physics:
            return "partly-explained" if flawed or self.something_left else "explained"
        return "unexplained" if flawed or self.something_left else "no-mismatch"


def conclude(search: GreedySearch) -> Conclusion:
    """Return what follows from the hypotheses that were fitted."""
    null, best = search.found[frozenset()], search.best
    inclusion = search.inclusion()
    sure = [one for one in best.effects if inclusion.get(one.effect.name, 0.0) >= NAMED]
    final = best if len(sure) == len(best.effects) else search.of(sure, best)
    moves = sizes_of(search.problem, final)
    after = constants_of(search.problem, final)
    named: list[NamedEffect] = []
    for one in sorted(final.effects, key=lambda one: -moves[one]):
        without = search.without(final, one)
        sizes = final.fit.sizes
        error = INSTRUMENT * max(sizes.slow, sizes.fast)
        matters = largest_of(search.problem, final, one) > error
        matters = matters or moves_a_constant(constants_of(search.problem, without), after)
        matters = matters and not (error > 0 and _is_the_fixture(one, final))
        share = max(0.0, 1 - _rms(final) ** 2 / max(_rms(without) ** 2, 1e-300))
        same, others = _look_alikes(search, final, one)
        named.append(
            NamedEffect(
                one,
                inclusion.get(one.effect.name, 0.0),
                moves[one],
                share,
                "finding" if matters else "remark",
                without,
                same,
                others,
            )
        )
    taken = taken_up(final.fit)
    remaining = Remaining(_rms(final), _size(taken.instrument))
    return Conclusion(null, final, tuple(named), remaining, _something_left(final, taken))


def _is_the_fixture(one: Candidate, final: Hypothesis) -> bool:
    """Return whether something at the terminals is no larger than what compensation leaves of any fixture."""
    limits = {
        "inductance": FIXTURE["inductance"],
        "resistance": FIXTURE["resistance"],
        "skin": FIXTURE["skin"],
        "capacitance": FIXTURE["capacitance"],
        "conductance": FIXTURE["conductance"],
    }
    known = [(final.values[name], limits[knob.name]) for name, knob in one.sizes[:1] if knob.name in limits]
    return one.where == TERMINALS and bool(known) and all(abs(value) < TOLERATED * limit for value, limit in known)


def _rms(one: Hypothesis) -> float:
    return _size(one.fit.gram.r)


def _size(parts: Sequence[np.ndarray]) -> float:
    return float(np.sqrt(np.mean(np.abs(np.concatenate(parts)) ** 2)))


def _something_left(final: Hypothesis, taken: AttributedErrors) -> bool:
    """Return whether the errors of the model had to be larger than a good device's are."""
    noise = float(np.sqrt(2 * np.mean(np.concatenate([p.noise for p in final.fit.gram.columns.points]) ** 2)))
    model = np.hypot(_size(taken.model), np.sqrt(max(0.0, _size(taken.left) ** 2 - noise**2)))
    sizes = final.fit.sizes
    return (sizes.tau > SOMETHING["tau"] or sizes.rho > SOMETHING["rho"] or sizes.slow > SOMETHING["slow"]) and float(
        model
    ) > INSTRUMENT


def _look_alikes(
    search: GreedySearch, final: Hypothesis, one: Candidate
) -> tuple[tuple[Alternative, ...], tuple[Alternative, ...]]:
    """Return what the recordings do not tell from an effect, and what else was marginal_estimate in its place."""
    rest = final.key - {one}
    rivals = [h for h in search.ranked if rest < h.key and len(h.key) == len(final.key) and one not in h.key]
    own = change_by(search.problem, final, one)
    inclusion = search.inclusion()
    same: list[Alternative] = [Alternative(one.effect.name, twin.where, 0.0) for twin in search.twins.get(one, ())]
    others: list[Alternative] = []
    for rival in rivals[:6]:
        (other,) = rival.key - rest
        if other.effect.name == UNKNOWN or (other.effect.name, other.where) == (one.effect.name, one.where):
            continue
        its = change_by(search.problem, rival, other)
        columns = projected(final, [own, its])
        norm = np.linalg.norm(columns, axis=0)
        alike = abs(float(columns[:, 0] @ columns[:, 1])) / max(float(norm[0] * norm[1]), 1e-300)
        entry = Alternative(other.effect.name, other.where, inclusion.get(other.effect.name, 0.0))
        near = final.log_evidence - rival.log_evidence < CLASS_NATS
        (
            same if (alike > CLASS and final.log_evidence - rival.log_evidence < 10 * CLASS_NATS) or near else others
        ).append(entry)
    return tuple(dict.fromkeys(same)), tuple(dict.fromkeys(others))
