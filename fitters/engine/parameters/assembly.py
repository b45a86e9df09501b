"""From a build to the ingredients of a fit: stacks of its steps, coordinates, priors, nominal values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.build import NEEDED, Build, LayerSpec, LoadSpec, Quantity, Step
from ....models.stack import Bolt, Elastic, HalfSpace, Piezo, Stack
from ....models.sweep import Sweep
from ...interface import TaskError
from ..recording import Prior, QualityFactor, Recording, Weighing
from .constraints import bounded, shared
from .coordinates import LEAST_Q, Block, Coordinates, hardly_negative, positive, quality, thickness_constants, to_h33
from .known_effects import KnownEffect, known_effects, with_effects

PIEZO_CONSTANTS = ("c33D", "h33", "eps33S")
ELASTIC_CONSTANTS = ("z", "c", "q")
BOLT_STIFFNESS = "bolt.stiffness"
UNITS = {
    "stiffness": "N/m",
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


def ground_name(layer: str, step: str) -> str:
    """Return the name of a layer's thickness after it was ground before a step."""
    return f"{layer}.thickness@{step}"


def _ground(build: Build, steps: Iterable[str]) -> dict[str, Quantity]:
    """Return the thickness of every layer ground by the time of any of these steps, by its name in the fit."""
    thicknesses = (item for step in steps for item in build.reground(step).items())
    return {ground_name(layer, since): thickness for layer, (since, thickness) in thicknesses}


def renamed(build: Build, step: str) -> dict[str, str]:
    """Return the fit's names of those parameters of a step's stack that differ from the stack's own names."""
    return {f"{layer}.thickness": ground_name(layer, since) for layer, (since, _) in build.reground(step).items()}


def recordings_of(build: Build, step: str, sweeps: Iterable[Sweep], noise: Iterable[Reals]) -> list[Recording]:
    """Return the recordings of a step; `noise`: standard deviation of Re and Im of ln Z of each sweep."""
    model = with_effects(stack_of(build, build.step(step)), step, effects_of(build))
    names = renamed(build, step)
    return [Recording(step, sweep, model, sigma, renamed=names) for sweep, sigma in zip(sweeps, noise, strict=True)]


def effects_of(build: Build, steps: Iterable[str] | None = None) -> tuple[KnownEffect, ...]:
    """Return the effects that a build states, or those of them that any of these steps has.

    Raises KnownEffectError for an effect that this sample cannot have.
    """
    if not build.effects:
        return ()
    known = known_effects(build.effects, {step.name: stack_of(build, step) for step in build.steps})
    there = None if steps is None else set(steps)
    return tuple(one for one in known if there is None or there & set(one.steps))


def _layer(spec: LayerSpec, ground: Quantity | None, polarity: int) -> Piezo | Elastic:
    value = {name: quantity.value for name, quantity in spec.values.items()}
    if ground is not None:
        value["thickness"] = ground.value
    if spec.kind == "piezo":
        return Piezo(
            spec.name,
            thickness=value["thickness"].real,
            density=value["density"].real,
            c33D=value["c33D"],
            h33=value["h33"],
            eps33S=value["eps33S"],
            polarity=polarity,
        )
    return Elastic(
        spec.name, thickness=value["thickness"].real, z=value["z"].real, c=value["c"].real, q=value["q"].real
    )


def _half_space(load: LoadSpec) -> HalfSpace:
    return HalfSpace(load.name, z=load.z.re)


def stack_of(build: Build, step: Step) -> Stack:
    """Return the stack of a step at its nominal values, without the effects that the build states."""
    ground = {layer: thickness for layer, (_, thickness) in build.reground(step.name).items()}
    polarities = _polarities(build, step)
    return Stack(
        layers=tuple(_layer(build.layer(name), ground.get(name), polarities.get(name, 1)) for name in step.layers),
        back=_half_space(build.back),
        front=_half_space(build.front),
        area=build.area.re,
        connection=build.connection,
        bolt=_bolt(build, step),
    )


def _bolt(build: Build, step: Step) -> Bolt | None:
    bolt = build.bolt
    return Bolt(bolt.behind, bolt.before, bolt.stiffness.re) if bolt and bolt.acts_in(step.layers) else None


def _stiffness(build: Build, steps: Iterable[str]) -> dict[str, Quantity]:
    """Return the stiffness of the bolt by its name in the fit, if it acts in any of these steps."""
    bolt = build.bolt
    if bolt is None or not any(bolt.acts_in(build.step(step).layers) for step in steps):
        return {}
    return {BOLT_STIFFNESS: bolt.stiffness}


def _polarities(build: Build, step: Step) -> dict[str, int]:
    """Return the polarity of each piezo layer of a step relative to the current through it.

    In parallel, neighbours share an electrode, so that current and field alternate in direction from layer to layer.
    """
    piezos = [layer for layer in map(build.layer, step.layers) if layer.kind == "piezo"]
    turn = -1 if build.connection == "parallel" else 1
    return {layer.name: layer.polarity * turn**k for k, layer in enumerate(piezos)}


def layers_of(build: Build, steps: Iterable[str]) -> tuple[LayerSpec, ...]:
    """Return the layers present in any of these steps, back to front."""
    there = {name for step in steps for name in build.step(step).layers}
    return tuple(layer for layer in build.layers if layer.name in there)


def require_constants(build: Build, steps: Iterable[str]) -> None:
    """Raise TaskError if a layer of these steps lacks a constant of its kind.

    A build file cannot; a program that only measures may leave out what it does not know.
    """
    for layer in layers_of(build, steps):
        missing = [name for name in NEEDED[layer.kind] if name not in layer.values]
        if missing:
            raise TaskError(
                f"layer {layer.name!r} of build {build.name!r} has no {', '.join(missing)}; a fit needs "
                f"{', '.join(NEEDED[layer.kind])}"
            )


def nominal_parameters(build: Build) -> dict[str, float]:
    """Return every model parameter of every layer and effect at its nominal value, with `area` and loads."""
    values = {"area": build.area.re} | {name: quantity.re for name, quantity in _loads(build).items()}
    values |= {name: quantity.re for name, quantity in _ground(build, (step.name for step in build.steps)).items()}
    values |= {name: one.re for name, one in _stiffness(build, (step.name for step in build.steps)).items()}
    for layer in build.layers:
        for name, quantity in layer.values.items():
            if name in PIEZO_CONSTANTS:
                values[f"{layer.name}.{name}.re"] = quantity.re
                values[f"{layer.name}.{name}.im"] = quantity.im
            else:
                values[f"{layer.name}.{name}"] = quantity.re
    return values | {name: value for one in effects_of(build) for name, value in one.values.items()}


def _loads(build: Build) -> dict[str, Quantity]:
    """Return the existing loads and their uncertainty, by parameter name.

    A face in air radiates into 413 Rayl only if nothing is near. The air between face and fixture forms a standing
    wave, and its load on the face lies anywhere between zero and more than that; the load of air therefore has its own
    size as uncertainty. It matters: it is 0.15 % of the loss of a Pz27 disk, ten times the uncertainty from noise
    alone.
    """
    loads = {"back.z": build.back, "front.z": build.front}
    return {
        name: replace(load.z, u=load.z.re) if load.name == "air" else load.z
        for name, load in loads.items()
        if load.z.re > 0
    }


def _blocks(build: Build, steps: Iterable[str]) -> tuple[Block, ...]:
    layers, steps = layers_of(build, steps), tuple(steps)
    blocks: list[Block] = [positive("area"), *(hardly_negative(name, load.re) for name, load in _loads(build).items())]
    followers: dict[str, list[str]] = {}
    for layer in layers:
        for name in ("density", "thickness") if layer.kind == "piezo" else (*ELASTIC_CONSTANTS, "thickness"):
            quantity, full = layer.values[name], f"{layer.name}.{name}"
            if quantity.same_as is not None:
                followers.setdefault(quantity.same_as, []).append(full)
            else:
                blocks.append(_in_bounds(_unbounded(full, quantity), full, quantity))
    blocks += _ceramics(build, layers)
    for name, quantity in (_ground(build, steps) | _stiffness(build, steps)).items():
        blocks.append(_in_bounds(positive(name), name, quantity))
    blocks += [block for one in effects_of(build, steps) for block in one.blocks]
    return _with_ties(build, blocks, followers)


_THIN = 1e-2
"""Part of its nominal thickness below which a layer has vanished."""


def without_vanished(build: Build, values: Mapping[str, float]) -> Mapping[str, float]:
    """Return the values with layers that a wrong model has driven to nothing as thick as the build states them.

    The logarithm of a thickness has no way back from there.
    """
    nominal = nominal_parameters(build)
    gone = {name for name in values if name.endswith(".thickness") and values[name] < _THIN * nominal.get(name, 0.0)}
    return {**values, **{name: nominal[name] for name in gone}}


def _unbounded(name: str, quantity: Quantity) -> Block:
    """Return the block of a positive constant; a quality factor stays above critical damping, if the build's is."""
    wave = name.endswith(".q") and quantity.re > 2 * LEAST_Q and quantity.bounds is None
    return quality(name) if wave else positive(name)


def _in_bounds(block: Block, name: str, quantity: Quantity) -> Block:
    return between_bounds(block, {name: quantity.bounds} if quantity.bounds else {})


def between_bounds(block: Block, bounds: Mapping[str, tuple[float, float]]) -> Block:
    """Return the block within bounds (SI); all constants move as logarithms except h33, which may have any sign."""
    if not bounds:
        return block
    moving = {name: (to_h33(low), to_h33(high)) for name, (low, high) in bounds.items() if name.endswith(".h33")}
    moving |= {
        name: (float(np.log(low)), float(np.log(high))) for name, (low, high) in bounds.items() if name not in moving
    }
    return bounded(block, moving)


def _with_ties(build: Build, blocks: list[Block], followers: Mapping[str, list[str]]) -> tuple[Block, ...]:
    """Return the blocks, each leader in one block with the constants tied to it; the leader's layer may come later."""
    kept = [block for block in blocks if block.coordinates[0] not in followers]
    for leader, names in followers.items():
        quantity = known_as(build, leader)
        kept.append(_in_bounds(shared(_unbounded(leader, quantity), [(name,) for name in names]), leader, quantity))
    return tuple(kept)


def _ceramics(build: Build, layers: Sequence[LayerSpec]) -> list[Block]:
    """Return the block of c33D, h33 and eps33S of each ceramic: one for all layers that share it."""
    of: dict[str, list[str]] = {}
    for layer in layers:
        if layer.kind == "piezo":
            leader = ceramic_leader(layer)
            of.setdefault(leader or layer.name, []).extend([layer.name] if leader else [])
    blocks: list[Block] = []
    for leader, followers in of.items():
        limits = {f"{leader}.{name}": known_as(build, f"{leader}.{name}").bounds for name in PIEZO_CONSTANTS}
        block = between_bounds(thickness_constants(leader), {name: ends for name, ends in limits.items() if ends})
        blocks.append(shared(block, [thickness_constants(name).parameters for name in followers]))
    return blocks


def ceramic_leader(layer: LayerSpec) -> str | None:
    """Return the layer whose c33D, h33 and eps33S this piezo layer shares, or None if it has its own."""
    leader = layer.values["c33D"].same_as
    return None if leader is None else leader.partition(".")[0]


def known_as(build: Build, name: str) -> Quantity:
    """Return the value and uncertainty of a constant in a build by its full name (`glue1.z`). Raises KeyError."""
    layer, _, constant = name.partition(".")
    return build.layer(layer).values[constant]


def is_held(quantity: Quantity, piezo_constant: bool) -> bool:
    """Return whether a quantity is held: a bare number of the build file, or an exact library value.

    The thickness-mode constants of a library ceramic are always free: no data sheet states them well enough to hold
    them.
    """
    return quantity.u == 0 and (quantity.source == "build.toml" or not piezo_constant)


def _free_by_default(build: Build, steps: Iterable[str]) -> set[str]:
    steps = tuple(steps)
    layers, ground = layers_of(build, steps), _ground(build, steps) | _stiffness(build, steps)
    free = {name for name, quantity in ground.items() if quantity.u > 0}
    free |= {name for name, quantity in _loads(build).items() if quantity.u > 0}
    free |= set() if build.area.u == 0 else {"area"}
    free |= {name for one in effects_of(build, steps) for name in one.free}
    for layer in layers:
        names = PIEZO_CONSTANTS if layer.kind == "piezo" else ELASTIC_CONSTANTS
        for name in (*names, "thickness", "density"):
            if name in layer.values and not is_held(layer.values[name], name in PIEZO_CONSTANTS):
                full = layer.values[name].same_as or f"{layer.name}.{name}"
                free |= {full, f"{full}.loss"}
    return free


def _free_by_name(names: Iterable[str], blocks: tuple[Block, ...]) -> set[str]:
    known = {coordinate.removesuffix(".loss") for block in blocks for coordinate in block.coordinates}
    tied = {follower: leader for block in blocks for follower, leader in _tied_in(block)}
    for name in names:
        if name in tied:
            raise TaskError(f"cannot free {name!r}: it is tied to {tied[name]}; free that")
        if name not in known:
            raise TaskError(f"cannot free {name!r}: this build has {', '.join(sorted(known))}")
    return {variant for name in names for variant in (name, f"{name}.loss")}


def _tied_in(block: Block) -> Iterable[tuple[str, str]]:
    """Yield each constant of other layers that a block determines, and the constant of its own that it equals."""
    own = block.coordinates[0].partition(".")[0]
    for name in block.parameters:
        layer, _, constant = name.removesuffix(".re").removesuffix(".im").partition(".")
        if layer != own:
            yield f"{layer}.{constant}", f"{own}.{constant}"


def coordinates_of(
    build: Build, steps: Iterable[str], start: Mapping[str, float], free: tuple[str, ...] | None
) -> Coordinates:
    """Return the coordinates of a fit over these steps.

    `free` names constants (`disk.c33D`, `glue1.thickness`); None frees all that have an uncertainty. Raises TaskError
    for a name the build does not have.
    """
    steps = tuple(steps)
    blocks = _blocks(build, steps)
    moving = _free_by_default(build, steps) if free is None else _free_by_name(free, blocks)
    return Coordinates(blocks, start, tuple(moving))


def priors_of(build: Build, steps: Iterable[str]) -> tuple[Prior, ...]:
    """Return the priors from build file and material library."""
    steps = tuple(steps)
    known = _loads(build) | {"area": build.area} | _ground(build, steps) | _stiffness(build, steps)
    for layer in layers_of(build, steps):
        known |= {quantity.same_as or f"{layer.name}.{name}": quantity for name, quantity in layer.values.items()}
    priors: list[Prior] = []
    for full, quantity in known.items():
        piezo = full.split(".")[-1] in PIEZO_CONSTANTS
        if quantity.u > 0:
            made = QualityFactor if full.endswith(".q") else Prior
            priors.append(made(f"{full}.re" if piezo else full, quantity.re, quantity.u))
        if quantity.u_im > 0 and piezo and quantity.source == "build.toml":
            priors.append(Prior(f"{full}.im", quantity.im, quantity.u_im))
    of_effects = (prior for one in effects_of(build, steps) for prior in one.priors)
    return (*priors, *of_effects, *weighings_of(build, steps))


def library_losses(build: Build, steps: Iterable[str]) -> tuple[Prior, ...]:
    """Return what the material library says of the losses of the piezoelectric layers of these steps.

    It tells what causes a misfit. No fit is drawn towards it, for a wrong model would give way.
    """
    layers = [layer for layer in layers_of(build, tuple(steps)) if layer.kind == "piezo"]
    known = {f"{layer.name}.{name}": layer.values[name] for layer in layers for name in PIEZO_CONSTANTS}
    return tuple(
        Prior(f"{full}.im", own.im, own.u_im)
        for full, own in known.items()
        if own.u_im > 0 and own.source != "build.toml" and own.same_as is None
    )


def weighings_of(build: Build, steps: Iterable[str]) -> tuple[Weighing, ...]:
    """Return the mass of each of these steps that was weighed, as prior knowledge."""
    weighings: list[Weighing] = []
    for step in (build.step(name) for name in steps):
        if step.mass is None:
            continue
        fitted, ties = renamed(build, step.name), _followed(build)
        densities: list[tuple[str, ...]] = []
        for layer in map(build.layer, step.layers):
            names = ("density",) if layer.kind == "piezo" else ("z", "c")
            densities.append(tuple(ties.get(full, full) for full in (f"{layer.name}.{name}" for name in names)))
        thicknesses = (f"{name}.thickness" for name in step.layers)
        mass, shown = step.mass, f"mass@{step.name}"
        named = tuple(ties.get(full, fitted.get(full, full)) for full in thicknesses)
        weighings.append(Weighing(shown, mass.re, mass.u, tuple(densities), named))
    return tuple(weighings)


def _followed(build: Build) -> dict[str, str]:
    """Return the leader of each tied constant, by full name."""
    values = ((f"{layer.name}.{name}", q.same_as) for layer in build.layers for name, q in layer.values.items())
    return {name: leader for name, leader in values if leader is not None}
