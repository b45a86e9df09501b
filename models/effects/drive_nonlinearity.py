"""`drive-nonlinearity`: the resonance curve bends with the oscillator level."""

from collections.abc import Mapping
from math import pi, sqrt

from ..stack import Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.scale import active, reactance
from .base.softening import LOSS_AND_SOURCE, USUAL_SOURCE, Softening

_USUAL_LEVEL, _USUAL_SOFTENING = 0.5, 1e-3
"""V rms, and a relative softening at resonance that would matter."""


class DriveNonlinearity(Effect):
    """c33D (1 - a |S| (1 - j r)), S the amplitude of the mean strain at this level, found self-consistently."""

    name = "drive-nonlinearity"
    stage = Stage.ACQUISITION
    says = "The resonance of {where} bends with the oscillator level: the drive is too high for a linear model."
    separates = "sweep at three levels, 5 mV to 500 mV, or drive by constant current"
    references = ("Hall, J. Mater. Sci. 36 (2001) 4575 (Rayleigh's law in ferroelectrics)",)

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
            *LOSS_AND_SOURCE,
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by a sweep at its level."""
        if values["softening"] <= 0:
            return assembly
        return assembly.recorded(Softening(layer_at(where), values["softening"], values["loss"], values["source"]))


def _usual_strain(stack: Stack) -> float:
    """Return the strain at the series resonance at the usual level, which the source resistance reduces."""
    disk = active(stack)
    Q = disk.c33D.real / max(disk.c33D.imag, 1e-3 * disk.c33D.real)
    per_field = abs(disk.h33) * disk.eps33S.real / disk.c33D.real
    coupling = abs(disk.h33) * per_field  # kt^2
    R = pi**2 / 8 * reactance(stack) / max(coupling * Q, 1e-3)
    return Q * per_field * sqrt(2) * _USUAL_LEVEL / disk.thickness * R / (R + USUAL_SOURCE)


EFFECT = DriveNonlinearity()
