"""Search among hypotheses without any error but white noise, as simulated and very good recordings need none.

Errors of instrument and model may describe a small effect so well that it seems to explain nothing beside them. Where
effects alone explain a recording to its noise, only a search without errors finds them.
"""

from collections.abc import Mapping, Sequence
from functools import partial

from ...engine.on_cores import on_cores
from ...error_model.error_sizes import ErrorSizes, Value
from ...error_model.marginal_fit import Minimum
from ..decision_rules import EXACT_FIRST, EXACT_LATER, EXACT_PARENTS, MOST, NEAR, UNFINISHED, WORTH
from ..hypotheses.hypothesis import Hypothesis, at_minimum, beside, computed, end_of, fitted
from ..hypotheses.problem import Candidate, Problem
from .screening import screened

_EXACT = (ErrorSizes(),)


def exact_hypotheses(
    problem: Problem, candidates: Sequence[Candidate], start: Hypothesis, jobs: int = 1
) -> list[Hypothesis]:
    """Return the hypotheses without errors that are about as probable as `start`, which has errors, or more.

    Effects are added to those of `start` one by one as long as that helps, provided that its errors leave nothing but
    noise: otherwise something is missing that stands out beside them.
    """
    hidden = start.fit.shortfall == 0 and not start.fit.sizes.exact
    begun = _fitted(problem, start.effects, start.values) if hidden else None
    if begun is None:
        return []
    found, best = {begun.key: begun}, begun
    if begun.astray and begun.fit.shortfall > 0:  # what is missing has led its constants to where nothing promises it
        best = _take(found, _extended(problem, start, candidates, jobs))
    # one that is continued may become less probable than the one that was the best before: each is extended once
    extended: set[frozenset[Candidate]] = set()
    while best.key not in extended:
        before, missing = best, best.fit.shortfall
        for rank, parent in enumerate(_parents(found, best, extended)):
            continued = _continued(problem, parent)
            extended.add(parent.key)
            found[parent.key] = continued
            best = _take(found, _extended(problem, continued, candidates, jobs, hoping=rank == 0))
        if _hopeless(best, missing - best.fit.shortfall) or (
            missing == 0 and best.log_weight < before.log_weight + WORTH
        ):
            break  # more will not be enough, or there was nothing left to explain
    return [one for one in found.values() if one.log_weight > start.log_weight - NEAR]


def _parents(
    found: Mapping[frozenset[Candidate], Hypothesis], best: Hypothesis, extended: set[frozenset[Candidate]]
) -> list[Hypothesis]:
    """Return the hypotheses to extend: the best and, while it leaves more than noise, its rivals of as many effects.

    What explains most alone need not be part of what explains all: a resistance takes the place of a lead, until the
    losses are told that are beside it.
    """
    if best.fit.shortfall == 0:
        return [best]
    rivals = (one for one in found.values() if len(one.effects) == len(best.effects))
    first = sorted(rivals, key=lambda one: -one.log_weight)[:EXACT_PARENTS]
    return [one for one in first if one.key not in extended]


def _take(found: dict[frozenset[Candidate], Hypothesis], more: Sequence[Hypothesis]) -> Hypothesis:
    """Add hypotheses to those found, unless one of the same effects is better; return the best of all."""
    for made in more:
        if made.key not in found or made.log_weight > found[made.key].log_weight:
            found[made.key] = made
    return max(found.values(), key=lambda one: one.log_weight)


def _continued(problem: Problem, one: Hypothesis) -> Hypothesis:
    """Return a hypothesis whose fit was continued as long as it improved."""
    for _ in range(UNFINISHED):
        again = _fitted(problem, one.effects, one.values, near=True)
        if again is None or again.fit.value.here > one.fit.value.here - 1:
            break
        one = again
    return one


def _hopeless(one: Hypothesis, gain: float) -> bool:
    """Return whether more would be missing after as many further effects as there may be, if each gained this much."""
    return one.fit.shortfall > (MOST - len(one.effects)) * gain


def _extended(
    problem: Problem, parent: Hypothesis, candidates: Sequence[Candidate], jobs: int, *, hoping: bool = True
) -> list[Hypothesis]:
    """Return the fits of the most promising candidates beside a hypothesis.

    `hoping`: where none promises enough, those that constants absorb are fitted, as their promise says little.
    """
    if len(parent.effects) == MOST:
        return []
    as_noise, *_, as_exact = screened(problem, parent, beside(parent.effects, candidates, exact=True), jobs)
    promises = as_exact if parent.fit.sizes.exact else as_noise
    most = EXACT_LATER if parent.effects else EXACT_FIRST
    hopeless = not promises or _hopeless(parent, promises[0].gain)
    if hopeless and not (parent.effects and hoping):
        return []
    missing = parent.fit.shortfall > 0 or not parent.fit.sizes.exact  # its errors hide what is
    chosen = [one for one in promises if one.absorbed and missing]
    chosen += [one for one in promises[:most] if one.gain > WORTH and one not in chosen and not hopeless]
    starts = [(one.candidate, start) for one in chosen for start in (one.starts[:1] if hopeless else one.starts)]
    ends = on_cores([partial(_end, problem, parent, one, start) for one, start in starts], jobs)
    return [
        at_minimum(problem, (*parent.effects, one), {**parent.values, **start}, *end)
        for (one, start), end in zip(starts, ends, strict=True)
        if end is not None
    ]


def _end(problem: Problem, parent: Hypothesis, one: Candidate, start: dict[str, float]) -> tuple[Minimum, Value] | None:
    return end_of(_fitted(problem, (*parent.effects, one), {**parent.values, **start}, near=True, compared=False))


def _fitted(
    problem: Problem,
    effects: tuple[Candidate, ...],
    values: Mapping[str, float],
    *,
    near: bool = False,
    compared: bool = True,
) -> Hypothesis | None:
    """Return the fit; None if it cannot be computed."""
    return computed(
        lambda: fitted(problem, effects, values, _EXACT, near=near, rounds=1, fixed=True, compared=compared)
    )
