"""What a fit of a stack in two dimensions starts from: recordings within reach, models of the steps, coordinates."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.build import Build, LayerSpec, Quantity
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.matrices import CONSTANTS
from ....models.disk2d.training import HIGHEST
from ....models.materials.passive import USUAL_POISSON
from ....models.stack import Stack
from ....models.stack.loss_laws import LossLaw
from ....models.stack2d.layers2d import Ceramic2D, Isotropic
from ....models.stack2d.stack_model import Layer2D, Stack2D, full_section
from ....models.sweep import Sweep
from ...disk.two_d.reference import parameters_of, tensor_of
from ...disk.two_d.tensor_coordinates import COORDINATES
from ...disk.two_d.tensor_start import ceramic_priors
from ...engine.multi_step_fit import check_task, refuse_effects
from ...engine.noise import noise_of
from ...engine.parameters.assembly import PIEZO_CONSTANTS, coordinates_of, layers_of, nominal_parameters, priors_of
from ...engine.parameters.assembly import stack_of as plate
from ...engine.parameters.coordinates import Coordinates, between
from ...engine.recording import Posterior, Prior
from ...interface import FitError, FitTask, Noise, TaskError
from .plate_block import plate_block

NAME = "stack2d"
_FEWEST = 10
# Points of a sweep within reach below which it is left out.
_SHORTEST = 0.5
# Least diameter of the electrodes over that of the disk.


@dataclass(frozen=True, eq=False)
class StackProblem:
    """The recordings of a stack with one piezoelectric layer, and its build."""

    build: Build
    """With a Poisson's ratio for each elastic layer."""
    sweeps: Mapping[str, tuple[Sweep, ...]]
    """By step in gluing order, up to the model's highest frequency; repeats on one grid are averaged."""
    noise: Mapping[str, Noise]
    """By step."""
    noises: Mapping[str, tuple[Reals, ...]]
    """Standard deviation of Re and Im of ln Z at each point of each sweep, shape (N,)."""
    free: tuple[str, ...] | None
    told: Posterior | None = None
    """What is known of the piezoelectric layer from recordings of its own, in place of what is usual."""
    elastic_law: LossLaw | None = None
    """Law of losses of the other layers; None if it is that of the ceramic."""

    @property
    def disk(self) -> LayerSpec:
        """The piezoelectric layer."""
        return self.build.piezos[0]

    @property
    def bare(self) -> str | None:
        """The step that has the piezoelectric layer alone, if it was recorded."""
        return next((step for step in self.sweeps if self.build.step(step).layers == (self.disk.name,)), None)

    @property
    def every_sweep(self) -> list[Sweep]:
        """The sweeps of all steps."""
        return [sweep for sweeps in self.sweeps.values() for sweep in sweeps]

    def bands(self, step: str) -> list[tuple[float, float]]:
        """Return the ends of each sweep of a step, Hz."""
        return [(float(sweep.frequency[0]), float(sweep.frequency[-1])) for sweep in self.sweeps[step]]


def problem_of(task: FitTask) -> StackProblem:
    """Return the problem of a task. Raises FitError or TaskError for a build or recordings that the model lacks."""
    build, sweeps = check_task(replace(task, free=None))
    refuse_effects(build, NAME, outside=True)
    _refuse(build)
    highest = HIGHEST / build.piezos[0].values["thickness"].re
    noise: dict[str, Noise] = {}
    noises: dict[str, tuple[Reals, ...]] = {}
    kept: dict[str, tuple[Sweep, ...]] = {}
    for step, of_step in sweeps.items():
        noise[step], sigmas = noise_of(of_step)
        within = [(sweep.frequency <= highest, sweep, s) for sweep, s in zip(of_step, sigmas, strict=True)]
        within = [one for one in within if np.count_nonzero(one[0]) >= _FEWEST]
        kept[step] = tuple(sweep.at(at) for at, sweep, _ in within)
        noises[step] = tuple(s[at] for at, _, s in within)
    kept = {step: own for step, own in kept.items() if own}
    if not kept:
        raise FitError(
            f"`{NAME}` reaches up to {highest / 1e3:.4g} kHz for a disk of this thickness; no recording is below it"
        )
    return StackProblem(_with_poisson(build), kept, noise, noises, task.free)


def _refuse(build: Build) -> None:
    """Raise TaskError for what the model lacks."""
    if len(build.piezos) != 1:
        names = ", ".join(layer.name for layer in build.piezos)
        raise TaskError(f"`{NAME}` covers one piezoelectric layer; build {build.name!r} has {names}")
    if build.bolt is not None:
        raise TaskError(f"`{NAME}` covers no bolt; build {build.name!r} has one: fit it with mason")
    if build.diameter is None:
        raise TaskError(f"`{NAME}` covers round stacks; build {build.name!r} gives an area and no diameter")
    disk = build.piezos[0]
    if build.hole_diameter is not None:
        _refuse_uncertain("hole_diameter_mm", build.hole_diameter)
    for layer in build.layers:
        _refuse_diameter(build, layer)
    for name in PIEZO_CONSTANTS:
        if disk.values[name].bounds is not None:
            raise TaskError(f"cannot bound '{disk.name}.{name}': `{NAME}` moves it together with others; give it a u")


def _refuse_diameter(build: Build, layer: LayerSpec) -> None:
    """Raise TaskError for electrodes or a layer of a diameter that the model lacks."""
    name, key, least = ("electrode_diameter", "electrode_diameter_mm", _SHORTEST)
    if layer.kind == "elastic":
        name, key, least = ("layer_diameter", "diameter_mm", 0.0)
    given = layer.values.get(name)
    if given is None or build.diameter is None:
        return
    whole, hole = build.diameter.re, 2 * hole_of(build)
    if not least * whole <= given.re <= whole:
        raise TaskError(
            f"{key} of {layer.name!r} is {1e3 * given.re:.4g}; `{NAME}` covers {1e3 * least * whole:.4g} to "
            f"{1e3 * whole:.4g}, the disk's diameter"
        )
    if given.re <= hole:
        raise TaskError(
            f"{key} of {layer.name!r} is {1e3 * given.re:.4g}; more than {1e3 * hole:.4g}, the hole's, is needed"
        )
    _refuse_uncertain(f"{key} of {layer.name!r}", given)


def _refuse_uncertain(what: str, given: Quantity) -> None:
    if given.u > 0:
        raise TaskError(
            f"{what} has an uncertainty; `{NAME}` takes it as exact: fit once for each value that it may have"
        )


def hole_of(build: Build) -> float:
    """Return the radius of the hole through all layers, m; 0 if there is none."""
    return 0.0 if build.hole_diameter is None else build.hole_diameter.re / 2


def part_of_area(build: Build) -> float:
    """Return the area of the electrodes over that of the faces."""
    outer, hole = math.sqrt(build.area.re / math.pi + hole_of(build) ** 2), hole_of(build)
    electrode = part_of_radius(build, build.piezos[0]) * outer
    return (electrode**2 - hole**2) / (outer**2 - hole**2)


def part_of_radius(build: Build, layer: LayerSpec) -> float:
    """Return the radius of a layer, of a piezo layer that of its electrodes, over that of the faces; 1 by default."""
    given = layer.values.get("electrode_diameter" if layer.kind == "piezo" else "layer_diameter")
    return 1.0 if given is None or build.diameter is None else given.re / build.diameter.re


def _with_poisson(build: Build) -> Build:
    """Return the build with the usual Poisson's ratio for each elastic layer that has none."""

    def completed(layer: LayerSpec) -> LayerSpec:
        if layer.kind == "piezo" or "poisson" in layer.values:
            return layer
        return replace(layer, values={**layer.values, "poisson": USUAL_POISSON})

    return replace(build, layers=tuple(map(completed, build.layers)))


def tensor_values(layer: str, tensor: Tensor6mm) -> dict[str, float]:
    """Return the ten constants of a tensor, and c33D and h33, as model parameters."""
    plate, made = tensor.thickness, parameters_of(tensor, layer)
    for name, z in (("c33D", plate.c33D), ("h33", plate.h33)):
        made |= {f"{layer}.{name}.re": z.real, f"{layer}.{name}.im": z.imag}
    return made


def nominal(problem: StackProblem, tensor: Tensor6mm) -> dict[str, float]:
    """Return every parameter of the build at its nominal value, with this tensor."""
    return {**nominal_parameters(problem.build), **tensor_values(problem.disk.name, tensor)}


def stack_of(problem: StackProblem, step: str, values: Mapping[str, float], law: LossLaw) -> Stack2D:
    """Return the model of a step, with all functions of z for its highest frequency."""
    build = problem.build
    ground = {layer: f"{layer}.thickness@{since}" for layer, (since, _) in build.reground(step).items()}
    layers: list[Layer2D] = []
    for name in build.step(step).layers:
        thickness, part = values[ground.get(name, f"{name}.thickness")], part_of_radius(build, build.layer(name))
        if name == problem.disk.name:
            tensor, density = tensor_of(values, name), values[f"{name}.density"]
            layers.append(Ceramic2D(name, tensor, thickness, density, law, electrode=part))
        else:
            z, c, q, poisson = (values[f"{name}.{key}"] for key in ("z", "c", "q", "poisson"))
            layers.append(Isotropic(name, thickness, z, c, q, poisson, problem.elastic_law or law, part))
    highest = max(high for _, high in problem.bands(step))
    section = full_section(layers, highest)
    back, front = (values.get(f"{face}.z", 0.0) for face in ("back", "front"))
    return Stack2D(tuple(layers), values["area"], section, back, front, hole=hole_of(build))


def plate_of(problem: StackProblem, step: str) -> Stack:
    """Return the step in one dimension, which sets sizes and places of effects."""
    return plate(problem.build, problem.build.step(step))


def stack_coordinates(problem: StackProblem, steps: Sequence[str], start: Mapping[str, float]) -> Coordinates:
    """Return the coordinates of a fit over these steps. Raises TaskError for a name that cannot be freed.

    They are those of the one-dimensional stack, with all ten constants of the ceramic in place of three, and a
    Poisson's ratio for each elastic layer.
    """
    at, layers = problem.disk.name, layers_of(problem.build, steps)
    elastic = [layer for layer in layers if layer.kind == "elastic"]
    rest, own = _freed(problem, [layer.name for layer in elastic])
    plate = {f"{at}.{name}{loss}" for name in PIEZO_CONSTANTS for loss in ("", ".loss")}
    base = coordinates_of(problem.build, steps, start, rest)
    blocks = [block for block in base.blocks if not set(block.coordinates) & plate]
    ratios = {f"{layer.name}.poisson": layer.values["poisson"] for layer in elastic}
    free = {name for name in base.free if name not in plate} | {f"{at}.{name}" for name in COORDINATES}
    free |= {name for name, value in ratios.items() if (value.u > 0 if own is None else name in own)}
    return Coordinates((plate_block(at), *blocks, *(between(name, 0.0, 0.5) for name in ratios)), start, tuple(free))


def _freed(problem: StackProblem, elastic: Sequence[str]) -> tuple[tuple[str, ...] | None, set[str] | None]:
    """Return the names to free among those of the one-dimensional stack, and the others; None for the usual ones."""
    if problem.free is None:
        return None, None
    at = problem.disk.name
    whole, ratios = {f"{at}.{name}" for name in CONSTANTS}, {f"{name}.poisson" for name in elastic}
    later = {layer.name for layer in problem.build.layers} - {at, *elastic}
    given = {name for name in problem.free if name.partition(".")[0] not in later}
    if not whole <= given:
        left = min(whole - given)
        raise TaskError(f"`{NAME}` frees all ten constants together; {left!r} is not among those to free")
    follow = given & {f"{at}.c33D", f"{at}.h33"}
    if follow:
        raise TaskError(f"cannot free {min(follow)!r}: `{NAME}` has it from the ten constants of {at!r}")
    return tuple(given - whole - ratios), given


def stack_priors(problem: StackProblem, steps: Sequence[str]) -> tuple[Prior | Posterior, ...]:
    """Return the priors of these steps: those of the build, and for the ceramic those of any piezoceramic.

    What the build file itself states of c33D, h33 and eps33S counts, too.
    """
    values = problem.disk.values
    doubted = {f"{problem.disk.name}.{name}" for name in PIEZO_CONSTANTS if values[name].source != "build.toml"}
    own = [one for one in priors_of(problem.build, steps) if one.parameter.removesuffix(".re") not in doubted]
    if problem.told is not None:
        return (*(one for one in own if not one.parameter.startswith(f"{problem.disk.name}.")), problem.told)
    return (*own, *ceramic_priors(problem.disk))
