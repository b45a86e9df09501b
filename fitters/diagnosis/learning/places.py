"""The place of the missing physics: where a smooth correction explains most, by evidence."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ....models.effects import Device
from ....models.effects.learned.corrections import INSTRUMENT, Place, places
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.smooth_correction import SmoothCorrection
from ....models.stack import Stack
from ...engine.on_cores import on_cores
from ...engine.recording import recorded_band
from ...error_model.error_columns import stack_of
from ...error_model.error_sizes import ErrorSizes, chosen
from ...error_model.marginal_fit import ORDER, Minimum
from ...interface import UNCOMPUTABLE
from ..hypotheses.candidates import step_groups
from ..hypotheses.condensed_recordings import condensed
from ..hypotheses.hypothesis import Hypothesis, at_minimum, fitted, marginal_of
from ..hypotheses.instrument_artefacts import InstrumentArtefact
from ..hypotheses.problem import Candidate, Problem
from .drawn_corrections import PlacedCorrection, drawn
from .usual_fits import usually_fitted

PLACES = 4
"""Budget: number of places at which a correction is fitted; the others explain less to first order."""
SIZES = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)
"""Prior standard deviations of a correction, equally probable."""
_STEP = 0.5
"""Fraction of a linear step from which a nonlinear fit starts: a full step overshoots at a resonance."""


def placed_corrections(
    problem: Problem,
    parent: Hypothesis,
    progress: Callable[[str], None] = lambda _: None,
    jobs: int = 1,
    thorough: bool = True,
) -> tuple[PlacedCorrection, ...]:
    """Return a smooth correction at each place in addition to a hypothesis, most probable first.

    It is the same in all recordings that show the place: that is what tells places apart. No other smooth error of the
    constants is allowed with it: the question is which single place explains the residual.
    `jobs`: number of processes. `thorough`: whether each correction is fitted to all points, from several starts and
    without errors of the effects' formulas, as a law that is learned from it needs; otherwise to condensed recordings,
    from its first-order solution alone.
    """
    try:
        if not thorough:
            problem, parent = _condensed(problem, parent)
        alone = usually_fitted(problem, parent.effects, parent.values, (parent.fit.sizes,), barred=_barred(thorough))
    except UNCOMPUTABLE:
        return ()
    everywhere = all_places(problem)
    progress(f"trying a correction of each of {len(everywhere)} places")
    trials = on_cores([partial(_screened, problem, parent, *place) for place in everywhere], jobs)
    screened = [(trial, *place) for trial, place in zip(trials, everywhere, strict=True) if trial is not None]
    screened.sort(key=lambda trial: -trial[0].log_evidence)
    fits = _fitted(problem, parent, [trial for trial, *_ in screened[:PLACES]], jobs, thorough)
    found: list[tuple[Place, tuple[str, ...], Hypothesis]] = []
    for made, (_, place, steps) in zip(fits, screened, strict=False):
        if made is not None and not _same(made, found):
            found.append((place, steps, made))
    if not found:
        return ()
    best = max((hypothesis for *_, hypothesis in found), key=lambda one: one.log_evidence)
    temper = best.coarseness
    prior = [_log_odds(place) - float(np.log(len(found))) for place, *_ in found]
    with_it = [one.log_evidence + own for own, (*_, one) in zip(prior, found, strict=True)]
    weights = np.array([alone.log_evidence, *with_it]) / temper
    part = np.exp(weights - np.max(weights))
    shares = (part / np.sum(part)).tolist()[1:]
    shown = [drawn(problem, *one, share) for one, share in zip(found, shares, strict=True)]
    return tuple(sorted(shown, key=lambda one: -one.probability))


def _condensed(problem: Problem, parent: Hypothesis) -> tuple[Problem, Hypothesis]:
    """Return the problem and a hypothesis with fewer points."""
    few = condensed(problem, parent.fit.sizes.colour)
    if few is problem:
        return problem, parent
    return few, fitted(few, parent.effects, parent.values, (parent.fit.sizes,), near=True, compared=False)


def all_places(problem: Problem, *, loads: bool = False) -> tuple[tuple[Place, tuple[str, ...]], ...]:
    """Return every place at which a correction can act, with the steps whose recordings show it.

    What is inside of a device is the same in all steps that have it; the leads can be the same in all steps, differ
    from one step on, or in one; the front of a step is buried by the next. What the instrument reads is the same for
    every device, so it is a place only if several steps were recorded: of a single device, its error cannot be told
    from one of the device. `loads`: with the factors of loads, which a smooth correction needs not: a smooth factor of
    a load is a smooth impedance added to it.
    """
    own = [(place, steps) for place, steps in _places(problem).items() if loads or place.quantity != "load"]
    found = [(place, group) for place, steps in own for group in step_groups(place.where, steps)]
    return (*found, (INSTRUMENT, problem.steps)) if len(problem.steps) > 1 else tuple(found)


def _log_odds(place: Place) -> float:
    """Return ln prior odds of a place relative to others: faults of an instrument are rarer than missing physics."""
    return float(np.log(InstrumentArtefact.odds)) if place == INSTRUMENT else 0.0


def number_at(problem: Problem, parent: Hypothesis, where: str) -> int:
    """Return the number that a further law at a place would have, after those of a hypothesis and of the build."""
    return 1 + max((one.number for one, _ in learned_in(problem, parent) if one.place.where == where), default=0)


def learned_in(problem: Problem, parent: Hypothesis) -> list[tuple[LearnedLaw, tuple[str, ...]]]:
    """Return the laws of the build and of a hypothesis, with the steps that have them."""
    devices = [(one.model, one.step) for one in problem.recordings if isinstance(one.model, Device)]
    everything = [(added.effect, (step,)) for device, step in devices for added in device.added]
    everything += [(one.effect, one.steps) for one in parent.effects]
    return [(effect, steps) for effect, steps in everything if isinstance(effect, LearnedLaw)]


def _places(problem: Problem) -> dict[Place, tuple[str, ...]]:
    """Return every place with the steps whose recordings show it."""
    steps: dict[Place, list[str]] = {}
    for recording in problem.recordings:
        device = recording.model
        if not isinstance(device, Device) or not isinstance(device.bare, Stack):
            continue
        for place in places(device.bare):
            own = steps.setdefault(place, [])
            if recording.step not in own:
                own.append(recording.step)
    return {place: tuple(own) for place, own in steps.items()}


def _same(made: Hypothesis, found: list[tuple[Place, tuple[str, ...], Hypothesis]]) -> bool:
    """Return whether corrections of both faces are equivalent: a symmetric device has only one place."""
    own = made.effects[-1]
    return any(
        place.quantity == "impedance"
        and own.where.startswith("face:")
        and abs(other.log_evidence - made.log_evidence) < TWINS
        for place, _, other in found
    )


TWINS = 0.1
"""Difference of ln evidence below which the corrections of both faces are equivalent."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """A correction to first order."""

    candidate: Candidate
    log_evidence: float
    sizes: ErrorSizes
    """Sizes of the remaining errors."""
    start: dict[str, float]
    """Start of a fit."""


@dataclass(frozen=True, eq=False)
class _Plan:
    """Start of a fit."""

    effects: tuple[Candidate, ...]
    values: Mapping[str, float]
    sizes: ErrorSizes
    near: bool
    barred: tuple[str, ...]
    """Parts of the error that the fit has none of."""


def _barred(thorough: bool) -> tuple[str, ...]:
    """Return the parts of the error that would absorb what a correction describes."""
    return ("tau", "shape") if thorough else ("tau",)


def _screened(problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...]) -> _Trial | None:
    """Return the best size of a correction to first order."""
    stack = stack_of(problem.recordings[-1].model)
    low, high = recorded_band(problem.recordings)
    trials: list[_Trial] = []
    for size in SIZES:
        number = number_at(problem, parent, place.where)
        one = candidate(SmoothCorrection(place, size, (low, high), stack, number), steps, stack)
        try:
            trials.append(_linear(problem, parent, one))
        except UNCOMPUTABLE:
            continue
    return max(trials, key=lambda trial: trial.log_evidence, default=None)


def _fitted(
    problem: Problem, parent: Hypothesis, trials: Sequence[_Trial], jobs: int, thorough: bool
) -> list[Hypothesis | None]:
    """Return the best fit of each correction; None where there is none."""
    plans = [
        _Plan((*parent.effects, trial.candidate), values, sizes, near, _barred(thorough))
        for trial in trials
        for values, near in (((dict(parent.values), False),) if thorough else ()) + ((trial.start, True),)
        # one by one, because each leads to a different minimum
        for sizes in dict.fromkeys((trial.sizes.at("tau", 0.0), parent.fit.sizes.at("tau", 0.0)))
    ]
    ends = on_cores([partial(_end, problem, plan) for plan in plans], jobs)
    best: dict[Candidate, tuple[float, Minimum, _Plan]] = {}
    for plan, end in zip(plans, ends, strict=True):
        own = plan.effects[-1]
        if end is not None and (own not in best or end[0] > best[own][0]):
            best[own] = *end, plan
    return [
        None if end is None else at_minimum(problem, end[2].effects, end[2].values, end[1])
        for end in (best.get(trial.candidate) for trial in trials)
    ]


def _end(problem: Problem, plan: _Plan) -> tuple[float, Minimum] | None:
    """Return the ln evidence and the minimum that a fit reaches."""
    try:
        made = usually_fitted(
            problem, plan.effects, plan.values, (plan.sizes,), near=plan.near, rounds=4, barred=plan.barred
        )
    except UNCOMPUTABLE:
        return None
    return made.log_evidence, made.fit.minimum


def candidate(effect: SmoothCorrection, steps: tuple[str, ...], stack: Stack) -> Candidate:
    """Return a correction as a candidate, without prior odds."""
    where = effect.place.where
    return Candidate(effect, where, steps, effect.effect_parameters(stack, where))


def _linear(problem: Problem, parent: Hypothesis, one: Candidate) -> _Trial:
    """Return a correction to first order."""
    marginal = marginal_of(problem, (*parent.effects, one), parent.values)
    x = marginal.objective.coordinates.x
    gram = marginal.gram(x, parent.fit.gram.columns)
    sizes, value = chosen(gram, (parent.fit.sizes.at("tau", 0.0),), [name for name in ORDER if name != "tau"])
    step = value.step / max(1.0, float(np.max(np.abs(value.step))))
    start, _ = marginal.objective.coordinates.forward(x + _STEP * step)
    return _Trial(one, value.log_evidence, sizes, dict(start))
