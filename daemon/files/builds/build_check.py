"""Checks of a `Build` from a file: names, plan, notes, known effects, and whether its parts fit together."""

import re

from ....models.base.names import NameFault, check_name
from ....models.build import Build
from ....models.metadata import MetadataError, check_metadata
from ....models.sweep_plan import PlanError, SweepPlan
from .build_parts import check_parts
from .build_table import BuildError
from .effects_table import check_effects

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
    for k, layer in enumerate(build.layers):
        _check_name(layer.name, f"{source}: layers[{k}].name", _NAME, "letters, digits and _ + -")
    for k, step in enumerate(build.steps):
        _check_name(step.name, f"{source}: steps[{k}].name", _NAME, "letters, digits and _ + -")
    try:
        check_metadata(build.metadata, f"{source}: measurement")
    except MetadataError as error:
        raise BuildError(str(error)) from None
    check_parts(build, source)
    check_effects(build, source)


def check_build_name(name: str, where: str) -> None:
    """Raise BuildError for a name that no transducer can have; `where` is the place that the error names."""
    _check_name(name, where, _BUILD_NAME, "letters, digits, space and _ + - . inside")


def _check_name(name: str, where: str, pattern: re.Pattern[str], allowed: str) -> None:
    """Refuse a name that cannot be part of a topic, a path, `STEP=FILE` or a parameter's name."""
    try:
        check_name(name, where)
    except NameFault as fault:
        raise BuildError(str(fault)) from None
    if not pattern.fullmatch(name):
        raise BuildError(f"{where} is {name!r}; allowed are {allowed}, beginning with a letter or digit")
