"""Checks of a `Build` from any source: names, kinds, and steps that can be glued in their order."""

import re
from collections.abc import Iterable

from ....models.base.names import NameFault, check_name
from ....models.build import Build, Step
from ....models.metadata import MetadataError, check_metadata
from ....models.sweep_plan import PlanError
from .build_table import BuildError
from .effects_table import check_effects
from .limits_table import check_limits

RESERVED = ("area", "back", "front", "lead")
"""Prefixes of parameters that belong to no layer (`back.z`, `lead.inductance`)."""

_BUILD_NAME = re.compile(r"\w(?:[\w +.-]*[\w+-])?")
_NAME = re.compile(r"\w[\w+-]*")


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
    piezo = next(layer.name for layer in build.layers if layer.kind == "piezo")
    for k, step in enumerate(build.steps):
        where = f"{source}: steps[{k}]"
        _check_name(step.name, f"{where}.name", _NAME, "letters, digits and _ + -")
        where = f"{where}.layers (of step {step.name!r})"
        _check_step(step, known, piezo, where)
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
    check_effects(build, source)


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
    piezos = [layer.name for layer in build.layers if layer.kind == "piezo"]
    if len(piezos) != 1:
        number = f"{len(piezos)} piezo layers ({', '.join(piezos)})" if piezos else "no piezo layer"
        raise BuildError(f'{source}: layers has {number}; exactly one layer of kind = "piezo" is needed')


def _check_step(step: Step, known: list[str], piezo: str, where: str) -> None:
    for name in step.layers:
        if name not in known:
            raise BuildError(f"{where} names {name!r}; the layers are {', '.join(known)}")
    if piezo not in step.layers:
        raise BuildError(f"{where} lacks {piezo}; without its piezo layer there is nothing to measure")
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
