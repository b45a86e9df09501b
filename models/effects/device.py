"""A stack with effects added: a `Model` whose further parameters are the effects' knobs."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from ..arrays import Complexes, Frequencies, Impedances
from ..named import require
from ..stack import Stack
from .assembly import Assembly, Conditions, Part
from .effect import Effect, Knob, Stage

_STEP = 1e-6
"""Step of derivatives by a knob, in its typical size: a one-sided difference is right to about as much."""


@dataclass(frozen=True)
class Added:
    """An effect at a place with its values."""

    effect: Effect
    where: str
    values: Mapping[str, float]
    """By knob."""

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
        return replace(self, values={**self.values, **own})


def small_step(knob: Knob, value: float) -> float:
    """Return the step of a derivative by a knob, into the side that is physical."""
    step = _STEP * knob.typical
    return step if value + step <= knob.upper else -step


@dataclass(frozen=True)
class Device:
    """A stack with effects, as a sweep under these conditions records it. Satisfies `Model`.

    Parameters are the stack's and, for each effect, `effect@place.knob`, as in `lead-inductance@terminals.inductance`.
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
        knobs = {name for one in self.added for name in one.parameters()}
        moved = {name: value for name, value in values.items() if name not in knobs}
        if moved:
            require(moved, self.parameters(), "the device")
        added = tuple(one.moved(values) for one in self.added)
        made = replace(self, bare=self.bare.replace(moved) if moved else self.bare, added=added)
        within = {one.prefix for one in self.added if one.effect.stage < Stage.TERMINALS}
        if not moved and not any(name.startswith(tuple(within)) for name in values):
            made.__dict__["_within"] = self._within  # what it is within is as it was, and knows its admittance
        return made

    def with_effect(self, effect: Effect, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the device with one effect more, its knobs at null unless given."""
        nominal = self.nominal or self.bare
        null = {knob.name: knob.null for knob in effect.knobs(nominal, where)}
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

        Exact by the stack's parameters; by knobs from one difference, on the allowed side of a limit.
        Effects of the sweep are small: all derivatives but those by their own knobs are those of the steady device.
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

    @cached_property
    def _assembly(self) -> Assembly:
        return self._extended(self._within, (one for one in self.added if one.effect.stage >= Stage.TERMINALS))

    @cached_property
    def _within(self) -> Assembly:
        """The device behind its terminals."""
        alone = Assembly((Part(1.0, self.bare),), self.nominal or self.bare, conditions=self.conditions)
        return self._extended(alone, (one for one in self.added if one.effect.stage < Stage.TERMINALS))

    def _extended(self, assembly: Assembly, added: Iterable[Added]) -> Assembly:
        for one in sorted(added, key=lambda one: (one.effect.stage, one.effect.name, one.where)):
            assembly = one.effect.extend(assembly, one.where, self._within_limits(one))
        return assembly

    def _within_limits(self, one: Added) -> dict[str, float]:
        """Return the values of an effect: beyond a limit it is as it is at the limit."""
        knobs = {knob.name: knob for knob in one.effect.knobs(self.nominal or self.bare, one.where)}
        limits = {name: (knobs[name].lower, knobs[name].upper) for name in one.values if name in knobs}
        return {name: float(np.clip(v, *limits[name])) if name in limits else v for name, v in one.values.items()}

    def _by_knob(self, name: str, frequency: Frequencies, at_rest: Impedances, Z: Impedances) -> Complexes:
        """Return d ln Z / d knob, into the side that is physical; 0 for a flag. `at_rest` is the steady impedance."""
        (one, knob), value = self._knob(name), self.parameters()[name]
        if knob is None:
            return np.zeros_like(Z)
        step = small_step(knob, value)
        moved = self.replace({name: value + step})
        if one.effect.stage is Stage.RECORD:
            return (moved.impedance(frequency) / Z - 1) / complex(step)
        return (moved.steady_impedance(frequency) / at_rest - 1) / complex(step)

    def _knob(self, name: str) -> tuple[Added, Knob | None]:
        """Return the effect that a parameter belongs to, and the knob that it is, or None where it is a flag."""
        one = next(one for one in self.added if name.startswith(one.prefix))
        knobs = one.effect.knobs(self.nominal or self.bare, one.where)
        return one, next((knob for knob in knobs if one.prefix + knob.name == name), None)
