"""Whether the parts of a build fit together, wherever it comes from: its layers, steps, ties, bolt and limits."""

from collections.abc import Iterable, Mapping
from itertools import pairwise

from ....models.build import Build, Step
from .build_table import BuildError
from .limits_table import check_limits

MOST_LAYERS = 500
MOST_STEPS = 500
"""Far more than anybody glues; what is compared pair by pair stays short."""

RESERVED = ("area", "back", "front", "lead")
"""Prefixes of parameters that belong to no layer (`back.z`, `lead.inductance`)."""


def check_parts(build: Build, source: str) -> None:
    """Check the conditions that involve several parts. Raises BuildError, which calls the build `source`."""
    for what, parts, most in (("layers", build.layers, MOST_LAYERS), ("steps", build.steps, MOST_STEPS)):
        if len(parts) > most:
            raise BuildError(f"{source}: {len(parts)} {what}; at most {most} are allowed")
    _check_hole(build, source)
    _check_layers(build, source)
    check_limits(build, source)
    _check_unique((step.name for step in build.steps), source, "steps")
    if not build.steps:
        raise BuildError(f"{source}: steps is empty; at least one [[steps]] is needed")
    known = {layer.name: k for k, layer in enumerate(build.layers)}
    piezos = [layer.name for layer in build.piezos]
    for k, step in enumerate(build.steps):
        _check_step(step, known, piezos, f"{source}: steps[{k}].layers (of step {step.name!r})")
    for k, (before, step) in enumerate(pairwise((Step("", ()), *build.steps))):
        _check_order(before, step, f"{source}: steps[{k}]")
    _check_bolt(build, list(known), source)


def _check_hole(build: Build, source: str) -> None:
    hole, outer = build.hole_diameter, build.diameter
    if hole is None:
        return
    if outer is None:
        raise BuildError(f"{source}: hole_diameter is given and no diameter; a ring needs both")
    if not 0 < hole.re < outer.re:
        raise BuildError(
            f"{source}: hole_diameter_mm is {1e3 * hole.re:.4g}; more than 0 and less than {1e3 * outer.re:.4g}, the "
            "diameter, is needed"
        )


def _check_layers(build: Build, source: str) -> None:
    for k, layer in enumerate(build.layers):
        if layer.name in RESERVED:
            raise BuildError(f"{source}: layers[{k}].name is {layer.name!r}, which is reserved; give another name")
    _check_unique((layer.name for layer in build.layers), source, "layers")
    if not build.piezos:
        raise BuildError(f'{source}: layers has no piezo layer; at least one layer of kind = "piezo" is needed')
    for k, layer in enumerate(build.layers):
        if layer.polarity not in (1, -1) or (layer.polarity == -1 and layer.kind != "piezo"):
            raise BuildError(
                f"{source}: layers[{k}].polarity is {layer.polarity}; 1 or -1 is needed for a piezo layer, 1 for others"
            )


def _check_step(step: Step, known: Mapping[str, int], piezos: list[str], where: str) -> None:
    for name in step.layers:
        if name not in known:
            raise BuildError(f"{where} names {name!r}; the layers are {', '.join(known)}")
    if not set(piezos) & set(step.layers):
        raise BuildError(f"{where} lacks {' and '.join(piezos)}; without a piezo layer there is nothing to measure")
    order = [known[name] for name in step.layers]
    if sorted(set(order)) != order:
        right = ", ".join(name for name in known if name in step.layers)
        raise BuildError(
            f"{where} is {', '.join(step.layers)}; name each layer once, in the order of [[layers]]: {right}"
        )


def _check_order(before: Step, step: Step, where: str) -> None:
    """Check a step against the one before it, which has no layers before the first one."""
    there, now = set(before.layers), set(step.layers)
    for name in step.reground:
        if name not in now:
            raise BuildError(f"{where}.reground names {name!r}; the step has {', '.join(step.layers)}")
        if name not in there:
            raise BuildError(
                f"{where}.reground names {name!r}, which is new in this step; give the thickness of a "
                "new layer in [[layers]], and reground only for layers of the step before"
            )
    gone = [name for name in before.layers if name not in now]
    if gone:
        raise BuildError(
            f"{where}.layers (of step {step.name!r}) lacks {gone[0]}, which the step before ({before.name}) has; list "
            "the steps in gluing order, each with all layers of the one before"
        )


def _check_bolt(build: Build, known: list[str], source: str) -> None:
    bolt = build.bolt
    if bolt is None:
        return
    where, ends = f"{source}: bolt.between", (bolt.behind, bolt.before)
    for name in ends:
        if name not in known:
            raise BuildError(f"{where} names {name!r}; the layers are {', '.join(known)}")
    inside = known[known.index(bolt.behind) + 1 : known.index(bolt.before)]
    if not set(inside) & {layer.name for layer in build.piezos}:
        says = "a piezo layer must lie between them, and the one further back comes first"
        raise BuildError(f"{where} is {', '.join(ends)}; {says}")
    if "bolt" in known:
        raise BuildError(f"{source}: a layer is called 'bolt', as the section [bolt] is; give the layer another name")


def _check_unique(names: Iterable[str], source: str, what: str) -> None:
    first: dict[str, int] = {}
    for k, name in enumerate(names):
        if name in first:
            raise BuildError(f"{source}: {what}[{k}].name is {name!r}, which {what}[{first[name]}] has already")
        first[name] = k
