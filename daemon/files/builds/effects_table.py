"""The sections [[effects]] of build.toml: known effects of the sample.

[[effects]]
effect = "lead-inductance"                    # a name of `pzctl diagnose`, or "learned"
where = "terminals"                           # as `pzctl diagnose` says it
inductance_H = { value = 5.3e-8, u = 1e-9 }   # its parameters with their SI units; one with u is fitted
"""

import json
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

from ....fitters.engine.parameters.assembly import effects_of, stack_of
from ....fitters.engine.parameters.known_effects import completed, effect_parameters, parameter_key
from ....fitters.user_effects import UserEffectError, user_effects
from ....models.base.errors import PzctlError
from ....models.build import Build, EffectSpec, Quantity
from .build_table import BuildError, Table
from .file_keys import EFFECT_ENTRIES, Key


def with_effects(build: Build, tables: tuple[Table, ...]) -> Build:
    """Return the build with the effects of these sections. Raises BuildError."""
    return replace(build, effects=tuple(_effect(build, table) for table in tables))


def _effect(build: Build, table: Table) -> EffectSpec:
    spec = EffectSpec(
        effect=table.string("effect"),
        where=table.string("where"),
        values={},
        steps=table.strings("steps") if "steps" in table.data else (),
        quantity=table.string("quantity") if "quantity" in table.data else "",
        law=table.string("law") if "law" in table.data else "",
        reference=table.quantity("reference_Hz", Key("reference_Hz", 1.0)).re if "reference_Hz" in table.data else 0.0,
    )
    try:
        _, knobs = effect_parameters(spec, {step.name: stack_of(build, step) for step in build.steps})
    except PzctlError as error:
        raise BuildError(f"{table.source}: {table.path}: {_as_own(spec.effect) or error}") from None
    keys = {parameter_key(knob): knob.name for knob in knobs}
    table.only((*EFFECT_ENTRIES, *keys))
    given = {name: _quantity(table, key) for key, name in keys.items() if key in table.data}
    return completed(replace(spec, values=given), knobs, "build.toml")


def _as_own(name: str) -> str:
    """Return how a build states a law of the user's own catalogue; empty for another name."""
    with suppress(UserEffectError):  # of a file there that has nothing to do with this build
        for own in user_effects():
            if own.name == name:
                stated = ", ".join(f"{key} = {json.dumps(value)}" for key, value in own.stated.items())
                return f"effect {name!r} is a law of your own catalogue; a build states it as {stated}"
    return ""


def _quantity(table: Table, key: str) -> Quantity:
    value = table.data[key]
    if isinstance(value, dict):
        inner = Table(cast("dict[str, Any]", value), table.source, table.key(key))
        inner.only(("value", "u"))
        if "value" not in inner.data:
            raise inner.missing("value", f"write {key} = {{ value = ..., u = ... }}")
    return table.quantity(key, Key("parameter", 1.0))  # its limits are those of its effect, not of a constant


def check_effects(build: Build, source: str) -> None:
    """Raise BuildError for an effect that this sample cannot have."""
    try:
        effects_of(build)
    except PzctlError as error:
        raise BuildError(f"{source}: effects: {error}") from None
