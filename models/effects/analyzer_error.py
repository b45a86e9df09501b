"""`analyzer-error`: the analyzer's gain and phase are off, whatever the device is."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Frequencies
from ..stack import Stack
from .base.assembly import Assembly, Reading
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.scale import resonance


class AnalyzerError(Effect):
    """Z times e^(gain + j phase f/f0): the same for every device, so that several steps tell it from one of a device.

    One within the analyzer's specification is an error that every fit and diagnosis allows for.
    """

    name = "analyzer-error"
    stage = Stage.ACQUISITION
    sizes = 2
    only_named = True
    says = "The analyzer reads another impedance than there is: its gain or its phase is off for every device."
    separates = "sweep a capacitor and a resistor of known value, or let the analyzer warm up and compensate again"
    references = ("Agilent 4294A Operation Manual, measurement accuracy and adapter phase compensation",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `sweep`."""
        return (SWEEP,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the relative gain, and the phase at the resonance (rad), which is proportional to frequency."""
        return (
            EffectParameter("gain", "1", typical=1e-3, lower=-0.5, upper=0.5, prior=(0.0, 3e-3)),
            EffectParameter("phase", "rad", typical=1e-3, lower=-0.5, upper=0.5, prior=(0.0, 3e-3)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as such an analyzer records it."""
        gain, phase, f0 = values["gain"], values["phase"], resonance(assembly.nominal)
        if gain == 0 and phase == 0:
            return assembly

        def read(frequency: Frequencies) -> Complexes:
            return np.asarray(np.exp(gain + 1j * phase * frequency / f0), np.complex128)

        return assembly.recorded(Reading(read))


EFFECT = AnalyzerError()
