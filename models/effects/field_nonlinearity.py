"""`field-nonlinearity`: permittivity and coupling that rise with the field of the oscillator level."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..stack import Piezo, Stack
from .base.assembly import Assembly, Record
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.modified_laws import Factor, with_piezo
from .base.scale import active
from .base.softening import USUAL_SOURCE

_RAYLEIGH = 4 / (3 * pi)
"""Loss per change of a Rayleigh loop."""
_ROUNDS = 4
"""Rounds of voltage and permittivity: one changes the other by a part of the small change."""
_MOST = 0.3
"""Largest relative change; the model is not valid beyond."""


class FieldNonlinearity(Effect):
    """eps33S (1 + a E (1 - j r)) and h33 (1 + b E (1 - j r)), E the amplitude of the field, r = 4/(3 pi) (Rayleigh).

    A `drive-nonlinearity` changes the stiffness with strain, at the resonance; this one changes the device at all
    frequencies, as far as the level reaches it through the source.
    """

    name = "field-nonlinearity"
    stage = Stage.ACQUISITION
    sizes = 2
    only_named = True
    says = "Permittivity and coupling of {where} change with the oscillator level: domain walls move with the field."
    separates = "sweep at three levels, 5 mV to 1 V, far from any resonance"
    references = ("Damjanovic and Demartin, J. Phys. D 29 (1996) 2057 (Rayleigh's law of piezoelectric constants)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the piezoelectric layer if there is only one."""
        piezos = [layer.name for layer in stack.layers if isinstance(layer, Piezo)]
        return (f"layer:{piezos[0]}",) if len(piezos) == 1 else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return a and b in m/V; soft ceramics have 1e-7 to 1e-6, so that half a volt on half a millimetre is 1e-3."""
        typical = 3e-4 * active(stack).thickness
        return (
            EffectParameter("permittivity", "m/V", typical, lower=-1e3 * typical, upper=1e3 * typical),
            EffectParameter("coupling", "m/V", typical, lower=-1e3 * typical, upper=1e3 * typical),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by a sweep at its level."""
        if not any(values.values()):
            return assembly
        return assembly.recorded(_InField(layer_at(where), values["permittivity"], values["coupling"]))


@dataclass(frozen=True, eq=False)
class _InField(Record):
    """A layer whose constants at each point are those in the field there."""

    layer: str
    permittivity: float
    """a, m/V."""
    coupling: float
    """b, m/V."""

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the recorded impedance over the steady one, shape (N,)."""
        return self._there(device, frequency).steady(frequency) / device.steady(frequency)

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter in the same field, shape (P, N): the field hardly changes with them."""
        _, slopes = self._there(device, frequency).steady_jacobian(frequency, names)
        return slopes - at_rest

    def _there(self, device: Assembly, frequency: Frequencies) -> Assembly:
        """Return the device with its constants in the field of each point."""
        made = device
        for _ in range(_ROUNDS):
            seen = made.steady(frequency)
            volt = sqrt(2) * device.conditions.level_V * np.abs(seen / (seen + USUAL_SOURCE))
            eps, h = (self._factor(size, volt / self._thickness(device)) for size in (self.permittivity, self.coupling))

            def changed(layer: Piezo, eps: Complexes = eps, h: Complexes = h) -> Piezo:
                return replace(layer, eps_law=Factor(layer.eps_law, eps), h_law=Factor(layer.h_law, h))

            def moved(stack: Stack, changed: Callable[[Piezo], Piezo] = changed) -> Stack:
                return with_piezo(stack, self.layer, changed)

            made = device.with_parts(device.each_stack(moved).parts)
        return made

    def _thickness(self, device: Assembly) -> float:
        return next(one.thickness for one in device.stack.layers if isinstance(one, Piezo) and one.name == self.layer)

    def _factor(self, size: float, field: Reals) -> Complexes:
        change = np.clip(size * field, -_MOST, _MOST)
        return np.asarray(1 + change * (1 - 1j * _RAYLEIGH), np.complex128)


EFFECT = FieldNonlinearity()
