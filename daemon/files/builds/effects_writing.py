"""Writes effects found by a diagnosis to the end of a build file."""

from pathlib import Path

from ....fitters.engine.parameters.assembly import stack_of
from ....fitters.engine.parameters.known_effects import effect_parameters, parameter_key
from ....models.build import Build, EffectSpec
from .build_file import parse_build
from .build_table import BuildError


def append_effects(path: Path, specs: tuple[EffectSpec, ...]) -> str:
    """Append effects to a build file, without other changes to it; return a sentence on it. Raises BuildError."""
    try:
        before = path.read_text(encoding="utf-8-sig")
        build = parse_build(before, str(path))
        text = before.rstrip() + "\n" + effects_text(specs, build)
        parse_build(text, str(path))
        new = path.with_name(f"{path.name}.new")
        new.write_text(text, encoding="utf-8")
        new.replace(path)
    except OSError as error:
        raise BuildError(f"{path}: the effects cannot be written: {error.strerror or error}") from None
    names = ", ".join(f"{spec.effect} at {spec.where}" for spec in specs)
    return f"written to {path}: {names}; `pzctl fit` uses it"


def effects_text(specs: tuple[EffectSpec, ...], build: Build) -> str:
    """Return the sections of these effects in a build file."""
    return "".join(_section(spec, build) for spec in specs)


def _section(spec: EffectSpec, build: Build) -> str:
    """Return the section of an effect as TOML."""
    _, knobs = effect_parameters(spec, {step.name: stack_of(build, step) for step in build.steps})
    steps = ", ".join(f'"{step}"' for step in spec.steps)
    lines = ["", "[[effects]]", f'effect = "{spec.effect}"', f'where = "{spec.where}"']
    lines += [f"steps = [{steps}]"] if steps else []
    lines += [f'{key} = "{value}"' for key, value in (("quantity", spec.quantity), ("law", spec.law)) if value]
    lines += [f"reference_Hz = {spec.reference:.9g}"] if spec.reference else []
    for knob in (one for one in knobs if one.name in spec.values):
        value = spec.values[knob.name]
        lines.append(f"{parameter_key(knob)} = {{ value = {value.re:.9g}, u = {value.u:.3g} }}")
    return "\n".join([*lines, ""])
