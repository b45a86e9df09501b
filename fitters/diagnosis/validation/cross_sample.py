"""Validation on another sample: test the effects found in one sample on the next, with only its constants free."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ....models.effects import Effect
from ....models.effects.learned.learned import LearnedLaw
from ...engine.descent import descend
from ...engine.fitted_model import Diagnosable
from ...engine.objective import Objective
from ...engine.recording import Posterior
from ...error_model.error_columns import stack_of
from ...interface import FitError, FitTask
from ..data_quality.data_gates import gate
from ..findings import OtherSample
from ..hypotheses.candidates import candidates_of
from ..hypotheses.problem import Candidate, Problem
from ..search.refit import ROUGH, Refit, finished
from ..search.trial_fits import null_refit, polish, resoftened

_FINE = 1e-8


def carried_over(
    problem: Problem,
    final: Refit,
    sample: str,
    task: FitTask,
    progress: Callable[[str], None],
    fitter: Diagnosable | None = None,
) -> OtherSample:
    """Return how well the effects of a final fit describe another sample, whose own constants are free.

    The prior of their sizes is the posterior of the first sample's fit, with all correlations (Chow's forecast test,
    Econometrica 28 (1960) 591). Raises FitError if the other sample cannot be fitted.
    """
    progress(f"testing the findings on {sample}")
    try:
        other = Problem.posed(replace(task, sweeps=gate(task.sweeps).sweeps), progress, fitter)
    except FitError as error:
        raise FitError(f"{sample}: {error}") from error
    null = polish(other, null_refit(other), _FINE)
    there = {one: twin for one in final.effects for twin in _twins(other, one)}
    before = _per_dof(other, null)
    names = tuple(f"{one.effect.name} at {one.where}" for one in there)
    if not there:
        return OtherSample(sample, other.steps, (), before, before)
    effects, told = tuple(there.values()), _told(problem, final, tuple(there))
    values = {**null.values, **{name: final.values[name] for one in there for name in one.parameters}}
    coordinates = other.coordinates(effects, values)  # the same for all: what is told is told in these
    x, best = coordinates.x, null
    for tolerance in (ROUGH, _FINE, _FINE, _FINE):  # weights match the residual, which falls to the noise
        softly = Objective(resoftened(other, best).with_effects(effects), coordinates, (*other.priors, told))
        again = finished(effects, descend(softly, x, tolerance))
        x, best = again.descent.x, again
    return OtherSample(sample, other.steps, names, before, _per_dof(other, best))


def _twins(other: Problem, found: Candidate) -> list[Candidate]:
    """Return the same effect at the same place in the other sample, in as many common steps as possible, or nothing."""
    same = [
        one
        for one in candidates_of(other, _effect_of(other, found.effect))
        if one.where == found.where and set(one.steps) <= set(found.steps)
    ]
    longest = max(same, key=lambda one: len(one.steps), default=None)
    return [] if longest is None else [replace(longest, effect_parameters=found.effect_parameters)]


def _effect_of(other: Problem, effect: Effect) -> Effect:
    """Return an effect for another sample; a learned law has its size at the same frequency there."""
    if isinstance(effect, LearnedLaw):
        return effect.in_stack(stack_of(other.recordings[-1].model))
    return effect


def _told(problem: Problem, final: Refit, effects: Sequence[Candidate]) -> Posterior:
    """Return the posterior of the sizes of some effects, marginalised over everything else."""
    objective = resoftened(problem, final).objective(final.effects, final.values)
    x, free = objective.coordinates.x, objective.coordinates.free
    names = tuple(name for one in effects for name in one.parameters)
    own = [free.index(name) for name in names]
    J = objective.jacobian(x)
    rest = np.delete(J, own, axis=1)
    alone = J[:, own] - rest @ np.linalg.lstsq(rest, J[:, own], rcond=1e-12)[0]
    return Posterior(names, objective.straight(x)[0][own], np.linalg.qr(alone).R)


def _per_dof(problem: Problem, found: Refit) -> float:
    """Return the misfit per degree of freedom in units of noise, including the deviation from the priors."""
    sizes = [one.sweep.frequency.size for one in problem.recordings]
    return float(np.dot(sizes, found.chi2)) / sum(sizes) + found.against / (2.0 * sum(sizes))
