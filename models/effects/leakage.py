"""`leakage`: a conductance in parallel with the device, such as a dirty or moist rim."""

from collections.abc import Mapping

import numpy as np

from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import TERMINALS, Effect, EffectParameter, Stage
from .base.scale import reactance, resonance

_INSULATION = 1e-5, 2.3
"""Conductance over a rim or in a clip: from 10 Mohm where it was only touched to 1 kohm with flux or water, as two
standard deviations, whatever the reactance of the device."""


class Leakage(Effect):
    """Y + G (f/f0)^n: visible at low frequency and at the antiresonance."""

    name = "leakage"
    stage = Stage.TERMINALS
    errs_roughly = False
    says = "Current leaks past the device: over its rim, through flux or moisture, or in the fixture."
    separates = "measure the insulation at direct current, sweep from 100 Hz, or clean and dry the rim"
    references = ("Keysight Impedance Measurement Handbook, section 4",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return G at resonance in siemens, and its exponent in frequency."""
        return (
            EffectParameter("conductance", "S", typical=1e-4 / reactance(stack), prior=_INSULATION),
            EffectParameter("exponent", "1", typical=0.1, lower=-0.5, upper=1.0, prior=(0.1, 0.15)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device in parallel with a conductance."""
        G, w0 = values["conductance"], 2 * np.pi * resonance(assembly.nominal)
        exponent = values["exponent"]
        return assembly.beside(lambda jw: G * (jw / w0 / 1j) ** exponent)


EFFECT = Leakage()
