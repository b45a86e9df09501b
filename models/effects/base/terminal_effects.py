"""Any model with effects at its terminals: lead, stray capacitance, cable, one additional parallel resonance.

Effects inside a stack need a stack (`device.py`); effects at the terminals only need an impedance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, j_omega
from ...base.model import Model
from ...base.names import require
from ...stack import Stack
from .assembly import Assembly
from .device import Added, small_step


@dataclass(frozen=True)
class TerminalEffects:
    """A device with effects outside of it. Satisfies `Model`."""

    device: Model
    nominal: Stack
    """Sets the scales of the effects."""
    added: tuple[Added, ...]

    def parameters(self) -> dict[str, float]:
        """Return the device's parameters, and `effect@place.parameter` for each parameter of an effect."""
        of_effects = (effect.parameters() for effect in self.added)
        return {
            **self.device.parameters(),
            **{name: value for parameters in of_effects for name, value in parameters.items()},
        }

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the device with these parameters. Raises KeyError for an unknown name."""
        require(values, self.parameters(), "the device")
        effect_parameters = {name: value for name, value in values.items() if "@" in name.partition(".")[0]}
        added = tuple(effect.moved(effect_parameters) for effect in self.added)
        moved = {name: value for name, value in values.items() if name not in effect_parameters}
        return replace(self, device=self.device.replace(moved) if moved else self.device, added=added)

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        seen, _ = _through(self, frequency, self.device.impedance(frequency))
        return seen

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N); effects by a difference quotient."""
        require(names, self.parameters(), "the device")
        inner = self.device.parameters()
        bare, slopes = self.device.jacobian(frequency, [name for name in names if name in inner])
        seen, chain = _through(self, frequency, bare)
        rows = iter(slopes * (bare * chain / seen))
        derivatives = [next(rows) if name in inner else self._by_knob(name, frequency, bare, seen) for name in names]
        return seen, np.array(derivatives, np.complex128).reshape(len(names), frequency.size)

    def _by_knob(self, name: str, frequency: Frequencies, bare: Impedances, seen: Impedances) -> Complexes:
        added = next(added for added in self.added if name.startswith(added.prefix))
        effect_parameters = added.effect.effect_parameters(self.nominal, added.where)
        knob = next(knob for knob in effect_parameters if added.prefix + knob.name == name)
        value = added.values[knob.name]
        step = small_step(knob, value)
        there, _ = _through(self.replace({name: value + step}), frequency, bare)
        return (there / seen - 1) / step


def _through(whole: TerminalEffects, frequency: Frequencies, Z: Impedances) -> tuple[Impedances, Complexes]:
    """Return what is seen of a device of impedance Z, and its derivative by Z; shapes (N,)."""
    outside = Assembly((), whole.nominal)
    for one in sorted(whole.added, key=lambda one: (one.effect.stage, one.prefix)):
        outside = one.effect.extend(outside, one.where, one.values)
    jw = j_omega(frequency)
    seen = 1 / (1 / Z + sum((shunt(jw) for shunt in outside.shunts), np.zeros_like(jw)))
    chain = (seen / Z) ** 2
    for terminal in outside.terminals:
        seen, slope = terminal(jw, seen)
        chain = chain * slope
    return seen, chain
