"""Effects stated in a build: part of the model of its steps, with fitted parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar, cast, get_args

import numpy as np

from ....models.base.errors import PzctlError
from ....models.base.model import Model
from ....models.base.names import among
from ....models.build import EffectSpec, Quantity
from ....models.effects import Device, Effect, EffectParameter, Stage, find_effect
from ....models.effects.learned import corrections
from ....models.effects.learned.learned import NAME, learned_law
from ....models.stack import Stack
from ..recording import Prior
from .coordinates import Block, between, linear, positive


class KnownEffectError(PzctlError):
    """An effect of a build that its sample cannot have."""


@dataclass(frozen=True)
class KnownEffect:
    """An effect of a build, with the steps that have it and its parameters there."""

    spec: EffectSpec
    effect: Effect
    steps: tuple[str, ...]
    effect_parameters: tuple[EffectParameter, ...]

    @property
    def parameters(self) -> tuple[tuple[str, EffectParameter], ...]:
        """Full names (`lead-inductance@terminals.inductance`) with the parameters."""
        prefix = f"{self.effect.key}@{self.spec.where}."
        return tuple((prefix + knob.name, knob) for knob in self.effect_parameters)

    @property
    def values(self) -> dict[str, float]:
        """Value of each parameter by full name, SI units."""
        return {name: self.spec.values[knob.name].re for name, knob in self.parameters}

    @property
    def free(self) -> set[str]:
        """Full names of the parameters with an uncertainty."""
        return {name for name, knob in self.parameters if self.spec.values[knob.name].u > 0}

    @property
    def priors(self) -> tuple[Prior, ...]:
        """Value and uncertainty of the free parameters."""
        quantities = ((name, self.spec.values[knob.name]) for name, knob in self.parameters)
        return tuple(Prior(name, quantity.re, quantity.u) for name, quantity in quantities if quantity.u > 0)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The coordinates of its parameters, within their physical limits."""
        return tuple(_block(name, knob, self.spec.values[knob.name]) for name, knob in self.parameters)


def known_effects(specs: Sequence[EffectSpec], stacks: Mapping[str, Stack]) -> tuple[KnownEffect, ...]:
    """Return the effects of a build; `stacks`: nominal stack of each of its steps, in gluing order.

    Several resonances or learned laws can be at one place; the first of them acts innermost.
    Raises KnownEffectError for an effect that this sample cannot have.
    """
    places = [(spec.effect, spec.where) for spec in specs]
    found = tuple(_known(spec, stacks, places[: k + 1].count(places[k])) for k, spec in enumerate(specs))
    for one in found:
        if one.effect.number > 1 and not (one.effect.several or one.spec.effect == NAME):
            raise KnownEffectError(f"{one.effect.name} at {one.spec.where} is given twice; only one is possible there")
    return found


_OfStep = TypeVar("_OfStep", bound=Model)


def with_effects(
    model: _OfStep, step: str, known: Sequence[KnownEffect], nominal: Stack | None = None
) -> _OfStep | Device:
    """Return the model of a step, extended by the effects of this step; `nominal`: its plate, if it is no stack."""
    there = [one for one in known if step in one.steps]
    if not there:
        return model
    device = Device(model, nominal=nominal)
    for one in there:
        values = {knob.name: one.spec.values[knob.name].re for knob in one.effect_parameters}
        device = device.with_effect(one.effect, one.spec.where, values)
    return device


def parameter_key(knob: EffectParameter) -> str:
    """Return a parameter's key in build.toml, which ends in its SI unit: `inductance_H`, `mass_kg_m2`, `shape`."""
    unit = knob.unit.replace("/", "_").replace(" ", "_")
    return knob.name if unit in ("", "1") else f"{knob.name}_{unit}"


def may_be_left_out(knobs: Sequence[EffectParameter]) -> list[EffectParameter]:
    """Return those of an effect's parameters that a build need not state: at an end of their range they do nothing."""
    return [knob for knob in knobs[1:] if knob.null in (knob.lower, knob.upper)]


def completed(spec: EffectSpec, knobs: Sequence[EffectParameter], source: str = "") -> EffectSpec:
    """Return what a build states of an effect, with those of its parameters at null that may be left out."""
    absent = {knob.name: Quantity(knob.null, source=source) for knob in may_be_left_out(knobs)}
    return replace(spec, values={**absent, **spec.values})


def effect_parameters(
    spec: EffectSpec, stacks: Mapping[str, Stack], number: int = 1
) -> tuple[Effect, tuple[EffectParameter, ...]]:
    """Return the effect named in a build, and its parameters at that place. Raises KnownEffectError.

    `number`: which of those of its name at its place it is.
    """
    steps = _steps_of(spec, stacks)
    stack = stacks[steps[-1]]
    effect = _learned(spec, stack, number) if spec.effect == NAME else _of_catalogue(spec).another(number)
    places = {where: None for step in steps for where in effect.places(stacks[step])}
    if spec.where not in places:
        raise KnownEffectError(f"{effect.name}: where is {spec.where!r}; {among(spec.where, list(places))}")
    return effect, effect.effect_parameters(stack, spec.where)


def _steps_of(spec: EffectSpec, stacks: Mapping[str, Stack]) -> tuple[str, ...]:
    for step in spec.steps:
        if step not in stacks:
            raise KnownEffectError(f"{spec.effect}: steps has {step!r}; {among(step, list(stacks))}")
    return spec.steps or tuple(stacks)


def _of_catalogue(spec: EffectSpec) -> Effect:
    effect = find_effect(spec.effect)
    if effect.stage == Stage.ACQUISITION:
        raise KnownEffectError(f"{effect.name} belongs to a sweep, not to a sample; only `diagnose` looks for it")
    return effect


def _learned(spec: EffectSpec, stack: Stack, number: int) -> Effect:
    known = get_args(corrections.OfSample)
    if spec.quantity not in known:
        found = repr(spec.quantity) if spec.quantity else "missing"
        raise KnownEffectError(f"{NAME}: quantity is {found}; {among(spec.quantity, list(known))}")
    place = corrections.Place(spec.where, cast(corrections.OfSample, spec.quantity))
    if place not in corrections.places(stack):
        there = [one.where for one in corrections.places(stack) if one.quantity == spec.quantity]
        raise KnownEffectError(f"{NAME}: where is {spec.where!r}; {among(spec.where, there)}")
    if not 0 <= spec.reference < np.inf:
        raise KnownEffectError(f"{NAME}: reference_Hz is {spec.reference:g}; a frequency above 0 is needed")
    return learned_law(place, spec.law, stack, spec.reference, number)


def _known(spec: EffectSpec, stacks: Mapping[str, Stack], number: int) -> KnownEffect:
    effect, knobs = effect_parameters(spec, stacks, number)
    if not knobs:
        raise KnownEffectError(f"{effect.name} has no size that a fit could use; correct the recording instead")
    keys = {knob.name: parameter_key(knob) for knob in knobs}
    for name in spec.values:
        if name not in keys:
            raise KnownEffectError(f"{effect.name}: {name!r} is none of its parameters: {', '.join(keys)}")
    spec = completed(spec, knobs)
    for knob in knobs:
        if knob.name not in spec.values:
            needed = [keys[one.name] for one in knobs if one not in may_be_left_out(knobs)]
            raise KnownEffectError(f"{effect.name} has no {keys[knob.name]}; it needs {', '.join(needed)}")
        value, u = spec.values[knob.name].re, spec.values[knob.name].u
        if not knob.lower <= value <= knob.upper:
            allowed = f"{knob.lower:g} to {knob.upper:g}" if knob.upper < np.inf else f"{knob.lower:g} or more"
            raise KnownEffectError(f"{effect.name}: {keys[knob.name]} is {value:g}; allowed is {allowed}")
        if not 0 <= u < np.inf:
            raise KnownEffectError(
                f"{effect.name}: {keys[knob.name]} has u = {u:g}; a finite one, 0 or more, is needed"
            )
        if u > 0 and knob.from_nothing and value == 0:
            raise KnownEffectError(
                f"{effect.name}: {keys[knob.name]} is 0 with u = {u:g}; give the value from which the fit is to start"
            )
    steps = tuple(step for step in _steps_of(spec, stacks) if effect.is_in(stacks[step], spec.where))
    return KnownEffect(spec, effect, steps, knobs)


def _block(name: str, knob: EffectParameter, quantity: Quantity) -> Block:
    if quantity.u == 0:
        return linear(name, knob.typical)
    if knob.from_nothing:
        return positive(name)
    if np.isfinite(knob.lower) and np.isfinite(knob.upper):
        return between(name, knob.lower, knob.upper)
    return linear(name, knob.typical)
