"""`fixture-residual`: what open and short compensation left, the same in all sweeps of a fixture."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Impedances
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import TERMINALS, Effect, EffectParameter, Stage

UNITS: Mapping[str, str] = {
    "inductance": "H", "resistance": "ohm", "skin": "ohm", "capacitance": "F", "conductance": "S",
}  # fmt: skip
"""Parts of the residual, with their units; `skin`: (1 + j) times it at 1 MHz, as the root of frequency."""
TYPICAL: Mapping[str, float] = {
    "inductance": 1e-9, "resistance": 1e-2, "skin": 5e-3, "capacitance": 2e-14, "conductance": 3e-9,
}  # fmt: skip
"""What a compensation usually leaves, in these units."""
_MOST = 1e5
"""Largest part, in typical ones: a tenth of a millihenry."""


class FixtureResidual(Effect):
    """A two-port between device and analyzer, Z/(1 + Z Y) + Z_s, whose parts may have either sign.

    Y = G + jwC is what open compensation left, Z_s = R + R_s (1 + j) sqrt(f/MHz) + jwL what short compensation left.
    One of usual size is an error that every fit and diagnosis allows for.
    """

    name = "fixture-residual"
    stage = Stage.CABLE
    sizes = 5
    only_named = True
    says = "Open and short compensation of the fixture left a residual."
    separates = "compensate again, and sweep open and short: what they show is the fixture's"
    references = ("Keysight Impedance Measurement Handbook, section 4 (open, short and load compensation)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the parts of the residual, of either sign: a compensation may have taken off too much."""
        return tuple(
            EffectParameter(name, UNITS[name], typical, lower=-_MOST * typical, upper=_MOST * typical)
            for name, typical in TYPICAL.items()
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the shunt, behind the series impedance."""
        if not any(values.values()):
            return assembly

        def through(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            Y = values["conductance"] + jw * values["capacitance"]
            skin = values["skin"] * (1 + 1j) * np.sqrt(jw.imag / (2e6 * np.pi))
            return Z / (1 + Z * Y) + values["resistance"] + skin + jw * values["inductance"], 1 / (1 + Z * Y) ** 2

        return assembly.behind(through)


EFFECT = FixtureResidual()
