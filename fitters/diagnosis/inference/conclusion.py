"""From all fitted hypotheses to a verdict: named effects, their probabilities, look-alikes, and the residual."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from ....models.effects.base.effect import TERMINALS
from ...engine.recording import rms
from ...error_model.as_stated import as_stated
from ...error_model.uncertainty_sources import taken_up
from ..decision_rules import LISTED, NAMED, NOTHING, PARENTS, TOLD, TOLERATED
from ..findings import Alternative, Remaining, Verdict
from ..hypotheses.changes import change_by
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate
from ..search.greedy_search import GreedySearch
from ..validation.forecast import Forecast
from .certainty import Certainties, Certainty, kinds_of, rivals
from .effect_size import largest_of, moved, moves_a_constant, resonant_constants

Kind = Literal["finding", "remark"]


@dataclass(frozen=True, eq=False)
class NamedEffect:
    """An effect that is named in the verdict."""

    candidate: Candidate
    probability: float
    moves: float
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
    """That first which moves ln Z most."""
    remaining: Remaining
    something_else: float
    """Probability of anything beside the named effects: of another effect, or of what no effect explains."""
    nearest: tuple[Candidate, float] | None
    """The single effect that explains most, and its part of the misfit; None if no effect explains half of it."""
    undecided: tuple[Alternative, ...] = ()
    """Effects of which some are certainly there, the most probable first, though none can be named."""
    forecast: Forecast | None = None
    """How what was learned predicts held-out data; None if nothing was."""

    @property
    def something_left(self) -> bool:
        """Whether what is left more probably than not has a cause that no effect describes."""
        return self.final.cause_left > NAMED

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
        return "unexplained" if flawed or self.something_left or self.undecided else "no-mismatch"


def conclude(search: GreedySearch) -> Conclusion:
    """Conclude from the fitted hypotheses: name what is probable in the one whose effects are most probably there."""
    null, certainties = search.null, Certainties(search)
    final, sure = _most_certain(search, certainties)
    after = resonant_constants(search.problem, final)
    named: list[NamedEffect] = []
    for one in final.effects:
        without = search.without(final, one)
        sizes = final.fit.sizes
        artefact = one.effect.name == UNKNOWN  # an error of the instrument itself
        error = max(sizes.slow, sizes.fast, TOLERATED if artefact else 0.0)
        matters = largest_of(search.problem, final, one) > error
        if not artefact:
            matters = matters or moves_a_constant(resonant_constants(search.problem, without), after)
        matters = matters and not (error > 0 and _is_the_fixture(search, one, final))
        same, others = _alternatives(certainties, final, one, sure[one].alike)
        named.append(
            NamedEffect(
                one,
                sure[one].of_effect,
                moved(search.problem, final, one, without),
                "finding" if matters else "remark",
                without,
                same,
                others,
            )
        )
    return Conclusion(
        null=null,
        final=final,
        named=in_order(named),
        remaining=remaining_of(final),
        something_else=_something_else(search, final.key),
        nearest=_nearest(search, null),
        undecided=() if named else _undecided(certainties),
    )


def in_order(named: Iterable[NamedEffect]) -> tuple[NamedEffect, ...]:
    """Return the effects, that first which moves ln Z most."""
    return tuple(sorted(named, key=lambda one: -one.moves))


def _most_certain(search: GreedySearch, certainties: Certainties) -> tuple[Hypothesis, Mapping[Candidate, Certainty]]:
    """Return the hypothesis whose effects, each more probable than not, are together most certainly there.

    Where look-alikes share a probability, neither the hypothesis of the largest evidence nor the most probable one
    need have what is certain (median probability model: Barbieri and Berger, Ann. Stat. 32 (2004) 870). One that is
    less probable than no effect at all is no start: look-alikes that nothing shows would add up to something.
    """
    probable = search.probable
    more = probable[: min(probable.index(search.null), PARENTS)]
    ends = [_without_the_improbable(search, one, certainties) for one in dict.fromkeys((search.best, *more))]
    certain = [sum(one.of_class - NAMED for one in sure.values()) for _, sure in ends]
    as_certain = [end for end, own in zip(ends, certain, strict=True) if own > max(certain) - TOLD]
    there, sure = min(as_certain, key=lambda end: search.probable.index(end[0]))
    final = _most_probable_alike(certainties, there, sure)
    return final, sure if final is there else certainties.of(final)


def _without_the_improbable(
    search: GreedySearch, one: Hypothesis, certainties: Certainties
) -> tuple[Hypothesis, Mapping[Candidate, Certainty]]:
    """Return a hypothesis without its improbable effects, the others at their most probable places."""
    sure = certainties.of(one)
    while unsure := [effect for effect in one.effects if sure[effect].of_class < NAMED]:
        one = search.without(one, min(unsure, key=lambda effect: sure[effect].of_class))
        sure = certainties.of(one)
    there = _at_its_places(search, one)
    return there, sure if there is one else certainties.of(there)


def _at_its_places(search: GreedySearch, one: Hypothesis) -> Hypothesis:
    """Return the most probable hypothesis with these effects, at whatever places: what was dropped had moved them."""
    names = sorted(effect.effect.name for effect in one.effects)
    return next(own for own in search.probable if sorted(effect.effect.name for effect in own.effects) == names)


def _most_probable_alike(certainties: Certainties, one: Hypothesis, sure: Mapping[Candidate, Certainty]) -> Hypothesis:
    """Return the hypothesis with those of its effects and of their look-alikes that are most probably present.

    Where no kind of an effect is more probable than not, all of them count for it: a lead that may be a cable. A second
    one of a name counts as much as it is certain that there are two.
    """
    search = certainties.search
    choices = product(*((effect, *sure[effect].alike) for effect in one.effects))
    keys = [key for choice in choices if (key := frozenset(choice)) in search.found and len(key) == len(one.key)]
    effects = {effect.effect.name: effect.effect for key in keys for effect in key}
    vague = [own for name, own in effects.items() if certainties.present({name}) < NAMED]
    present = {name: certainties.present({name, *kinds_of(name, vague)}) for name in effects}

    def together(key: frozenset[Candidate]) -> float:
        counted = Counter(effect.effect.name for effect in key)
        further = (certainties.present({name}, k) for name, n in counted.items() for k in range(1, n))
        return sum(present[name] for name in counted) + sum(further)

    return search.found[max(keys, key=together)]


def remaining_of(one: Hypothesis) -> Remaining:
    """Return what a hypothesis leaves of ln Z, and the most probable causes of it."""
    stated = as_stated(one.fit)
    taken = taken_up(stated)
    return Remaining(
        total=rms(*stated.left_by_the_model),
        instrument=rms(*taken.instrument),
        device=rms(*taken.usual),
        build=rms(*taken.held),
        off={name: change for name, change in taken.off.items() if change},
        constants=rms(*taken.model),
        noise=rms(*taken.left),
    )


def _something_else(search: GreedySearch, named: frozenset[Candidate]) -> float:
    """Return the posterior probability of other effects than these, or of a cause that no effect describes."""
    enough = sum(part * (1 - one.cause_left) for one, part in search.posterior if one.key <= named)
    return max(0.0, 1.0 - enough)


def _undecided(certainties: Certainties) -> tuple[Alternative, ...]:
    """Return the most certain effects, each at its most probable place, unless there may be none at all."""
    search = certainties.search
    if dict(search.posterior)[search.null] > NOTHING:
        return ()
    places = dict[str, str]()
    for one in search.probable:
        for effect in one.effects:
            places.setdefault(effect.effect.name, effect.where)
    own = [Alternative(name, at, certainties.found({name})) for name, at in places.items() if name != UNKNOWN]
    listed = sorted(own, key=lambda one: -one.probability)[:LISTED]
    return tuple(one for one in listed if one is listed[0] or one.probability >= TOLD)


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
    return rms(*one.fit.gram.r)


def _alternatives(
    certainties: Certainties, final: Hypothesis, one: Candidate, alike: Collection[Candidate]
) -> tuple[tuple[Alternative, ...], tuple[Alternative, ...]]:
    """Return the alternatives that the recordings cannot distinguish from an effect, and all that were tried."""
    search = certainties.search
    tried = [other for _, other in rivals(search, final, one)]
    twins = [Alternative(one.effect.name, twin.where, 0.0) for twin in search.twins.get(one, ())]
    said = {
        other: Alternative(other.effect.name, other.where, certainties.found({other.effect.name}, other.where))
        for other in tried
    }
    same = [*twins, *(said[other] for other in tried if other in alike)]
    return tuple(dict.fromkeys(same)), tuple(dict.fromkeys(said.values()))
