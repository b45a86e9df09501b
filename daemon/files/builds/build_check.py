"""Checks of a `Build` from any source: names, kinds, and steps that can be glued in their order."""

import re
from collections.abc import Iterable

from ....models.base.names import NameFault, check_name
from ....models.build import Build, Step
from ....models.metadata import MetadataError, check_metadata
from ....models.sweep_plan import PlanError, SweepPlan
from .build_table import BuildError
from .effects_table import check_effects
from .limits_table import check_limits

RESERVED = ("area", "back", "front", "lead")
"""Prefixes of parameters that belong to no layer (`back.z`, `lead.inductance`)."""

_BUILD_NAME = re.compile(r"\w(?:[\w +.-]*[\w+-])?")
_NAME = re.compile(r"\w[\w+-]*")


def needed_plan(build: Build, source: str) -> SweepPlan:
    """Return how a transducer is to be measured. Raises BuildError, which calls the file `source`."""
    if build.plan is None:
        example = "segments = [ { start_MHz = 1, stop_MHz = 6, points = 801 } ]"
        raise BuildError(f"{source}: the file has no [sweep], which says how to measure; write {example} there")
    return build.plan


def check_build(build: Build, source: str) -> None:
    """Check the conditions that involve several keys. Raises BuildError, which calls the file `source`."""
    check_build_name(build.name, f"{source}: name")
    if build.plan is not None and build.limits is not None:
        try:
            build.limits.check(build.plan, "[sample]")
        except PlanError as error:
            raise BuildError(f"{source}: {error}") from None
    _check_layers(build, source)
    check_limits(build, source)
    try:
        check_metadata(build.metadata, f"{source}: measurement")
    except MetadataError as error:
        raise BuildError(str(error)) from None
    _check_unique((step.name for step in build.steps), source, "steps")
    if not build.steps:
        raise BuildError(f"{source}: steps is empty; at least one [[steps]] is needed")
    known = [layer.name for layer in build.layers]
    piezos = [layer.name for layer in build.piezos]
    for k, step in enumerate(build.steps):
        where = f"{source}: steps[{k}]"
        _check_name(step.name, f"{where}.name", _NAME, "letters, digits and _ + -")
        where = f"{where}.layers (of step {step.name!r})"
        _check_step(step, known, piezos, where)
        for name in step.reground:
            if name not in step.layers:
                raise BuildError(f"{source}: steps[{k}].reground names {name!r}; the step has {', '.join(step.layers)}")
            if k == 0 or name not in build.steps[k - 1].layers:
                raise BuildError(
                    f"{source}: steps[{k}].reground names {name!r}, which is new in this step; give the thickness of a "
                    "new layer in [[layers]], and reground only for layers of the step before"
                )
        before = build.steps[k - 1] if k else step
        gone = [name for name in before.layers if name not in step.layers]
        if gone:
            raise BuildError(
                f"{where} lacks {gone[0]}, which the step before ({before.name}) has; list the steps in gluing order, "
                "each with all layers of the one before"
            )
    _check_bolt(build, known, source)
    check_effects(build, source)


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


def check_build_name(name: str, where: str) -> None:
    """Raise BuildError for a name that no transducer can have; `where` is the place that the error names."""
    _check_name(name, where, _BUILD_NAME, "letters, digits, space and _ + - . inside")


def _check_layers(build: Build, source: str) -> None:
    for k, layer in enumerate(build.layers):
        where = f"{source}: layers[{k}].name"
        _check_name(layer.name, where, _NAME, "letters, digits and _ + -")
        if layer.name in RESERVED:
            raise BuildError(f"{where} is {layer.name!r}, which is reserved; give another name")
    _check_unique((layer.name for layer in build.layers), source, "layers")
    if not build.piezos:
        raise BuildError(f'{source}: layers has no piezo layer; at least one layer of kind = "piezo" is needed')
    for k, layer in enumerate(build.layers):
        if layer.polarity not in (1, -1) or (layer.polarity == -1 and layer.kind != "piezo"):
            raise BuildError(
                f"{source}: layers[{k}].polarity is {layer.polarity}; 1 or -1 is needed for a piezo layer, 1 for others"
            )


def _check_step(step: Step, known: list[str], piezos: list[str], where: str) -> None:
    for name in step.layers:
        if name not in known:
            raise BuildError(f"{where} names {name!r}; the layers are {', '.join(known)}")
    if not set(piezos) & set(step.layers):
        raise BuildError(f"{where} lacks {' and '.join(piezos)}; without a piezo layer there is nothing to measure")
    order = [known.index(name) for name in step.layers]
    if sorted(set(order)) != order:
        right = ", ".join(name for name in known if name in step.layers)
        raise BuildError(
            f"{where} is {', '.join(step.layers)}; name each layer once, in the order of [[layers]]: {right}"
        )


def _check_name(name: str, where: str, pattern: re.Pattern[str], allowed: str) -> None:
    """Refuse a name that cannot be part of a topic, a path, `STEP=FILE` or a parameter's name."""
    try:
        check_name(name, where)
    except NameFault as fault:
        raise BuildError(str(fault)) from None
    if not pattern.fullmatch(name):
        raise BuildError(f"{where} is {name!r}; allowed are {allowed}, beginning with a letter or digit")


def _check_unique(names: Iterable[str], source: str, what: str) -> None:
    first: dict[str, int] = {}
    for k, name in enumerate(names):
        if name in first:
            raise BuildError(f"{source}: {what}[{k}].name is {name!r}, which {what}[{first[name]}] has already")
        first[name] = k
