"""A device with effects added: a `Model` with the effects' parameters as additional ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, complex_log
from ...base.copies import changed
from ...base.model import Model
from ...base.names import require
from ...stack import Stack
from .assembly import Assembly, Conditions, ParallelSection
from .effect import Effect, EffectParameter

_STEP = 1e-6
"""Step of derivatives by a parameter, in typical sizes; a one-sided difference is accurate to about as much."""


@dataclass(frozen=True)
class Added:
    """An effect at a place, with its values."""

    effect: Effect
    where: str
    values: Mapping[str, float]
    """By parameter name."""

    @cached_property
    def prefix(self) -> str:
        """Common prefix of its parameters' names."""
        return f"{self.effect.key}@{self.where}."

    @cached_property
    def names(self) -> Mapping[str, str]:
        """Full name of each of its parameters."""
        return {knob: self.prefix + knob for knob in self.values}

    def parameters(self) -> dict[str, float]:
        """Return its values by full parameter name."""
        return {self.names[knob]: value for knob, value in self.values.items()}

    def moved(self, parameters: Mapping[str, float]) -> Self:
        """Return it with its own among these parameters changed."""
        changes = {knob: parameters[name] for knob, name in self.names.items() if name in parameters}
        return changed(self, values={**self.values, **changes}) if changes else self


def small_step(knob: EffectParameter, value: float) -> float:
    """Return the step of a derivative by a parameter, in a direction that stays physical."""
    step = _STEP * knob.typical
    return step if value + step <= knob.upper else -step


def _from_within(added: Sequence[Added]) -> list[Added]:
    """Return effects in the order in which they act, from the inside outwards."""
    return sorted(added, key=lambda one: (one.effect.stage, one.effect.name, one.where, one.effect.number))


@dataclass(frozen=True)
class Device:
    """A stack, or any other model, with effects, as recorded by a sweep under these conditions. Satisfies `Model`.

    Its parameters are the model's and, for each effect, `effect@place.name`: `lead-inductance@terminals.inductance`.
    Effects inside a device need a stack; those outside of it (`outside_effects`) only need an impedance.
    """

    bare: Model
    added: tuple[Added, ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    nominal: Stack | None = None
    """The stack to which the first effect was added; it defines sizes and reference frequencies of effects.

    A model that is no stack needs one of the same capacitance and resonance (`equivalent_plate`).
    """

    @property
    def reference(self) -> Stack:
        """The stack that defines sizes and places of effects."""
        if self.nominal is not None:
            return self.nominal
        if isinstance(self.bare, Stack):
            return self.bare
        raise TypeError(f"{type(self.bare).__name__} is no stack: its effects need a nominal one")

    def parameters(self) -> dict[str, float]:
        """Return the model's parameters and those of the effects."""
        of_effects = (added.parameters() for added in self.added)
        return {
            **self.bare.parameters(),
            **{name: value for parameters in of_effects for name, value in parameters.items()},
        }

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the device with these parameters. Raises KeyError for an unknown name."""
        of_effects = {name: value for name, value in values.items() if name in self._of_effects}
        moved = {name: value for name, value in values.items() if name not in self._of_effects}
        if moved:
            require(moved, self.parameters(), "the device")
        added = tuple(one.moved(of_effects) for one in self.added) if of_effects else self.added
        device = type(self)(self.bare.replace(moved) if moved else self.bare, added, self.conditions, self.nominal)
        device.__dict__.update(_knobs=self._knobs, _of_effects=self._of_effects)
        if not moved:
            device.__dict__["_kept"] = self._as_far_as(added)
        return device

    def with_effect(self, effect: Effect, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the device with an additional effect, its parameters at null unless given."""
        nominal = self.reference
        null = {knob.name: knob.null for knob in effect.parameters_in(self.bare, nominal, where)}
        added = (*self.added, Added(effect, where, {**null, **(values or {})}))
        return replace(self, added=added, nominal=nominal)

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        return self.assembly.impedance(frequency)

    def log_ratio(self, other: "Device", frequency: Frequencies) -> Complexes:
        """Return ln of what is recorded of another device over what is of this one, shape (N,).

        To first order in what recording adds, if both are recorded by sweeps of the same kinds.
        """
        own, its = self.assembly, other.assembly
        recorded = own.as_recorded(its, frequency)
        if recorded is None:
            return complex_log(other.impedance(frequency) / self.impedance(frequency))
        ratio = complex_log(its.steady(frequency) / own.steady(frequency)) + recorded
        return np.conj(ratio) if own.conjugated else ratio

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N).

        Exact for the model's parameters and those of a distribution of thickness; a difference quotient for others of
        effects, on the allowed side of a limit.
        """
        require(names, self.parameters(), "the device")
        inner = {*self.bare.parameters(), *self.assembly.shaped_by}
        own = [name for name in names if name in inner]
        steady, at_rest = self.assembly.steady_jacobian(frequency, own)
        Z = self.assembly.while_recorded(frequency, steady)
        rows = iter(self.assembly.slopes_recorded(frequency, own, at_rest))
        mirror = np.conj if self.assembly.conjugated else np.asarray
        derivatives = [
            mirror(next(rows) if name in inner else self._by_knob(name, frequency, steady)) for name in names
        ]
        return Z, np.array(derivatives, np.complex128).reshape(len(names), frequency.size)

    def unevenness(self, frequency: Frequencies, layer: str, spread: float) -> Complexes:
        """Return the change of ln Z by a layer of uneven thickness, shape (N,); see `Assembly.unevenness`."""
        change = self.assembly.unevenness(frequency, layer, spread)
        return np.conj(change) if self.assembly.conjugated else change

    @property
    def assembly(self) -> Assembly:
        """The device with all its effects, ready to be evaluated."""
        return self._assemblies[-1]

    @cached_property
    def _assemblies(self) -> tuple[Assembly, ...]:
        """The bare device followed by the device with one more effect each, from the inside outwards.

        Assemblies of the device that this one was made from are reused, since they cache their results.
        """
        assemblies: list[Assembly] = list(self.__dict__.get("_kept", ()))
        if not assemblies:
            inner = self.bare
            parts, whole = ((ParallelSection(1.0, inner),), None) if isinstance(inner, Stack) else ((), inner)
            assemblies = [Assembly(parts, self.reference, whole, conditions=self.conditions)]
        for added_effect in _from_within(self.added)[len(assemblies) - 1 :]:
            assemblies.append(
                added_effect.effect.extend(assemblies[-1], added_effect.where, self._within_limits(added_effect))
            )
        return tuple(assemblies)

    def _as_far_as(self, added: Sequence[Added]) -> tuple[Assembly, ...]:
        """Return the assemblies up to the first effect that differs in `added`."""
        pairs = enumerate(zip(_from_within(self.added), _from_within(added), strict=True), 1)
        same = next((k for k, (before, after) in pairs if before is not after), len(added) + 1)
        return self._assemblies[:same]

    @cached_property
    def _of_effects(self) -> frozenset[str]:
        """Names of the effects' parameters."""
        return frozenset(name for added_effect in self.added for name in added_effect.parameters())

    @cached_property
    def _knobs(self) -> dict[str, dict[str, EffectParameter]]:
        """Parameters of the effects, by prefix of the effect and name."""
        nominal = self.reference
        return {
            added_effect.prefix: {
                knob.name: knob for knob in added_effect.effect.parameters_in(self.bare, nominal, added_effect.where)
            }
            for added_effect in self.added
        }

    def _within_limits(self, added_effect: Added) -> dict[str, float]:
        """Return the values of an effect, clipped to their limits."""
        effect_parameters = self._knobs[added_effect.prefix]
        return {
            name: min(max(value, effect_parameters[name].lower), effect_parameters[name].upper)
            if name in effect_parameters
            else value
            for name, value in added_effect.values.items()
        }

    def _by_knob(self, name: str, frequency: Frequencies, steady: Impedances) -> Complexes:
        """Return d ln Z / d parameter, in a physical direction; 0 for a flag. Before the recording is conjugated."""
        added_effect = next(added_effect for added_effect in self.added if name.startswith(added_effect.prefix))
        parameter = name.removeprefix(added_effect.prefix)
        knob, value = self._knobs[added_effect.prefix].get(parameter), added_effect.values[parameter]
        if knob is None:
            return np.zeros_like(steady)
        step = small_step(knob, value)
        moved, own = self.replace({name: value + step}).assembly, self.assembly
        effect, change = added_effect.effect, None
        if effect.of_laws or effect.lies_on_faces is not None:
            change = (own.moved_by_laws if effect.of_laws else own.moved_by_loads)(frequency, moved)
        if change is None:
            change = moved.steady(frequency) / steady - 1
        recorded = own.as_recorded(moved, frequency)
        if recorded is None:
            factors = moved.while_recorded(frequency, steady) / own.while_recorded(frequency, steady)
            recorded = (np.conj(factors) if own.conjugated else factors) - 1
        return (change + recorded) / complex(step)
