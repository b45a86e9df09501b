"""Greedy search by log evidence: single effects first, then further ones beside the best, then substitutes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...error_model.error_sizes import ErrorSizes
from ..decision_rules import (
    AHEAD,
    CLASS_NATS,
    FITTED_ASTRAY,
    FITTED_FIRST,
    FITTED_LATER,
    MOST,
    NAMED,
    NEAR,
    PARENTS,
    RESEMBLING,
    SOFT,
    SUBSTITUTES,
    TRIED_ALONE,
    WORTH,
)
from ..hypotheses.condensed_recordings import condensed
from ..hypotheses.hypothesis import Hypothesis, beside, coarseness
from ..hypotheses.problem import Candidate, Problem
from .exact_search import exact_hypotheses
from .fitted_hypotheses import FittedHypotheses
from .local_errors import with_local_errors
from .look_alikes import resembling
from .plan import Plan
from .screening import ScreenedCandidate, screened

_APART = 0.03
"""Relative difference of two resonance frequencies from which they are looked at as two: one step of the scan."""


@dataclass(eq=False)
class GreedySearch(FittedHypotheses):
    """A search over sets of effects, with all hypotheses fitted so far."""

    candidates: tuple[Candidate, ...]
    seeds: tuple[tuple[tuple[Candidate, ...], Mapping[str, float]], ...] = ()
    """Effects with values near their minimum, where that cannot be found from the fit without effects."""
    twins: dict[Candidate, tuple[Candidate, ...]] = field(default_factory=dict[Candidate, tuple[Candidate, ...]])
    cut_short: bool = False
    """Whether the search has ended at its budget."""
    _whole: Problem | None = None
    """The problem with all recorded points, while the search is done with fewer."""
    _likely: Candidate | None = None
    _grown: set[frozenset[Candidate]] = field(default_factory=set[frozenset[Candidate]])
    _substituted: set[frozenset[Candidate]] = field(default_factory=set[frozenset[Candidate]])

    def run(self) -> Hypothesis:
        """Run the complete search; return the most probable hypothesis.

        Dense recordings are condensed; what is likely in the end is weighed by all points.
        """
        self._try_each_alone()
        self._extend()
        if self._whole is not None:
            self.weigh_again(replace(self._whole, local=self.problem.local))
            self.polish()
        return self.probable[0]

    def _try_each_alone(self) -> None:
        """Fit the most promising effects alone, each kind at least once."""
        null, whole = self.begin(), self.problem
        few = condensed(whole, null.fit.sizes.colour)
        if few is not whole:
            self._whole, self.problem, self.found = whole, replace(few, values=null.values), {}
            null = self.begin()
        self.fit([Plan(effects, values, (ErrorSizes(),), near=True, rounds=5) for effects, values in self.seeds])
        if self.best is null:
            self.try_without_errors(null)
            self.account_for_local_errors()
            if null.fit.shortfall > 0:  # it was not done: weak lines were missing, which may explain the rest
                self.try_without_errors(self.null)
            self._grow_from_none()

    def _extend(self) -> None:
        """Add further effects to what has been found, and put others in their place."""
        self.polish()
        if self.best.effects:
            self.try_without_errors(self.best)
        self.account_for_local_errors()
        for _ in range(MOST - 1):
            before, least = self.probable[0].key, self.best.log_weight + self.temper
            for parent in self._parents():
                self.grow(parent, FITTED_LATER)
            self.polish()
            # while much is missing all are about as probable: then the evidence tells whether anything was gained
            if self.exhausted or (self.probable[0].key == before and self.best.log_weight < least):
                break
        self.account_for_local_errors()
        self.relocate(self.probable[0])
        self.thin(self.probable[0])
        self.substitute(self.probable[0])
        self.cut_short = self.exhausted

    def try_without_errors(self, start: Hypothesis) -> None:
        """Look for hypotheses that explain the recordings to their noise without any errors, beginning at `start`."""
        self.progress("trying effects without errors of instrument and model")
        for one in exact_hypotheses(replace(self.problem, local=()), self.candidates, start, self.jobs):
            self.take(one)

    def account_for_local_errors(self) -> None:
        """Make the local errors that the best hypothesis leaves part of the error model of all hypotheses."""
        problem = with_local_errors(self.problem, self.best)
        if problem is self.problem:
            return
        self.progress(f"accounting for {len(problem.local)} weak resonances or switches of the range")
        self.fit_again(problem)

    def substitute(self, one: Hypothesis) -> None:
        """Fit the best hypothesis with each effect replaced: by look-alikes, and by others not yet tried beside it.

        Look-alikes are tried even where the budget is spent: a name that was compared with none of them is not sure.
        Where one or two effects leave nothing to explain, others explain as much only if their changes resemble those
        of one of them; several together may also stand for one that has not been tried beside the rest.
        """
        self._substituted.add(one.key)
        settled = one.is_complete and len(one.effects) <= TRIED_ALONE
        for effect in one.effects:
            rest = self.without(one, effect)
            if rest.effects and not (self.exhausted or settled):
                self.grow(rest, SUBSTITUTES, like=one)
            self._try_look_alikes(one, effect, rest, near=settled)
        self.polish()
        first = self.probable[0]
        if first.key not in self._substituted and len(first.effects) >= len(one.effects) and not self.exhausted:
            self.substitute(first)

    def _try_look_alikes(self, one: Hypothesis, effect: Candidate, rest: Hypothesis, *, near: bool) -> None:
        """Fit the effects that resemble one of a hypothesis in its place, though an error of the model hides them.

        `near`: whether only from the constants of the hypothesis.
        """
        # those that were tried beside the rest, too: from other constants they may have ended in another minimum
        possible = beside(rest.effects, self.candidates, exact=one.fit.exact)
        left = [other for other in possible if other.effect.key != effect.effect.key]
        alike: dict[str, ScreenedCandidate] = {}
        for found in resembling(self.problem, one, effect, rest, left):
            if found.gain > RESEMBLING:
                alike.setdefault(found.candidate.effect.name, found)  # at the place where it resembles most
        chosen = list(alike.values())[:SUBSTITUTES]
        plans = [self._near(one, found, rest) for found in chosen]
        if rest.effects and not near:  # alone, each has been fitted from afar
            plans += [plan for found in chosen for plan in self._plans(rest, found.candidate, [found], one)]
        self.fit(plans)

    def _beside(self, parent: Hypothesis) -> list[Candidate]:
        """Return the candidates that have not been tried beside a hypothesis."""
        left = beside(parent.effects, self.candidates, exact=parent.fit.exact)
        return [one for one in left if frozenset((*parent.effects, one)) not in self.found]

    def relocate(self, one: Hypothesis) -> None:
        """Fit the best hypothesis with each of its effects moved to the other places where it can occur.

        This, too, is done where the budget is spent: a place is part of what is said.
        """
        plans: list[Plan] = []
        for effect in one.effects:
            twins = {(twin.where, twin.steps) for twin in self.twins.get(effect, ())}
            rest = tuple(other for other in one.effects if other is not effect)
            for other in beside(rest, self.candidates):
                if other.effect.name != effect.effect.name or other is effect or (other.where, other.steps) in twins:
                    continue
                if frozenset((*rest, other)) in self.found:
                    continue
                plans.append(Plan((*rest, other), {**one.values, **other.taking(effect, one.values)}, (one.fit.sizes,)))
        self.fit(plans)
        self.polish()

    def _parents(self) -> list[Hypothesis]:
        """Return the hypotheses to extend.

        That of the largest evidence, those that are about as probable as the most probable one, and its rival; while
        even the best leaves more than the usual errors, those that may yet win, and the best one with the likeliest
        single effect.
        """
        best, within, likely = self.best, CLASS_NATS, list[Hypothesis]()
        if best.fit.shortfall > NEAR:
            better = (one for one in self.ranked if one.log_weight > self.null.log_weight)
            within, likely = NEAR, [one for one in better if self._likely in one.effects][:1]
        probable = self.posterior[:PARENTS]
        near = [one for one, part in probable if part > probable[0][1] * np.exp(-within)]
        return [
            one
            for one in dict.fromkeys((best, *near, *likely, *self._rival(probable[0][0])))
            if one.effects and len(one.effects) < MOST and one.key not in self._grown
        ]

    def _rival(self, best: Hypothesis) -> list[Hypothesis]:
        """Return the best hypothesis with none of these effects, if it explains at least half as much; else none.

        An effect that explains most of what several do together hides each of them: beside it, none promises anything.
        """
        null, taken = self.null.log_evidence, {one.effect.name for one in best.effects}
        others = [one for one in self.ranked if not taken & {its.effect.name for its in one.effects}][:1]
        return [one for one in others if one.log_evidence - null > NAMED * (best.log_evidence - null)]

    def _grow_from_none(self) -> None:
        """Fit the effects alone: those that promise something, then others that may explain as much.

        What an effect promises is computed where the constants are, and what is missing has led these astray: one that
        promises nothing there may explain everything. Where nothing is missing they are not astray; and where one
        effect leaves nothing, others explain as much only if their changes resemble its own. Beside a complete
        description there is nothing to explain: what the constants would hide cannot be decided, and is listed.
        """
        null = self.null
        lists = self._screened(null)
        if lists[1]:
            self._likely = lists[1][0].candidate
        if self.best.is_complete and self.best is not null:
            self._fit_alone(self._of_each_kind(lists[0]))
            return
        chosen = self._chosen(lists, null, FITTED_FIRST, choosy=False)
        self._fit_alone(chosen)
        if null.is_complete and self.best is null:
            return
        others: dict[Candidate, list[ScreenedCandidate]] = {}
        for promise in (one for promises in lists for one in promises if one.absorbed):
            others.setdefault(promise.candidate, []).append(promise)
        others |= {one: promises for one, promises in self._of_each_kind(lists[0]).items() if one not in others}
        self._fit_alone({one: promises for one, promises in others.items() if one not in chosen})
        if null.astray:
            self._bring_back(lists[0])

    def _bring_back(self, promises: Sequence[ScreenedCandidate]) -> None:
        """Fit alone, from the build, the effects that promise most if all misfit is noise.

        What is missing has led the constants far away, and what they have absorbed promises hardly anything there; by
        priors alone, as where the misfit says little, effects come first that bring them back. A capacitance of a
        twentieth of the disk's was the first of all, promised less than two nats, and gained fifty.
        """
        null = self.null
        back = [one for one in promises[:FITTED_ASTRAY] if self._still_astray(null, one.candidate)]
        self.fit([self._from_the_build(null, one.candidate, one.start) for one in back])

    def _fit_alone(self, chosen: Mapping[Candidate, Sequence[ScreenedCandidate]]) -> None:
        """Fit each of these effects alone, from plain least squares and, if that has led nowhere, from the null's."""
        self.progress(f"trying {len(chosen)} effects")
        null = self.null
        plans = [plan for one, promises in chosen.items() for plan in self._plans(null, one, promises)]
        self.fit(plans[:AHEAD])
        self.fit(plans[AHEAD:])
        if null.is_complete:
            return  # it is the minimum of plain least squares, from which these have started
        lost = [promises[0] for one, promises in chosen.items() if self._lost(null, one)]
        if self.best.fit.shortfall == 0:
            lost = [promise for promise in lost if not promise.absorbed]  # it adds nothing to the null near its minimum
        self.fit([self._near(null, promise, null) for promise in lost])

    def _of_each_kind(self, promises: Sequence[ScreenedCandidate]) -> dict[Candidate, list[ScreenedCandidate]]:
        """Return the most promising place of each effect that may explain as much as the best hypothesis."""
        best = self.best
        if best.fit.shortfall == 0:
            if not best.effects:
                return {}
            left = beside(best.effects, [one.candidate for one in promises])
            alike = {
                found.candidate
                for effect in best.effects
                for found in resembling(self.problem, best, effect, self.null, left)
                if found.gain > RESEMBLING
            }
            promises = [one for one in promises if one.candidate in alike]
        first: dict[str, ScreenedCandidate] = {}
        for promise in promises:
            first.setdefault(promise.candidate.effect.name, promise)
        return {promise.candidate: [promise] for promise in first.values()}

    def grow(self, parent: Hypothesis, most: int, like: Hypothesis | None = None) -> None:
        """Fit the most promising candidates beside the effects of a hypothesis.

        `like`: the hypothesis that the parent lacks an effect of. One of them may then explain as much as that effect,
        although none promises it from where the constants of the parent are: fits start from those of `like`, too.
        """
        self._grown.add(parent.key)
        lists = self._screened(parent)
        # What brings constants back that are astray gains prior probability, which counts in full: however little.
        chosen = self._chosen(lists, parent, most, choosy=not parent.astray)
        if like is not None:
            chosen = {**self._chosen(lists, parent, most, choosy=False), **chosen}
        tried = {**{one.candidate: [one] for one in self._as_noise(lists[0], parent)}, **chosen}
        names = ", ".join(one.effect.name for one in parent.effects)
        self.progress(f"trying {len(tried)} effects beside {names}")
        self.fit([self._near(like or parent, promise, parent) for p in tried.values() for promise in _apart(p)])
        # What promises much where the misfit counts as noise may need constants that are not near these.
        far = {promise.candidate for promise in lists[0] if promise.gain > SOFT}
        lost = {one: promises for one, promises in chosen.items() if one in far and self._lost(parent, one)}
        astray = [promises[0] for one, promises in chosen.items() if parent.astray and self._still_astray(parent, one)]
        self.fit([self._from_the_build(parent, promise.candidate, promise.start) for promise in astray])
        # each of two effects that move much hides what the other would promise
        if parent.strained or (len(parent.effects) == 1 and parent.fit.shortfall > NEAR):
            alone = self._best_alone(parent)
            self.fit([self._from_the_build(parent, one.effects[0], one.values, (one.fit.sizes,)) for one in alone])
        self.fit([plan for one, promises in lost.items() for plan in self._plans(parent, one, promises, like)])

    def _as_noise(self, promises: Sequence[ScreenedCandidate], parent: Hypothesis) -> Sequence[ScreenedCandidate]:
        """Return what promises most where all misfit is noise, if the best hypothesis is astray; else nothing."""
        if parent is not self.best or parent.fit.shortfall <= NEAR:
            return ()
        return [one for one in promises[:FITTED_ASTRAY] if one.gain > WORTH]

    def _screened(self, parent: Hypothesis) -> tuple[list[ScreenedCandidate], ...]:
        """Return the lists of what the candidates promise that have not been tried beside a hypothesis."""
        lists = screened(self.problem, parent, self._beside(parent), self.jobs)
        for promise in lists[0]:
            self.twins[promise.candidate] = promise.twins
        return lists

    def _lost(self, parent: Hypothesis, one: Candidate) -> bool:
        """Return whether one more effect has not improved a hypothesis."""
        made = self.found.get(frozenset((*parent.effects, one)))
        return made is None or made.log_weight < parent.log_weight

    def _still_astray(self, parent: Hypothesis, one: Candidate) -> bool:
        """Return whether the constants are astray with one more effect, too."""
        made = self.found.get(frozenset((*parent.effects, one)))
        return made is None or made.astray

    def _from_the_build(
        self, parent: Hypothesis, effect: Candidate, start: Mapping[str, float], sizes: tuple[ErrorSizes, ...] = ()
    ) -> Plan:
        """Return the start of a fit from the build's values: the way there from the parent's may lead over a hill.

        `start`: values of the effect's parameters; others do not count.
        """
        own = {name: start[name] for name in effect.parameters if name in start}
        values = {**self.problem.model.as_stated(parent.values), **own}
        several = tuple(dict.fromkeys((parent.fit.sizes, *sizes)))
        return Plan((*parent.effects, effect), values, several, near=True, rounds=5)

    def _best_alone(self, parent: Hypothesis) -> list[Hypothesis]:
        """Return the best hypotheses of one effect that has not been tried beside those of another hypothesis.

        Each of two large effects leads constants, or errors of the instrument, to where the other promises nothing.
        What they explain alone tells of both.
        """
        possible = self._beside(parent)
        alone = [one for one in self.ranked if len(one.effects) == 1 and one.effects[0] in possible]
        return [one for one in alone if one.log_evidence > self.null.log_evidence][:SUBSTITUTES]

    def _near(self, near: Hypothesis, promise: ScreenedCandidate, parent: Hypothesis) -> Plan:
        """Return the start of a fit with one more effect from the minimum without it, or from another one near it."""
        return Plan(
            (*parent.effects, promise.candidate),
            {**near.values, **promise.start},
            tuple(dict.fromkeys((near.fit.sizes, parent.fit.sizes))),
            near=True,
            rounds=2,
            about=near.fit.minimum.corrections,
        )

    def _chosen(
        self, lists: Sequence[Sequence[ScreenedCandidate]], parent: Hypothesis, most: int, *, choosy: bool
    ) -> dict[Candidate, list[ScreenedCandidate]]:
        """Return the first candidates of all lists in turn; `choosy`: those that would count beside what is missing."""
        chosen: dict[Candidate, list[ScreenedCandidate]] = {}
        # a residual that usual errors explain is no noise, unless they do so only from constants that are astray
        as_noise = parent.fit.shortfall > 0 or parent.astray
        least_gains = (SOFT if as_noise else np.inf, WORTH, WORTH, WORTH)
        for rank in range(max(map(len, lists))):
            for promises, least in zip(lists, least_gains, strict=True):
                if rank >= len(promises) or promises[rank].gain < least or len(chosen) >= most:
                    continue
                gain = promises[rank].gain
                left = parent.fit.shortfall - gain
                one_nat = coarseness(left, parent.fit.exact)
                enough = max(one_nat, WORTH * coarseness(left, exact=True))
                if not choosy or promises[rank].absorbed or gain > enough:
                    chosen.setdefault(promises[rank].candidate, []).append(promises[rank])
        return chosen

    def _plans(
        self, parent: Hypothesis, one: Candidate, promises: Sequence[ScreenedCandidate], like: Hypothesis | None = None
    ) -> list[Plan]:
        near = tuple(dict.fromkeys((parent, like or parent)))
        sizes = (ErrorSizes(colour=parent.fit.sizes.colour), *(other.fit.sizes for other in near))
        bases: list[Mapping[str, float]] = [other.values for other in near]
        if parent.astray:  # by what is missing; an effect alone may not bring its constants back
            bases.append(self.problem.model.as_stated(parent.values))
        large = next((its.starts[1:] for its in promises if its.absorbed), list[dict[str, float]]())
        plans: list[Plan] = []
        for promise in _apart(promises):
            first, *others = ({**base, **start} for base in bases for start in (promise.start, *large))
            plans.append(Plan((*parent.effects, one), first, sizes, rounds=2, others=tuple(others)))
        return plans

    def thin(self, one: Hypothesis) -> None:
        """Remove effects from the best hypothesis one by one while that improves it."""
        rests = [tuple(other for other in one.effects if other is not effect) for effect in one.effects]
        alone = [(effect,) for effect in one.effects if len(rests) > 2 and frozenset((effect,)) not in self.found]
        self.fit([Plan(rest, one.values, (one.fit.sizes,), near=True) for rest in (*rests, *alone)])
        self.polish()
        first = self.probable[0]
        if first is not one and len(first.effects) < len(one.effects):
            self.thin(first)


def _apart(promises: Sequence[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """Return the first start and, if the effect resonates, those at other frequencies: each is a valley of its own."""
    kept: list[ScreenedCandidate] = []
    for promise in promises:
        at = [promise.start[name] for name in promise.candidate.resonance_parameters]
        before = [[one.start[name] for name in one.candidate.resonance_parameters] for one in kept]
        if not kept or all(any(abs(f / g - 1) > _APART for f, g in zip(at, other, strict=True)) for other in before):
            kept.append(promise)
    return kept
