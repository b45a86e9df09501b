"""The search: nothing, each effect, pairs and greedy further ones, look-alikes instead; all by one log evidence."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ....models.base.errors import PzctlError
from ...error_model.error_sizes import ErrorSizes
from ..decision_rules import (
    FITTED_FIRST,
    FITTED_LATER,
    MOST,
    NEAR,
    PARENTS,
    POLISHED,
    SOFT,
    SUBSTITUTES,
    UNFINISHED,
    WORTH,
)
from ..hypotheses.hypothesis import Hypothesis, coarseness, fitted, probabilities
from ..hypotheses.problem import Candidate, Problem
from .screening import ScreenedCandidate, screened


@dataclass(eq=False)
class GreedySearch:
    """All hypotheses that were fitted."""

    problem: Problem
    candidates: tuple[Candidate, ...]
    progress: Callable[[str], None] = lambda _: None
    found: dict[frozenset[Candidate], Hypothesis] = field(default_factory=dict[frozenset[Candidate], Hypothesis])
    twins: dict[Candidate, tuple[Candidate, ...]] = field(default_factory=dict[Candidate, tuple[Candidate, ...]])
    _likely: Candidate | None = None
    _fine: set[frozenset[Candidate]] = field(default_factory=set[frozenset[Candidate]])
    _grown: set[frozenset[Candidate]] = field(default_factory=set[frozenset[Candidate]])

    @property
    def ranked(self) -> list[Hypothesis]:
        """The hypotheses, the most probable first."""
        return sorted(self.found.values(), key=lambda one: -one.log_weight)

    @property
    def best(self) -> Hypothesis:
        """The most probable."""
        return self.ranked[0]

    def begin(self) -> Hypothesis:
        """Fit without effects."""
        null = fitted(self.problem, (), self.problem.values, near=True, rounds=5)
        self.found[null.key] = null
        return null

    def run(self) -> Hypothesis:
        """Look for what explains the recordings."""
        null = self.begin()
        self.grow(null, FITTED_FIRST)
        self.polish()
        for _ in range(MOST - 1):
            before = self.best
            for parent in self._parents():
                self.grow(parent, FITTED_LATER)
            self.polish()
            if self.best is before:
                break
        self.relocate(self.best)
        self.thin(self.best)
        self.substitute(self.best)
        return self.best

    def substitute(self, one: Hypothesis) -> None:
        """Fit the best with another effect in place of each: what looks alike, and what was never tried beside it."""
        if len(one.effects) < 2:
            return
        for effect in one.effects:
            rest = self.without(one, effect)
            self.grow(rest, SUBSTITUTES)
        self.polish()
        if self.best is not one and len(self.best.effects) >= len(one.effects):
            self.substitute(self.best)

    def relocate(self, one: Hypothesis) -> None:
        """Fit the best with each of its effects at the other places where that could be."""
        for effect in one.effects:
            twins = {(twin.where, twin.steps) for twin in self.twins.get(effect, ())}
            rest = tuple(other for other in one.effects if other is not effect)
            for other in self.candidates:
                if other.effect is not effect.effect or other in one.effects or (other.where, other.steps) in twins:
                    continue
                if frozenset((*rest, other)) in self.found:
                    continue
                there = {new: one.values[old] for new, old in zip(other.parameters, effect.parameters, strict=True)}
                self._fit((*rest, other), {**one.values, **there}, (one.fit.sizes,))
        self.polish()

    def _parents(self) -> list[Hypothesis]:
        """Return what is to be grown: the best, and the best with the effect that a good bench would show.

        Where even the best leaves more than the usual errors, also others that may yet come out ahead.
        """
        short = self.best.fit.shortfall
        within = NEAR * coarseness(short)
        ahead = self.ranked[: PARENTS if short > NEAR else 1]
        near = [one for one in ahead if one.log_weight > self.best.log_weight - within]
        likely = [one for one in self.ranked if self._likely in one.effects][:1]
        return [
            one
            for one in dict.fromkeys((*near, *likely))
            if one.effects and len(one.effects) < MOST and one.key not in self._grown
        ]

    def grow(self, parent: Hypothesis, most: int) -> None:
        """Fit what promises most beside a hypothesis."""
        self._grown.add(parent.key)
        taken = {(one.effect.name, one.where) for one in parent.effects}
        left = [
            one
            for one in self.candidates
            if (one.effect.name, one.where) not in taken and frozenset((*parent.effects, one)) not in self.found
        ]
        lists = screened(self.problem, parent, left)
        for promise in lists[0]:
            self.twins[promise.candidate] = promise.twins
        if not parent.effects and lists[1]:
            self._likely = lists[1][0].candidate
        chosen: dict[Candidate, list[ScreenedCandidate]] = {}
        shortfall = parent.fit.shortfall
        for rank in range(len(left)):
            for promises, least in zip(lists, (SOFT, WORTH, WORTH), strict=True):
                if rank >= len(promises) or promises[rank].gain < least or len(chosen) >= most:
                    continue
                if not parent.effects or promises[rank].gain > WORTH * coarseness(shortfall - promises[rank].gain):
                    chosen.setdefault(promises[rank].candidate, []).append(promises[rank])
        for one, promises in chosen.items():
            self.progress(f"trying {one.effect.name} at {one.where}")
            self._try(parent, one, promises)

    def _try(self, parent: Hypothesis, one: Candidate, promises: Sequence[ScreenedCandidate]) -> None:
        effects = (*parent.effects, one)
        starts = (ErrorSizes(colour=parent.fit.sizes.colour),)
        for promise in promises[:1]:
            self._fit(effects, {**parent.values, **promise.start}, starts, rounds=2)

    def _fit(
        self,
        effects: tuple[Candidate, ...],
        values: Mapping[str, float],
        starts: Sequence[ErrorSizes],
        *,
        near: bool = False,
        rounds: int = 3,
    ) -> None:
        """Fit these effects from `values`, and keep the hypothesis unless one of the same effects is better.

        What cannot be computed there, physics or covariance, is none.
        """
        try:
            self._take(fitted(self.problem, effects, values, starts, near=near, rounds=rounds, fast=self._fast))
        except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
            return

    def _take(self, made: Hypothesis) -> None:
        if np.isfinite(made.log_weight):
            known = self.found.get(made.key)
            if known is None or made.log_weight > known.log_weight:
                self.found[made.key] = made

    @property
    def _fast(self) -> bool:
        """Whether the instrument's error may be fast: where it need not be with nothing explained, it never must."""
        null = self.found.get(frozenset())
        return null is None or null.fit.sizes.fast > 0

    def polish(self) -> None:
        """Fit those again that are near the best, to the end."""
        for _ in range(POLISHED):
            likely = [one for one in self.ranked[:POLISHED] if one.log_weight > self.best.log_weight - NEAR]
            unfinished = [one for one in self.ranked[:UNFINISHED] if not one.fit.converged]
            again = [one for one in dict.fromkeys((*likely, *unfinished)) if one.key not in self._fine]
            if not again:
                break
            for one in again:
                self._fine.add(one.key)
                start = (one.fit.sizes,) if one.fit.converged else (ErrorSizes(colour=one.fit.sizes.colour),)
                self._fit(one.effects, one.values, start, near=True, rounds=4)

    def without(self, one: Hypothesis, effect: Candidate) -> Hypothesis:
        """Return a hypothesis without one of its effects."""
        return self.of([other for other in one.effects if other is not effect], one)

    def of(self, effects: Sequence[Candidate], near: Hypothesis) -> Hypothesis:
        """Return the hypothesis of these effects, fitted from another one where it has not been yet."""
        key = frozenset(effects)
        if key not in self.found:
            self._take(fitted(self.problem, tuple(effects), near.values, (near.fit.sizes,), fast=self._fast))
        return self.found[key]

    def thin(self, one: Hypothesis) -> None:
        """Fit the best without each of its effects, as long as one less is better."""
        for effect in one.effects:
            rest = tuple(other for other in one.effects if other is not effect)
            self._fit(rest, one.values, (one.fit.sizes,), near=True)
        self.polish()
        if self.best is not one and len(self.best.effects) < len(one.effects):
            self.thin(self.best)

    def inclusion(self, names: Collection[str]) -> float:
        """Return the posterior probability that any of these effects is there, wherever it is."""
        parts = probabilities(self.ranked).tolist()
        return sum(
            part
            for one, part in zip(self.ranked, parts, strict=True)
            if any(effect.effect.name in names for effect in one.effects)
        )
