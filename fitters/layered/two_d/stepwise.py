"""The fit of a stack in two dimensions, step by step, each new step together with all earlier ones."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Reals
from ....models.stack import CausalConstantQ
from ....models.stack.laws import CONSTANT, LossLaw
from ....models.stack2d.reduction import KEPT
from ....models.stack2d.stack_model import with_reduced_section
from ...disk.two_d.misfit_as_noise import at_level, judged, left_of
from ...disk.two_d.valley_search import followed
from ...engine.descent import Descent, descend
from ...engine.objective import Objective
from ...engine.parameters.assembly import renamed
from ...engine.recording import Recording
from .lateral_search import searched
from .stack_problem import StackProblem, nominal, stack_coordinates, stack_of, stack_priors, tensor_values
from .stack_start import drawn_starts, library_starts, one_dimensional, thinned, usual_tensor

_DRAWN, _DRAWN_GLUED = (4, 200), (2, 60)
# Rounds of the search for the first step, and random tensors in each: of a bare disk, and of a stack, which costs more.
_ROUGH = 3e-3
# Part of the largest singular value down to which functions of z are kept for the search.
_GLUED = ((0.1, 1, 8), (0.03, 1, 12), (0.01, 1, 15))
# For a further step, which starts from the one-dimensional answer: successive misfits that count as noise, the number of
# places followed, and the steps from each.
_TOLERANCE = 1e-5
_ROUNDS, _STILL, _MOST = 8, 0.01, 10
# Finally the remaining misfit is counted as noise and the descent repeated, until it falls by less than 1 %.


@dataclass(frozen=True, eq=False)
class FittedStack:
    """A stack of finite diameter, fitted to the recordings of its steps."""

    problem: StackProblem
    descent: Descent
    values: Mapping[str, float]
    """Every parameter."""
    error: float
    """Estimated error of the model with its functions of z, relative to the capacitance."""
    law: LossLaw


def fitted_stack(problem: StackProblem, progress: Callable[[str], None]) -> FittedStack:
    """Return the fit of all steps. Raises FitError as `mason` does, from whose answer it starts."""
    plate = one_dimensional(problem, progress)
    usual = usual_tensor(problem, plate)
    values = {**nominal(problem, usual), **plate, **tensor_values(problem.disk.name, usual)}
    first, *later = problem.sweeps
    progress(f"fitting {first} in two dimensions")
    law, values, evaluations = _first(problem, first, values)
    steps = [first]
    for step in later:
        steps.append(step)
        progress(f"fitting {step} in two dimensions")
        coordinates = stack_coordinates(problem, steps, values)
        few = [thinned(one) for one in _recordings(problem, steps, values, law)[0]]
        x, more = followed(few, coordinates, stack_priors(problem, steps), [coordinates.x], _GLUED, 1)
        values, evaluations = {**values, **coordinates.forward(x)[0]}, evaluations + more
    progress("fitting all steps together in two dimensions")
    return _settled(problem, values, law, evaluations)


def _first(problem: StackProblem, step: str, values: Mapping[str, float]) -> tuple[LossLaw, dict[str, float], int]:
    """Return the loss law that describes the first step better, its parameters there, and the number of evaluations."""
    laws: tuple[LossLaw, ...] = (CausalConstantQ(problem.reference), CONSTANT)
    coordinates, priors = stack_coordinates(problem, [step], values), stack_priors(problem, [step])
    few = [thinned(one) for one in _recordings(problem, [step], values, laws[0], _ROUGH)[0]]
    rng = np.random.default_rng(1)

    def drawn(count: int) -> list[Reals]:
        return drawn_starts(problem, values, coordinates, count, rng)

    rounds, count = _DRAWN if problem.build.step(step).layers == (problem.disk.name,) else _DRAWN_GLUED
    given = library_starts(problem, values, coordinates)
    x, evaluations = searched(few, coordinates, priors, given, drawn, rounds, count)
    tried: list[tuple[float, int, Reals]] = []
    for k, law in enumerate(laws):
        there = {**values, **coordinates.forward(x)[0]}
        whole = [at_level(one, coordinates, x) for one in _recordings(problem, [step], there, law)[0]]
        end = descend(Objective(whole, coordinates, priors), x, _TOLERANCE, _MOST)
        evaluations += end.evaluations
        tried.append((left_of(whole, coordinates, end.x), k, end.x))
    _, best, x = min(tried, key=lambda one: one[:2])
    return laws[best], {**values, **coordinates.forward(x)[0]}, evaluations


def _recordings(
    problem: StackProblem, steps: Sequence[str], values: Mapping[str, float], law: LossLaw, kept: float = KEPT
) -> tuple[list[Recording], float]:
    """Return the recordings of these steps with models for these values, and the largest error of a model."""
    made: list[Recording] = []
    errors: list[float] = []
    for step in steps:
        model, error = with_reduced_section(stack_of(problem, step, values, law), problem.bands(step), kept)
        errors.append(error)
        names = renamed(problem.build, step)
        pairs = zip(problem.sweeps[step], problem.noises[step], strict=True)
        made += [Recording(step, sweep, model, noise, renamed=names) for sweep, noise in pairs]
    return made, max(errors)


def _settled(problem: StackProblem, values: Mapping[str, float], law: LossLaw, evaluations: int) -> FittedStack:
    """Return the minimum over all points of all steps, with models for the constants there."""
    steps = list(problem.sweeps)
    coordinates, priors = stack_coordinates(problem, steps, values), stack_priors(problem, steps)
    x, before, error, settled, recordings = coordinates.x, math.inf, math.inf, False, list[Recording]()
    for _ in range(_ROUNDS):
        there = {**values, **coordinates.forward(x)[0]}
        recordings, error = _recordings(problem, steps, there, law)
        recordings = [at_level(one, coordinates, x) for one in recordings]
        last = descend(Objective(recordings, coordinates, priors), x, _TOLERANCE, _MOST)
        evaluations, x = evaluations + last.evaluations, last.x
        left = left_of(recordings, coordinates, x)
        still = left > (1 - _STILL) * before
        settled = last.converged or (still and any(one.misfit > 0 for one in recordings))
        before = left
        if settled:
            break
    descent = judged(recordings, coordinates, priors, x, settled, evaluations)
    return FittedStack(problem, descent, {**values, **coordinates.forward(x)[0]}, error, law)
