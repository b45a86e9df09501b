"""`series-resistance`: contact, electrode sheet and wire in series, including the skin effect."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Impedances
from ..circuits.terminals import Series
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import TERMINALS, Effect, EffectParameter, Stage
from .base.scale import reactance


class SeriesResistance(Effect):
    """Z + R + R_s (1 + j) sqrt(f/1 MHz): largest relative effect where |Z| is smallest; resembles dielectric loss."""

    name = "series-resistance"
    stage = Stage.TERMINALS
    errs_roughly = False
    sizes = 2
    says = "A contact, an electrode or the wire adds a series resistance that was not compensated."
    separates = "sweep a short circuit in the same clip, press or clean the contact, or measure R at low frequency"
    references = (
        "Keysight Impedance Measurement Handbook, section 4",
        "Ramo, Whinnery and Van Duzer, Fields and Waves in Communication Electronics, chapter 3 (skin effect)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the resistance, and the skin effect's resistance at 1 MHz, in ohm."""
        typical = 3e-3 * reactance(stack)
        return (
            EffectParameter("resistance", "ohm", typical, prior=(0.3, 1.5)),
            # a wire has one, a contact or an electrode thinner than its skin depth has none
            EffectParameter("skin", "ohm", typical, prior=(0.1, 1.5), absent=0.5),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device behind a resistance."""
        wire = Series(resistance=values["resistance"], skin=values["skin"])

        def through(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            seen, slope, _ = wire.see(Z, jw.imag / (2 * np.pi))
            return seen, slope

        return assembly.behind(through)


EFFECT = SeriesResistance()
