"""The fit of a stack in two dimensions, step by step, each new step together with all earlier ones."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Reals
from ....models.stack import CausalConstantQ
from ....models.stack.loss_laws import CONSTANT, LossLaw
from ....models.stack2d.reduction import KEPT
from ....models.stack2d.stack_model import with_reduced_section
from ...disk.two_d.lateral_search import Effort, searched
from ...disk.two_d.misfit_as_noise import at_level, judged, left_of
from ...disk.two_d.reference import at_resonance, reference_of
from ...engine.descent import Descent, descend
from ...engine.objective import Objective
from ...engine.parameters.assembly import effects_of, layers_of, nominal_parameters, renamed
from ...engine.parameters.known_effects import with_effects
from ...engine.recording import Prior, Recording
from ...interface import FitError
from .stack_problem import StackProblem, nominal, plate_of, stack_coordinates, stack_of, stack_priors, tensor_values
from .stack_start import drawn_layers, drawn_starts, library_starts, one_dimensional, thinned, usual_tensor

_BARE, _STACK, LAYERS, NEAR = Effort(5, 200), Effort(3, 60), Effort(6, 40), Effort(0, 0)
# Search for the constants of a bare disk, of a disk that was never measured bare, of further layers, and of these near
# what the build states and the one-dimensional fit found.
_ROUGH = 1e-2
# Part of the largest singular value down to which functions of z are kept for the search.
_TOLERANCE = 1e-5
_ROUNDS, _STILL, _MOST = 6, 0.01, 60
# Finally the remaining misfit is counted as noise, and the descent repeated until it falls by less than 1 %.


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


def fitted_stack(problem: StackProblem, progress: Callable[[str], None], hopeless: float = math.inf) -> FittedStack:
    """Return the fit of all steps, which starts from the answer of `mason`. Raises TaskError.

    `hopeless`: misfit over that expected of the noise that the first step must not exceed, else FitError is raised.
    """
    plate = one_dimensional(problem, progress)
    usual = usual_tensor(problem, plate)
    values = {**nominal(problem, usual), **plate, **tensor_values(problem.disk.name, usual)}
    first, *later = problem.sweeps
    progress(f"fitting {first} in two dimensions")
    law, values, evaluations, left = _first(problem, first, values)
    if left > hopeless:
        raise FitError(f"in two dimensions {left:.3g} times the noise is left of {first}, more than {hopeless:.3g}")
    for k, step in enumerate(later, 2):
        progress(f"fitting {step} in two dimensions")
        values, more = _further(problem, list(problem.sweeps)[:k], values, law)
        evaluations += more
    progress("fitting all steps together in two dimensions")
    return _settled(problem, values, law, evaluations)


def fitted_glue(
    problem: StackProblem,
    values: Mapping[str, float],
    law: LossLaw,
    progress: Callable[[str], None],
    effort: Effort = LAYERS,
) -> FittedStack:
    """Return the fit of glued steps on a ceramic that is `told`, from these values of every parameter."""
    evaluations = 0
    for k, step in enumerate(problem.sweeps, 1):
        progress(f"fitting {step} in two dimensions")
        values, more = _further(problem, list(problem.sweeps)[:k], values, law, effort)
        evaluations += more
    return _settled(problem, values, law, evaluations)


def _first(
    problem: StackProblem, step: str, values: Mapping[str, float]
) -> tuple[LossLaw, dict[str, float], int, float]:
    """Return the loss law that describes the first step better, the parameters there, evaluations, and what is left.

    The latter is the misfit over that expected of the noise. A causal law and the ceramic are told at the thickness
    resonance found; other layers have to be fitted once more from where they are.
    """
    ceramic = problem.disk.name
    laws: tuple[LossLaw, ...] = (CausalConstantQ(reference_of(problem.every_sweep, values, ceramic)), CONSTANT)
    coordinates, priors = stack_coordinates(problem, [step], values), stack_priors(problem, [step])
    rough = _few(problem, [step], values, laws[0], _ROUGH)
    exact = [_few(problem, [step], values, law, KEPT) for law in laws]
    rng = np.random.default_rng(1)

    def drawn(count: int) -> list[Reals]:
        return drawn_starts(problem, values, coordinates, count, rng)

    effort = _BARE if problem.build.step(step).layers == (problem.disk.name,) else _STACK
    given = library_starts(problem, values, coordinates)
    x, best, evaluations = searched(rough, exact, coordinates, priors, given, drawn, effort)
    expected = math.sqrt(sum(float(np.sum(2 * one.noise**2)) for one in exact[best]))
    left = left_of(exact[best], coordinates, x) / expected
    found = {**values, **coordinates.forward(x)[0]}
    law, tensor = at_resonance(problem.every_sweep, found, ceramic, laws[best])
    return law, {**found, **tensor}, evaluations, left


def _further(
    problem: StackProblem, steps: Sequence[str], values: Mapping[str, float], law: LossLaw, effort: Effort = LAYERS
) -> tuple[dict[str, float], int]:
    """Return the parameters with those of the last of these steps, and the number of evaluations."""
    coordinates, priors = stack_coordinates(problem, steps, values), stack_priors(problem, steps)
    rough, exact = (_few(problem, steps, values, law, kept) for kept in (_ROUGH, KEPT))
    before = {layer.name for layer in layers_of(problem.build, steps[:-1])}
    if problem.told is not None:
        before.add(problem.disk.name)
    new = [name for name in problem.build.step(steps[-1]).layers if name not in before]
    known = [prior for prior in priors if isinstance(prior, Prior)]
    ours = {name: value for name, value in nominal_parameters(problem.build).items() if name.partition(".")[0] in new}
    centres = [coordinates.x, coordinates.inverse({**values, **ours})]
    rng = np.random.default_rng(1)

    def drawn(count: int) -> list[Reals]:
        return drawn_layers(coordinates, centres, new, known, count, rng)

    x, _, evaluations = searched(rough, [exact], coordinates, priors, centres, drawn, effort)
    return {**values, **coordinates.forward(x)[0]}, evaluations


def _recordings(
    problem: StackProblem, steps: Sequence[str], values: Mapping[str, float], law: LossLaw, kept: float = KEPT
) -> tuple[list[Recording], float]:
    """Return the recordings of these steps with models for these values, and the largest error of a model.

    A model's own error counts as noise.
    """
    made: list[Recording] = []
    errors: list[float] = []
    for step in steps:
        model, error = with_reduced_section(stack_of(problem, step, values, law), problem.bands(step), kept)
        errors.append(error)
        names = renamed(problem.build, step)
        device = with_effects(model, step, effects_of(problem.build), plate_of(problem, step))
        pairs = zip(problem.sweeps[step], problem.noises[step], strict=True)
        own = error / math.sqrt(2)
        made += [Recording(step, sweep, device, np.hypot(noise, own), renamed=names) for sweep, noise in pairs]
    return made, max(errors)


def _few(
    problem: StackProblem, steps: Sequence[str], values: Mapping[str, float], law: LossLaw, kept: float
) -> list[Recording]:
    """Return the same with few points."""
    return list(map(thinned, _recordings(problem, steps, values, law, kept)[0]))


def _settled(problem: StackProblem, values: Mapping[str, float], law: LossLaw, evaluations: int) -> FittedStack:
    """Return the minimum over all points of all steps, with models for the constants there."""
    steps = list(problem.sweeps)
    coordinates, priors = stack_coordinates(problem, steps, values), stack_priors(problem, steps)
    x, before, error, settled, recordings = coordinates.x, math.inf, math.inf, False, list[Recording]()
    for k in range(_ROUNDS):
        there = {**values, **coordinates.forward(x)[0]}
        recordings, error = _recordings(problem, steps, there, law)
        if k == 0:
            few = [at_level(thinned(one), coordinates, x) for one in recordings]
            near = descend(Objective(few, coordinates, priors), x, _TOLERANCE, _MOST)
            evaluations, x = evaluations + near.evaluations, near.x
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
