"""From a build to what a fit needs: stacks of its steps, coordinates, priors, nominal values."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from ..models.build import Build, LayerSpec, Load, Quantity, Step
from ..models.stack import Elastic, HalfSpace, Piezo, Stack
from .coordinates import Block, Coordinates, hardly_negative, positive, thickness_constants
from .interface import FitError
from .objective import Prior

PIEZO_CONSTANTS = ("c33D", "h33", "eps33S")
ELASTIC_CONSTANTS = ("z", "c", "q")
UNITS = {
    "c33D": "Pa",
    "h33": "V/m",
    "eps33S": "F/m",
    "z": "Rayl",
    "c": "m/s",
    "q": "1",
    "thickness": "m",
    "density": "kg/m3",
    "area": "m2",
}


def _layer(spec: LayerSpec) -> Piezo | Elastic:
    value = {name: quantity.value for name, quantity in spec.values.items()}
    if spec.kind == "piezo":
        return Piezo(
            spec.name,
            thickness=value["thickness"].real,
            density=value["density"].real,
            c33D=value["c33D"],
            h33=value["h33"],
            eps33S=value["eps33S"],
        )
    return Elastic(
        spec.name, thickness=value["thickness"].real, z=value["z"].real, c=value["c"].real, q=value["q"].real
    )


def _half_space(load: Load) -> HalfSpace:
    return HalfSpace(load.name, z=load.z.re)


def stack_of(build: Build, step: Step) -> Stack:
    """Return the stack of a step at its nominal values."""
    return Stack(
        layers=tuple(_layer(build.layer(name)) for name in step.layers),
        back=_half_space(build.back),
        front=_half_space(build.front),
        area=build.area.re,
    )


def layers_of(build: Build, steps: Iterable[str]) -> tuple[LayerSpec, ...]:
    """Return the layers that are there in any of these steps, back to front."""
    there = {name for step in steps for name in build.step(step).layers}
    return tuple(layer for layer in build.layers if layer.name in there)


def nominal_parameters(build: Build) -> dict[str, float]:
    """Return every model parameter of every layer at its nominal value, `area` and loads."""
    values = {"area": build.area.re} | {name: quantity.re for name, quantity in _loads(build).items()}
    for layer in build.layers:
        for name, quantity in layer.values.items():
            if name in PIEZO_CONSTANTS:
                values[f"{layer.name}.{name}.re"] = quantity.re
                values[f"{layer.name}.{name}.im"] = quantity.im
            else:
                values[f"{layer.name}.{name}"] = quantity.re
    return values


def _loads(build: Build) -> dict[str, Quantity]:
    """Return the loads that are there, by parameter name, with what is known of them.

    A face in air radiates 413 Rayl only where nothing is near. Between face and jig the air stands, and what the face
    then feels lies anywhere between nothing and more than that; so air is uncertain by its own size. It matters: it
    is 0.15 % of the loss of a Pz27 disk, ten times the uncertainty that the noise alone would give.
    """
    loads = {"back.z": build.back, "front.z": build.front}
    return {
        name: replace(load.z, u=load.z.re) if load.name == "air" else load.z
        for name, load in loads.items()
        if load.z.re > 0
    }


def _blocks(build: Build, layers: Iterable[LayerSpec]) -> tuple[Block, ...]:
    blocks: list[Block] = [positive("area"), *(hardly_negative(name, load.re) for name, load in _loads(build).items())]
    for layer in layers:
        if layer.kind == "piezo":
            blocks += [thickness_constants(layer.name), positive(f"{layer.name}.density")]
        else:
            blocks += [positive(f"{layer.name}.{name}") for name in ELASTIC_CONSTANTS]
        blocks.append(positive(f"{layer.name}.thickness"))
    return tuple(blocks)


def _held(quantity: Quantity, piezo_constant: bool) -> bool:
    """Say whether a quantity is held: a bare number of the build file, or a library value said to be exact.

    The thickness-mode constants of a library ceramic always move: no data sheet gives them well enough to hold them.
    """
    return quantity.u == 0 and (quantity.source == "build.toml" or not piezo_constant)


def _free_by_default(build: Build, layers: Iterable[LayerSpec]) -> set[str]:
    free = {name for name, quantity in _loads(build).items() if quantity.u > 0}
    free |= set() if build.area.u == 0 else {"area"}
    for layer in layers:
        names = PIEZO_CONSTANTS if layer.kind == "piezo" else ELASTIC_CONSTANTS
        for name in (*names, "thickness", "density"):
            if name in layer.values and not _held(layer.values[name], name in PIEZO_CONSTANTS):
                free |= {f"{layer.name}.{name}", f"{layer.name}.{name}.loss"}
    return free


def _free_by_name(names: Iterable[str], blocks: tuple[Block, ...]) -> set[str]:
    known = {coordinate.removesuffix(".loss") for block in blocks for coordinate in block.coordinates}
    for name in names:
        if name not in known:
            raise FitError(f"cannot free {name!r}: this build has {', '.join(sorted(known))}")
    return {variant for name in names for variant in (name, f"{name}.loss")}


def coordinates_of(
    build: Build, steps: Iterable[str], start: Mapping[str, float], free: tuple[str, ...] | None
) -> Coordinates:
    """Return the coordinates of a fit over these steps.

    `free` names constants (`disk.c33D`, `glue1.thickness`); None frees all that carry an uncertainty. Raises FitError
    for a name the build does not have.
    """
    layers = layers_of(build, steps)
    blocks = _blocks(build, layers)
    moving = _free_by_default(build, layers) if free is None else _free_by_name(free, blocks)
    return Coordinates(blocks, start, tuple(moving))


def priors_of(build: Build, steps: Iterable[str]) -> tuple[Prior, ...]:
    """Return what build file and material library say of the constants beforehand."""
    priors = [Prior(name, quantity.re, quantity.u) for name, quantity in _loads(build).items() if quantity.u > 0]
    if build.area.u > 0:
        priors.append(Prior("area", build.area.re, build.area.u))
    for layer in layers_of(build, steps):
        for name, quantity in layer.values.items():
            full = f"{layer.name}.{name}"
            if quantity.u > 0:
                priors.append(Prior(f"{full}.re" if name in PIEZO_CONSTANTS else full, quantity.re, quantity.u))
            if quantity.u_im > 0 and name in PIEZO_CONSTANTS and quantity.source == "build.toml":
                priors.append(Prior(f"{full}.im", quantity.im, quantity.u_im))
    return tuple(priors)
