"""Where a fit of a stack in two dimensions starts: the one-dimensional answer, and tensors that agree with it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.errors import PzctlError
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.matrices import CONSTANTS
from ...disk.two_d.tensor_start import AXIAL, drawn_constants, expected, library
from ...engine.multi_step_fit import solve
from ...engine.parameters.assembly import nominal_parameters
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Prior, Recording
from ...interface import FitError, FitTask, TaskError
from .stack_problem import StackProblem, part_of_area, tensor_values

_LEAST_LOSS, _MOST_LOSS = 1e-3, 0.1
# Limits of the loss tangents of a start; the one-dimensional fit mistakes ripple for loss.
_SOFTEST = 0.3
# Least part of c33D that c33E can be: more would be a coupling above 0.84, which no ceramic has.
_TRIES = 40
# Draws for each tensor wanted, at most.
_WIDEST = 0.5
# Largest width in which a coordinate of a layer, a logarithm, is drawn.
_COARSE = 100
# Points of each sweep for a search.


def one_dimensional(problem: StackProblem, progress: Callable[[str], None]) -> dict[str, float]:
    """Return every parameter of the one-dimensional fit of all steps; the build's where that fit is impossible.

    Lateral modes can hide the pair of resonances that it looks for. The plate is as wide as the electrodes.
    """
    build, part = problem.build, part_of_area(problem.build)
    area = replace(build.area, re=part * build.area.re, u=part * build.area.u)
    try:
        solution = solve(FitTask(replace(build, area=area), problem.sweeps), progress)
    except TaskError:
        raise
    except FitError:
        return nominal_parameters(build)
    values = solution.descent.objective.coordinates.forward(solution.descent.x)[0]
    return {**values, "area": values["area"] / part}


def usual_tensor(problem: StackProblem, plate: Mapping[str, float]) -> Tensor6mm:
    """Return the tensor of the build's material with the thickness-mode constants of `plate`."""
    return _agreeing(problem.disk.name, expected(problem.disk), plate)


def library_starts(problem: StackProblem, plate: Mapping[str, float], coordinates: Coordinates) -> list[Reals]:
    """Return the coordinates of each tensor of the library with the thickness-mode constants of `plate`."""
    real = ({name: complex(getattr(tensor, name)).real for name in CONSTANTS} for tensor in library().values())
    made = [_agreeing(problem.disk.name, usual, plate) for usual in (expected(problem.disk), *real)]
    return [x for x in (_inverse(problem, tensor, coordinates) for tensor in made) if x is not None]


def drawn_starts(
    problem: StackProblem, plate: Mapping[str, float], coordinates: Coordinates, count: int, rng: np.random.Generator
) -> list[Reals]:
    """Return the coordinates of random tensors: the prior's, with the thickness-mode constants of `plate`."""
    usual = expected(problem.disk)
    made: list[Reals] = []
    for _ in range(_TRIES * count):
        drawn = drawn_constants(usual, rng)
        if drawn is None:
            continue
        x = _inverse(problem, _agreeing(problem.disk.name, drawn, plate), coordinates)
        if x is not None:
            made.append(x)
        if len(made) == count:
            break
    return made


def drawn_layers(
    coordinates: Coordinates,
    centres: Sequence[Reals],
    layers: Sequence[str],
    known: Sequence[Prior],
    count: int,
    rng: np.random.Generator,
) -> list[Reals]:
    """Return starts with random constants of these layers, drawn from their priors around each of `centres` in turn."""
    _, chain = coordinates.forward(coordinates.x)
    row = {name: k for k, name in enumerate(coordinates.parameters)}
    width = np.zeros(coordinates.x.size)
    for prior in known:
        if prior.parameter.partition(".")[0] in layers and prior.parameter in row:
            slope = chain[row[prior.parameter]]
            at = int(np.argmax(np.abs(slope)))
            width[at] = min(prior.u / abs(float(slope[at])), _WIDEST)
    return [centres[k % len(centres)] + width * rng.normal(size=width.size) for k in range(count)]


def _inverse(problem: StackProblem, tensor: Tensor6mm, coordinates: Coordinates) -> Reals | None:
    """Return the coordinates of a tensor; None if it is none of a stable material."""
    try:
        return coordinates.inverse({**coordinates.start, **tensor_values(problem.disk.name, tensor)})
    except PzctlError:
        return None


def _agreeing(layer: str, usual: Mapping[str, float], plate: Mapping[str, float]) -> Tensor6mm:
    """Return real constants scaled to the real parts of c33D, h33 and eps33S, with one loss of each kind."""
    c, h, eps = (complex(plate[f"{layer}.{n}.re"], plate[f"{layer}.{n}.im"]) for n in ("c33D", "h33", "eps33S"))
    axial = {"eps33S": eps.real, "e33": h.real * eps.real}
    axial["c33E"] = max(c.real - h.real * axial["e33"], _SOFTEST * c.real)
    elastic, dielectric = (min(max(loss, _LEAST_LOSS), _MOST_LOSS) for loss in (c.imag / c.real, -eps.imag / eps.real))
    losses = {"c": 1 + 1j * elastic, "e": 1.0, "eps": 1 - 1j * dielectric}
    made: list[complex] = []
    for name in CONSTANTS:
        of_kind = AXIAL.get(name, name)
        kind = "eps" if name.startswith("eps") else name[0]
        made.append(complex(usual[name] * axial[of_kind] / usual[of_kind] * losses[kind]))
    return Tensor6mm(*made)


def thinned(recording: Recording) -> Recording:
    """Return the recording with every n-th point only, for a search."""
    sweep, every = recording.sweep, max(1, recording.sweep.frequency.size // _COARSE)
    return replace(recording, sweep=sweep.at(slice(None, None, every)), noise=recording.noise[::every])
