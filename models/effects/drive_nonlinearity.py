"""`drive-nonlinearity`: the resonance curve bends with the oscillator level."""

from collections.abc import Callable, Mapping
from math import pi, sqrt

import numpy as np

from ..base.arrays import Frequencies, Impedances, Reals, j_omega
from ..stack import Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.modified_laws import Factor, with_stiffness_law
from .base.scale import active, reactance

_USUAL_SOURCE = 25.0
"""Source resistance, ohm, of a recording that does not state it."""
_RAYLEIGH = 4 / (3 * pi)
"""Loss per softening of a Rayleigh loop."""
_ROUNDS = 25
_MOST = 0.3
"""Largest relative loss of stiffness; the model is not valid beyond."""
_USUAL_LEVEL, _USUAL_SOFTENING = 0.5, 1e-3
"""V rms, and a relative softening at resonance that would matter."""


class DriveNonlinearity(Effect):
    """c33D (1 - a |S| (1 - j r)), S the amplitude of the mean strain at this level, found self-consistently."""

    name = "drive-nonlinearity"
    stage = Stage.ACQUISITION
    says = "The resonance of {where} bends with the oscillator level: the drive is too high for a linear model."
    separates = "sweep at three levels, 5 mV to 500 mV, or drive by constant current"
    references = (
        "Hall, J. Mater. Sci. 36 (2001) 4575 (Rayleigh's law in ferroelectrics)",
        "left-out physics 4.4",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the piezoelectric layer if there is only one."""
        piezos = [layer.name for layer in stack.layers if isinstance(layer, Piezo)]
        return (f"layer:{piezos[0]}",) if len(piezos) == 1 else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return a, the relative softening per strain, r, the loss per softening, and the source resistance.

        r is 4/(3 pi) by Rayleigh's law; a source with constant voltage at the device has no resistance.
        """
        return (
            EffectParameter("softening", "1", typical=_USUAL_SOFTENING / max(_usual_strain(stack), 1e-12)),
            EffectParameter("loss", "1", typical=0.4, upper=3.0, null=_RAYLEIGH, prior=(_RAYLEIGH, 0.3)),
            EffectParameter("source", "ohm", typical=10.0, upper=100.0, null=_USUAL_SOURCE, setting="source_ohm"),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by a sweep at its level."""
        name, softening, loss, source = layer_at(where), values["softening"], values["loss"], values["source"]
        if softening <= 0:
            return assembly

        def bent(device: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            def wanted(soft: Reals) -> Reals:
                return np.minimum(
                    _MOST, softening * _strain(_softer(device, name, soft, loss), name, source, frequency)
                )

            soft = _agreed(wanted, frequency.size)
            return Z * (_softer(device, name, soft, loss).steady(frequency) / device.steady(frequency))

        return assembly.recorded(bent)


def _usual_strain(stack: Stack) -> float:
    """Return the strain at the series resonance at the usual level, which the source resistance reduces."""
    disk = active(stack)
    Q = disk.c33D.real / max(disk.c33D.imag, 1e-3 * disk.c33D.real)
    per_field = abs(disk.h33) * disk.eps33S.real / disk.c33D.real
    coupling = abs(disk.h33) * per_field  # kt^2
    R = pi**2 / 8 * reactance(stack) / max(coupling * Q, 1e-3)
    return Q * per_field * sqrt(2) * _USUAL_LEVEL / disk.thickness * R / (R + _USUAL_SOURCE)


def _agreed(wanted: Callable[[Reals], Reals], points: int) -> Reals:
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


def _softer(device: Assembly, name: str, soft: Reals, loss: float) -> Assembly:
    """Return the device with the layer's stiffness times 1 - soft (1 - j loss); `soft` per frequency, shape (N,)."""
    factor = np.add(1 - soft, 1j * loss * soft)

    return device.each_stack(lambda stack: with_stiffness_law(stack, name, lambda law: Factor(law, factor)))


def _strain(device: Assembly, name: str, source: float, frequency: Frequencies) -> Reals:
    """Return the amplitude of the layer's mean strain, shape (N,), from V = t (D/eps - h S) and its current jw D A."""
    stack = device.stack
    disk = next(layer for layer in stack.layers if isinstance(layer, Piezo) and layer.name == name)
    jw, seen = j_omega(frequency), device.steady(frequency)
    voltage = sqrt(2) * device.conditions.level_V * np.abs(seen / (seen + source))
    field_of_charge = disk.clamped_elastance(frequency) / (jw * stack.area * stack.impedance(frequency))
    return voltage / disk.thickness * np.abs((field_of_charge - 1) / disk.field_per_strain(frequency))


EFFECT = DriveNonlinearity()
