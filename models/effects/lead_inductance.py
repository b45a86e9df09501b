"""`lead-inductance`: series inductance (and resistance) of wire, clip, coaxial fixture."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Impedances
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import TERMINALS, Effect, EffectParameter, Stage


class LeadInductance(Effect):
    """Z + R + R_s (1+j) sqrt(f/MHz) + jwL, with a little capacitance C across it at the analyzer's side.

    It grows with frequency; its relative effect is largest where |Z| is smallest.
    """

    name = "lead-inductance"
    stage = Stage.TERMINALS
    errs_roughly = False
    says = "The wire or clip between analyzer and device adds a series inductance that was not compensated."
    separates = "sweep a short circuit in the same clip, or compensate with it"
    references = (
        "Keysight Impedance Measurement Handbook, section 4",
        "Ramo, Whinnery and Van Duzer, Fields and Waves in Communication Electronics, chapter 3 (skin effect)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return L (H), the resistance (ohm), the skin effect's resistance at 1 MHz (ohm), and C (F).

        A clip has 5 nH, a loop of two wires 7 to 10 nH in each centimetre of its length.
        """
        return (
            EffectParameter("inductance", "H", typical=1e-8, prior=(2.5e-8, 1.3)),
            EffectParameter("resistance", "ohm", typical=0.05, prior=(0.02, 2.0), in_proportion=True),
            EffectParameter("skin", "ohm", typical=0.01, prior=(3e-3, 2.0), in_proportion=True),
            EffectParameter("capacitance", "F", typical=1e-13, prior=(2e-13, 2.0), in_proportion=True),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device behind a wire."""
        L, R, skin, C = values["inductance"], values["resistance"], values["skin"], values["capacitance"]

        def wire(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            far = Z + R + skin * (1 + 1j) * np.sqrt(jw.imag / (2e6 * np.pi)) + jw * L
            share = 1 / (1 + jw * C * far)
            return far * share, share**2

        return assembly.behind(wire)


EFFECT = LeadInductance()
