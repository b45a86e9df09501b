"""A stiffness that falls with the strain that the sweep drives: the resonance curve bends with the oscillator level."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi, sqrt

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ...stack import Piezo, Stack
from .assembly import Assembly, Record
from .effect import EffectParameter
from .last_made import LastMade
from .modified_laws import Factor, with_stiffness_law

_RAYLEIGH = 4 / (3 * pi)
"""Loss per softening of a Rayleigh loop."""
USUAL_SOURCE = 25.0
"""Source resistance, ohm, of a recording that does not state it."""
SOURCE = EffectParameter("source", "ohm", typical=10.0, upper=100.0, null=USUAL_SOURCE, setting="source_ohm")
"""Parameter of every effect that depends on the voltage at the device: the source resistance."""
LOSS_AND_SOURCE = (
    EffectParameter("loss", "1", typical=0.4, upper=3.0, null=_RAYLEIGH, prior=(_RAYLEIGH, 0.3)),
    SOURCE,
)
"""Parameters of every effect that softens a layer: the loss per softening, and the source resistance."""
_ROUNDS = 25
_MOST = 0.3
"""Largest relative loss of stiffness; the model is not valid beyond."""
_SLIGHTLY = 1e-7
"""Relative step of derivatives."""
_LEAST_STABLE = 0.1
"""Least stability (`_Agreed`) with which derivatives are computed: at a jump they have no bound."""


@dataclass(frozen=True, eq=False)
class _Softened:
    """A device with a softening per frequency, and the softening by the strain that it has then."""

    Z: Impedances
    """Steady impedance, ohm, shape (N,)."""
    wanted: Reals
    """Shape (N,)."""


@dataclass(frozen=True, eq=False)
class _Agreed:
    """The softening of a device that its own strain causes."""

    soft: Reals
    """Shape (N,)."""
    there: _Softened
    by_soft: Complexes
    """d ln Z / d soft, shape (N,)."""
    stability: Reals
    """1 - d wanted / d soft: where it is zero the curve bends back, and the reading jumps; shape (N,)."""

    def follows(self, wanted: Reals) -> Complexes:
        """Return the change of ln Z by that of the softening, if at a fixed one it changes by `wanted`, shape (..., N).

        Nothing changes where it is as large as the model allows.
        """
        return self.by_soft * np.where(self.there.wanted < _MOST, wanted / self.stability, 0.0)


@dataclass(frozen=True, eq=False)
class Softening(Record):
    """The stiffness at each point is that at the amplitude |S| of the mean strain there: c33D (1 - a |S|^p (1 - j r)).

    The strain is found self-consistently.
    """

    layer: str
    softening: float
    """a, relative, per power of strain."""
    loss: float
    """r, per softening."""
    source: float
    """Resistance, ohm."""
    power: float = 1.0
    """p."""
    _agreed: LastMade[_Agreed] = field(default_factory=LastMade[_Agreed], init=False, repr=False)

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the recorded impedance over the steady one, shape (N,)."""
        return self._at_rest(device, frequency).there.Z / device.steady(frequency)

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter, shape (P, N): at a fixed softening, and by what it changes."""
        agreed = self._at_rest(device, frequency)
        softer = self._softer(device, agreed.soft)
        _, slopes = softer.steady_jacobian(frequency, names)
        by_strain = self._strain_slopes(softer, frequency, names, slopes)
        return slopes + agreed.follows(agreed.there.wanted * self.power * by_strain) - at_rest

    def change(self, device: Assembly, other: Record, moved: Assembly, frequency: Frequencies) -> Complexes:
        """Return the change of ln factor, shape (N,): at a fixed softening, and by what it changes."""
        if not isinstance(other, Softening):
            return super().change(device, other, moved, frequency)
        agreed = self._at_rest(device, frequency)
        there = other.softened(moved, frequency, agreed.soft)
        fixed = there.Z / agreed.there.Z - moved.steady(frequency) / device.steady(frequency)
        return fixed + agreed.follows(there.wanted - agreed.there.wanted)

    def relative(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the relative change of the stiffness at each point, shape (N,)."""
        return np.asarray(-self._at_rest(device, frequency).soft * (1 - 1j * self.loss), np.complex128)

    def _at_rest(self, device: Assembly, frequency: Frequencies) -> _Agreed:
        """Return the softening where it no longer changes, shape (N,)."""
        return self._agreed.of(device, frequency, lambda: self._agreement(device, frequency))

    def _agreement(self, device: Assembly, frequency: Frequencies) -> _Agreed:
        soft = _self_consistent(lambda soft: self.softened(device, frequency, soft).wanted, frequency.size)
        there, near = (self.softened(device, frequency, one) for one in (soft, soft + _SLIGHTLY))
        by_soft = (near.Z / there.Z - 1) / _SLIGHTLY
        stability = 1 - (near.wanted - there.wanted) / _SLIGHTLY
        return _Agreed(soft, there, by_soft, np.maximum(stability, _LEAST_STABLE))

    def _softer(self, device: Assembly, soft: Reals) -> Assembly:
        """Return the device with the layer's stiffness times 1 - soft (1 - j loss), shape (N,)."""
        factor, name = np.add(1 - soft, 1j * self.loss * soft), self.layer
        softer = device.each_stack(lambda stack: with_stiffness_law(stack, name, lambda law: Factor(law, factor)))
        return device.with_parts(softer.parts)

    def softened(self, device: Assembly, frequency: Frequencies, soft: Reals) -> _Softened:
        """Return the device with this softening, and the softening by its strain then."""
        softer = self._softer(device, soft)
        Z = softer.steady(frequency)
        stack, disk = softer.stack, self._disk(softer.stack)
        charge = _field_of_charge(stack, disk, frequency, stack.impedance(frequency))
        voltage = sqrt(2) * device.conditions.level_V * np.abs(Z / (Z + self.source))
        strain = voltage / disk.thickness * np.abs((charge - 1) / disk.field_per_strain(frequency))
        return _Softened(Z, np.minimum(_MOST, self.softening * strain**self.power))

    def _disk(self, stack: Stack) -> Piezo:
        return next(one for one in stack.layers if isinstance(one, Piezo) and one.name == self.layer)

    def _strain_slopes(
        self, softer: Assembly, frequency: Frequencies, names: Sequence[str], slopes: Complexes
    ) -> Reals:
        """Return d ln strain / d parameter at a fixed softening, shape (P, N); `slopes`: d ln Z of the device."""
        stack, disk, Z = softer.stack, self._disk(softer.stack), softer.steady(frequency)
        part = max(softer.parts, key=lambda one: one.fraction)
        made = np.real(slopes * (self.source / (Z + self.source)))  # of the voltage
        moved = part.moved_by(names)
        own = [name for _, name, _ in moved if name in stack.names]
        Z1, of_stack = stack.jacobian(frequency, own)
        charge = _field_of_charge(stack, disk, frequency, Z1)
        here = disk.thickness, disk.clamped_elastance(frequency), disk.field_per_strain(frequency)
        rows, values = iter(of_stack), stack.parameters()
        for k, name, scale in moved:
            if name not in stack.names:
                continue  # of a distribution of thickness: the strain is that of the mean thickness
            whole = f"{name.removesuffix('.im')}.re" if name.endswith(".im") else name  # a loss may be zero
            step = _SLIGHTLY * values[whole]
            other = stack.replace({name: values[name] + step})
            layer = self._disk(other)
            there = layer.thickness, layer.clamped_elastance(frequency), layer.field_per_strain(frequency)
            thickness, elastance, field_per_strain = (np.divide(b, a) - 1 for a, b in zip(here, there, strict=True))
            by_area = other.area / stack.area - 1
            by_charge = charge / (charge - 1) * ((elastance - by_area) / step - next(rows))
            made[k] += scale * np.real(by_charge - (thickness + field_per_strain) / step)
        return made


def _field_of_charge(stack: Stack, disk: Piezo, frequency: Frequencies, Z: Impedances) -> Complexes:
    """Return the field of the charge over that of the voltage, shape (N,): V = t (D/eps - h S), current jw D A."""
    return np.asarray(disk.clamped_elastance(frequency) / (j_omega(frequency) * stack.area * Z), np.complex128)


def _self_consistent(wanted: Callable[[Reals], Reals], points: int) -> Reals:
    """Solve for the softening consistent with its own strain, shape (points,), by damped secant steps."""
    before = np.zeros(points)
    missing_before = wanted(before)
    soft = 0.5 * missing_before
    for _ in range(_ROUNDS):
        missing = wanted(soft) - soft
        if np.max(np.abs(missing)) < 1e-10:
            break
        slope = (missing - missing_before) / np.where(soft == before, 1.0, soft - before)
        # if strain hardly depends on softening the slope is -1; a bent resonance makes it steeper or reverses its sign
        step = np.where((slope < -0.5) & (soft != before), missing / -np.minimum(slope, -0.5), 0.5 * missing)
        before, missing_before = soft, missing
        soft = np.clip(soft + step, 0.0, _MOST)
    return soft
