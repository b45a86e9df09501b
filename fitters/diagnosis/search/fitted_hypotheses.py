"""All hypotheses that a search has fitted: the better fit of each is kept, and those that matter are continued."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from weakref import WeakSet

import numpy as np

from ...engine.on_cores import on_cores
from ...error_model.error_sizes import ErrorSizes, Value
from ...error_model.marginal_fit import NEVER, Minimum
from ...interface import FitError
from ..decision_rules import BUDGET, CLASS_NATS, HELD_READY, LIKELY, NEAR, POLISHED, RECHECKED, UNFINISHED
from ..hypotheses.hypothesis import Hypothesis, at_minimum, computed, end_of, fitted, probabilities, temper_of
from ..hypotheses.problem import Candidate, Problem
from .plan import Plan


@dataclass(eq=False)
class FittedHypotheses:
    """Hypotheses by their sets of effects, with their probabilities."""

    problem: Problem
    progress: Callable[[str], None] = field(default=lambda _: None, kw_only=True)
    jobs: int = field(default=1, kw_only=True)
    """Number of processes that fit hypotheses at the same time. The result does not depend on it."""
    found: dict[frozenset[Candidate], Hypothesis] = field(
        default_factory=dict[frozenset[Candidate], Hypothesis], kw_only=True
    )
    _fine: set[frozenset[Candidate]] = field(default_factory=set[frozenset[Candidate]], kw_only=True)
    _continued: WeakSet[Hypothesis] = field(default_factory=WeakSet[Hypothesis], kw_only=True)
    _spent: int = field(default=0, kw_only=True)
    """Steps of all fits so far, times points."""

    @property
    def null(self) -> Hypothesis:
        """The hypothesis without effects, once it is fitted."""
        return self.found[frozenset()]

    @property
    def ranked(self) -> list[Hypothesis]:
        """The hypotheses, that of the largest evidence times prior odds first."""
        return sorted(self.found.values(), key=lambda one: -one.log_weight)

    @property
    def best(self) -> Hypothesis:
        """The hypothesis of the largest evidence, times prior odds."""
        return self.ranked[0]

    @property
    def temper(self) -> float:
        """How much ln evidence counts as one nat beside these hypotheses."""
        return temper_of(list(self.found.values()))

    @property
    def posterior(self) -> list[tuple[Hypothesis, float]]:
        """The hypotheses with their probabilities, for which evidence counts less where it is approximate; sorted."""
        ranked = self.ranked
        return sorted(zip(ranked, probabilities(ranked).tolist(), strict=True), key=lambda pair: -pair[1])

    @property
    def probable(self) -> list[Hypothesis]:
        """The hypotheses, the largest posterior probability first."""
        return [one for one, _ in self.posterior]

    def inclusion(self, names: Collection[str]) -> float:
        """Return the posterior probability that any of these effects is present, at whatever place."""
        return sum(part for one, part in self.posterior if any(its.effect.name in names for its in one.effects))

    def begin(self) -> Hypothesis:
        """Fit the hypothesis without effects, unless that was done before."""
        if frozenset() in self.found:
            return self.null
        null = fitted(self.problem, (), self.problem.values, near=True, rounds=5)
        self.found[null.key] = null
        return null

    def fit(self, plans: Sequence[Plan]) -> None:
        """Fit all these, and keep each hypothesis unless one of the same effects is better.

        A fit that would be the best one if it kept its promise goes on as long as that helps.
        """
        made = {k: one for k, one in enumerate(self._made(plans)) if one is not None}
        unfinished = made
        for _ in range(UNFINISHED):
            least = self.best.log_weight
            unfinished = {
                k: one
                for k, one in unfinished.items()
                if one.fit.promised > 0 and one.log_weight + one.fit.promised > least
            }
            if not unfinished:
                break
            again = self._made([_further(one) for one in unfinished.values()])
            further = {
                k: one
                for k, one in zip(unfinished, again, strict=True)
                if one is not None and one.log_weight > made[k].log_weight + CLASS_NATS
            }
            made, unfinished = made | further, further
        for one in made.values():
            self.take(one)
        for one in self.ranked[HELD_READY:]:
            one.fit.forget()

    def _made(self, plans: Sequence[Plan]) -> list[Hypothesis | None]:
        """Return the fits; None for each that cannot be computed."""
        hopeless = self._hopeless
        if self.jobs == 1:
            made = [self._fitted(plan, hopeless) for plan in plans]
        else:
            ends = on_cores([partial(self._end, plan, hopeless) for plan in plans], self.jobs)
            made = [None if end is None else self._at(plan, *end) for plan, end in zip(plans, ends, strict=True)]
        self._spent += self.problem.points * sum(one.fit.minimum.steps for one in made if one is not None)
        return made

    @property
    def exhausted(self) -> bool:
        """Whether the budget of the search is spent: what is left of it is not done."""
        return self._spent > BUDGET

    def _end(self, plan: Plan, hopeless: tuple[float, float]) -> tuple[Minimum, Value] | None:
        return end_of(self._fitted(plan, hopeless))

    def _at(self, plan: Plan, minimum: Minimum, value: Value) -> Hypothesis | None:
        return computed(lambda: at_minimum(self.problem, plan.effects, plan.values, minimum, value))

    def _fitted(self, plan: Plan, hopeless: tuple[float, float] = NEVER) -> Hypothesis | None:
        """Return the fit; None if it cannot be computed. `hopeless`: weights in which it is given up."""
        null = self.found.get(frozenset())
        return computed(
            lambda: fitted(
                self.problem,
                plan.effects,
                plan.values,
                plan.sizes if null is None else (*plan.sizes, null.fit.sizes),
                near=plan.near,
                rounds=plan.rounds,
                fixed=plan.fixed,
                others=plan.others,
                compared=plan.compared,
                about=plan.about,
                hopeless=hopeless if plan.effects else NEVER,
            )
        )

    @property
    def _hopeless(self) -> tuple[float, float]:
        """Weights in which a fit is given up: out of reach of the best one, but no longer far below the null.

        As long as it is, it has not even come to where its effects are absent, and how far it gets is not known.
        """
        reach = NEAR * self.temper
        return self.null.log_weight - reach, self.best.log_weight - reach

    def take(self, made: Hypothesis | None) -> None:
        """Keep a hypothesis unless one of the same effects is better."""
        if made is not None:
            known = self.found.get(made.key)
            if known is None or _better(made, known):
                self.found[made.key] = made

    def polish(self) -> None:
        """Continue the fits of the best hypotheses to convergence."""
        for _ in range(POLISHED):
            likely = [one for one in self.ranked[:POLISHED] if one.log_weight > self.best.log_weight - NEAR]
            unfinished = [one for one in self._promising() if not one.fit.converged]
            again = [one for one in dict.fromkeys((*likely, *unfinished)) if one.key not in self._fine]
            if not again:
                break
            self._fine.update(one.key for one in again)
            self._continued.update(one for one in again if not one.fit.sizes.exact)
            self.fit([Plan.after(one, _restart(one), rounds=4) for one in again])
        if self._may_be_exact(self.best):
            self.fit([Plan(self.best.effects, self.best.values, (ErrorSizes(),), near=True, fixed=True)])
        for _ in range(UNFINISHED):
            best = self.best
            if best.fit.converged or best in self._continued:
                break
            self._continued.add(best)
            exact = best.fit.sizes.exact  # a fit that chose errors again would end elsewhere
            self.fit([Plan.after(best, _restart(best), rounds=4, fixed=exact)])
            if abs(self.best.log_weight - best.log_weight) < CLASS_NATS:
                break

    def _may_be_exact(self, one: Hypothesis) -> bool:
        """Return whether a fit has errors that it may not need: without any, evidence counts in full."""
        if one.fit.sizes.exact:
            return False
        try:
            exact = one.fit.gram.value(ErrorSizes()).log_evidence
        except np.linalg.LinAlgError:
            return False
        return exact > one.fit.log_evidence - NEAR

    def without(self, one: Hypothesis, effect: Candidate) -> Hypothesis:
        """Return a hypothesis without one of its effects."""
        return self.of([other for other in one.effects if other is not effect], one)

    def of(self, effects: Sequence[Candidate], near: Hypothesis) -> Hypothesis:
        """Return the hypothesis with these effects; fit it, starting from another one, if that was not done before.

        Raises FitError if they cannot be fitted.
        """
        key, plan = frozenset(effects), Plan(tuple(effects), near.values, (near.fit.sizes,), compared=True)
        if key not in self.found:
            self.take(self._first((plan, replace(plan, near=True))))
        return self.found[key]

    def _first(self, plans: Sequence[Plan]) -> Hypothesis:
        """Return the first of these fits of the same effects that can be computed. Raises FitError if none can."""
        made = next((one for plan in plans if (one := self._fitted(plan)) is not None), None)
        if made is None:
            names = ", ".join(one.effect.name for one in plans[0].effects) or "no effect"
            raise FitError(f"the recordings cannot be fitted with {names}: the model is not finite near their values")
        return made

    def fit_again(self, problem: Problem) -> None:
        """Fit the best hypotheses again, with another error model."""
        again = self._take_over(problem)
        # where a fit ended says little of how well it will describe these recordings
        best = [self.found[one.key] for one in again[:UNFINISHED] if one.key in self.found]
        near = dict.fromkeys((*best, *self._in_reach(self.ranked)))
        self._follow(near)

    def weigh_again(self, problem: Problem) -> None:
        """Weigh the best hypotheses by other recordings of the same device, which say nearly the same.

        Their fits end where they ended, within what the expansion there promises; only where that may count, for the
        best one, and where evidence counts in full, they are continued. If one of these then leaves all others behind,
        by errors of sizes that fewer points did not show, the others are continued with such errors, too.
        """
        self._take_over(problem)
        likely = self._in_reach(self.ranked, LIKELY)
        near = [one for one in likely if one is self.best or one.fit.promised > 0 or one.fit.sizes.exact]
        self._fine.update(self.found)
        before = self.best.log_weight
        self._follow(near)
        if self.best.log_weight > before + LIKELY * self.temper:
            best = self.best
            others = [self.found[one.key] for one in likely if one.key != best.key]
            self.fit([Plan.after(one, (best.fit.sizes, one.fit.sizes)) for one in others])

    def _follow(self, some: Iterable[Hypothesis]) -> None:
        """Continue these fits, but that without effects."""
        self.fit([Plan.after(one, (one.fit.sizes, ErrorSizes())) for one in some if one.effects])

    def _take_over(self, problem: Problem) -> list[Hypothesis]:
        """Look at the best hypotheses until now with another problem, that without effects fitted anew; return them."""
        self.problem = problem
        null, again = self.null, [one for one in self.ranked[:RECHECKED] if one.effects]
        sizes = null.fit.sizes, ErrorSizes()
        after, anew = Plan.after(null, sizes), Plan((), null.values, sizes, compared=True)
        self.found = {null.key: self._first((after, replace(anew, near=True), anew))}
        for one in again:
            self.take(self._taken_over(one))
        return again

    def _taken_over(self, one: Hypothesis) -> Hypothesis | None:
        """Return a hypothesis where its fit ended, with other recordings or another error model.

        Its errors, if it has any, may have other sizes there, the colour of noise above all: means of groups are nearly
        white.
        """
        own, null = one.fit.sizes, self.null.fit.sizes
        coloured = own.at("colour", null.colour)
        anew = () if own.exact else (coloured, coloured.at("rho", null.rho))
        return computed(lambda: at_minimum(self.problem, one.effects, one.values, one.fit.minimum, anew=anew))

    def _promising(self) -> list[Hypothesis]:
        """Return the hypotheses in reach that would be best if their fits kept their promises."""
        most = sorted(self.found.values(), key=lambda one: -one.log_weight - one.fit.promised)
        return self._in_reach(most[:UNFINISHED])

    def _in_reach(self, some: Sequence[Hypothesis], within: float = NEAR) -> list[Hypothesis]:
        """Return those of some hypotheses that are not impossible beside the best one, or may not be after a refit."""
        least = self.best.log_weight - within * self.temper
        return [one for one in some if one.log_weight + one.fit.promised > least]


def _better(made: Hypothesis, known: Hypothesis) -> bool:
    """Return whether a fit replaces another one with the same effects; with the same errors the lower one does."""
    if made.fit.sizes == known.fit.sizes:
        return made.fit.value.here < known.fit.value.here
    return made.log_weight > known.log_weight


def _further(one: Hypothesis) -> Plan:
    """Return one more descent of a fit."""
    return replace(Plan.after(one, (one.fit.sizes,), rounds=1), compared=False)


def _restart(one: Hypothesis) -> tuple[ErrorSizes, ...]:
    """Return the sizes of errors from which a fit is continued: other ones if it has not converged with its own."""
    own = one.fit.sizes
    return (own,) if one.fit.converged else (own, ErrorSizes(colour=own.colour))
