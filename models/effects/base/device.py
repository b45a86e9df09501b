"""A stack with effects added: a `Model` whose further parameters are the effects' parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances
from ...base.names import require
from ...stack import Stack
from .assembly import Assembly, Conditions, ParallelSection
from .effect import Effect, EffectParameter, Stage

_STEP = 1e-6
"""Step of derivatives by a parameter, in its typical size: a one-sided difference is right to about as much."""


@dataclass(frozen=True)
class Added:
    """An effect at a place with its values."""

    effect: Effect
    where: str
    values: Mapping[str, float]
    """By parameter."""

    @property
    def prefix(self) -> str:
        """What its parameters' names begin with."""
        return f"{self.effect.name}@{self.where}."

    def parameters(self) -> dict[str, float]:
        """Return its values by the names that a model's parameters have."""
        return {self.prefix + knob: value for knob, value in self.values.items()}

    def moved(self, parameters: Mapping[str, float]) -> Self:
        """Return it with those of the parameters that are its own."""
        own = {name.removeprefix(self.prefix): v for name, v in parameters.items() if name.startswith(self.prefix)}
        return type(self)(self.effect, self.where, {**self.values, **own}) if own else self


def small_step(knob: EffectParameter, value: float) -> float:
    """Return the step of a derivative by a parameter, into the side that is physical."""
    step = _STEP * knob.typical
    return step if value + step <= knob.upper else -step


def _from_within(added: Sequence[Added]) -> list[Added]:
    """Return effects in the order in which they act."""
    return sorted(added, key=lambda one: (one.effect.stage, one.effect.name, one.where))


@dataclass(frozen=True)
class Device:
    """A stack with effects, as a sweep under these conditions records it. Satisfies `Model`.

    Parameters are the stack's and, for each effect, `effect@place.name`: `lead-inductance@terminals.inductance`.
    """

    bare: Stack
    added: tuple[Added, ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    nominal: Stack | None = None
    """The stack to which the first effect was added; sizes and reference frequencies of effects are taken from it."""

    def parameters(self) -> dict[str, float]:
        """Return the stack's parameters and those of the effects."""
        own = (one.parameters() for one in self.added)
        return {**self.bare.parameters(), **{name: value for of_one in own for name, value in of_one.items()}}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the device with these parameters. Raises KeyError for a name it does not have."""
        effect_parameters = {name for one in self.added for name in one.parameters()}
        moved = {name: value for name, value in values.items() if name not in effect_parameters}
        if moved:
            require(moved, self.parameters(), "the device")
        added = tuple(one.moved(values) for one in self.added)
        made = type(self)(self.bare.replace(moved) if moved else self.bare, added, self.conditions, self.nominal)
        made.__dict__["_knobs"] = self._knobs
        if not moved:
            made.__dict__["_kept"] = self._as_far_as(added)
        return made

    def with_effect(self, effect: Effect, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the device with one effect more, its parameters at null unless given."""
        nominal = self.nominal or self.bare
        null = {knob.name: knob.null for knob in effect.effect_parameters(nominal, where)}
        added = (*self.added, Added(effect, where, {**null, **(values or {})}))
        return replace(self, added=added, nominal=nominal)

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        return self._assembly.impedance(frequency)

    def steady_impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), as a sweep without end would record it."""
        Z = self._assembly.steady(frequency)
        return np.conj(Z) if self._assembly.conjugated else Z

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N).

        Exact by the stack's parameters; by parameters from one difference, on the allowed side of a limit.
        Effects of the sweep are small: derivatives by other parameters are those of the steady device.
        """
        require(names, self.parameters(), "the device")
        own = self.bare.parameters()
        steady, slopes = self._assembly.steady_jacobian(frequency, [name for name in names if name in own])
        Z = self._assembly.while_recorded(frequency, steady)
        rows = iter(slopes)
        mirror = np.conj if self._assembly.conjugated else np.asarray
        at_rest = mirror(steady)
        made = [mirror(next(rows)) if name in own else self._by_knob(name, frequency, at_rest, Z) for name in names]
        return Z, np.array(made, np.complex128).reshape(len(names), frequency.size)

    @property
    def _assembly(self) -> Assembly:
        return self._assemblies[-1]

    @cached_property
    def _assemblies(self) -> tuple[Assembly, ...]:
        """The bare device and, with one effect more each, from within outwards, the device.

        Those that a device was made with are kept: they know what they answered.
        """
        made: list[Assembly] = list(self.__dict__.get("_kept", ()))
        if not made:
            made = [Assembly((ParallelSection(1.0, self.bare),), self.nominal or self.bare, conditions=self.conditions)]
        for one in _from_within(self.added)[len(made) - 1 :]:
            made.append(one.effect.extend(made[-1], one.where, self._within_limits(one)))
        return tuple(made)

    def _as_far_as(self, added: Sequence[Added]) -> tuple[Assembly, ...]:
        """Return the assemblies up to the first effect that is another one in `added`."""
        pairs = enumerate(zip(_from_within(self.added), _from_within(added), strict=True), 1)
        same = next((k for k, (mine, its) in pairs if mine is not its), len(added) + 1)
        return self._assemblies[:same]

    @cached_property
    def _knobs(self) -> dict[str, dict[str, EffectParameter]]:
        """The parameters of the effects, by the prefix of the effect and their name."""
        nominal = self.nominal or self.bare
        return {
            one.prefix: {knob.name: knob for knob in one.effect.effect_parameters(nominal, one.where)}
            for one in self.added
        }

    def _within_limits(self, one: Added) -> dict[str, float]:
        """Return the values of an effect: beyond a limit it is as it is at the limit."""
        effect_parameters = self._knobs[one.prefix]
        return {
            name: min(max(value, effect_parameters[name].lower), effect_parameters[name].upper)
            if name in effect_parameters
            else value
            for name, value in one.values.items()
        }

    def _by_knob(self, name: str, frequency: Frequencies, at_rest: Impedances, Z: Impedances) -> Complexes:
        """Return d ln Z / d parameter, towards the physical side; 0 for a flag. `at_rest` is the steady impedance."""
        one = next(one for one in self.added if name.startswith(one.prefix))
        own = name.removeprefix(one.prefix)
        knob, value = self._knobs[one.prefix].get(own), one.values[own]
        if knob is None:
            return np.zeros_like(Z)
        step = small_step(knob, value)
        moved = self.replace({name: value + step})
        if one.effect.stage is Stage.ACQUISITION:
            return (moved.impedance(frequency) / Z - 1) / complex(step)
        return (moved.steady_impedance(frequency) / at_rest - 1) / complex(step)
