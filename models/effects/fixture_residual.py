"""`fixture-residual`: what open and short compensation and port extension left, the same in all sweeps of a fixture."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Impedances
from ..circuits.terminals import TransmissionLine
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
_VELOCITY, _LINE = 2e8, 50.0
"""Wave velocity and characteristic impedance of the line: of coaxial adapters, for which a port extension is made."""
_DELAY = EffectParameter("delay", "s", typical=1e-11, upper=1e-7, prior=(5e-12, 1.0), needs_prior=True)
"""Delay of the line to the device in one direction: 2 mm in a coaxial adapter is 10 ps. One that was extended too far
is a negative inductance and a negative capacitance."""


class FixtureResidual(Effect):
    """A two-port between device and analyzer, Z_l/(1 + Z_l Y) + Z_s, whose parts may have either sign.

    Y = G + jwC is what open compensation left, Z_s = R + R_s (1 + j) sqrt(f/MHz) + jwL what short compensation left.
    Z_l is the device at the end of a line of 50 ohm, which a port extension forgot. One shorter than a tenth of the
    wavelength is an inductance of 50 ohm and a capacitance of 1/(50 ohm) times its delay, so that little but what is
    usual tells them apart. A residual of usual size is an error that every fit and diagnosis allows for.
    """

    name = "fixture-residual"
    stage = Stage.CABLE
    sizes = 6
    only_named = True
    says = "Open and short compensation or port extension of the fixture left a residual."
    separates = "compensate again, and sweep open and short: what they show is the fixture's"
    references = ("Keysight Impedance Measurement Handbook, section 4 (open, short and load compensation)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the parts of the residual, of either sign: a compensation may have taken off too much; and a delay."""
        parts = (
            EffectParameter(name, UNITS[name], typical, lower=-_MOST * typical, upper=_MOST * typical)
            for name, typical in TYPICAL.items()
        )
        return (*parts, _DELAY)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device at the end of the line, with the shunt, behind the series impedance."""
        if not any(values.values()):
            return assembly
        extended = _at_end_of_line(assembly, values.get("delay", 0.0))

        def through(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            Y = values["conductance"] + jw * values["capacitance"]
            skin = values["skin"] * (1 + 1j) * np.sqrt(jw.imag / (2e6 * np.pi))
            return Z / (1 + Z * Y) + values["resistance"] + skin + jw * values["inductance"], 1 / (1 + Z * Y) ** 2

        return extended.behind(through)


def _at_end_of_line(assembly: Assembly, delay: float) -> Assembly:
    if delay <= 0:
        return assembly
    line = TransmissionLine(delay * _VELOCITY, _LINE, _VELOCITY)

    def along(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
        seen, slope, _ = line.see(Z, jw.imag / (2 * np.pi))
        return seen, slope

    return assembly.behind(along)


EFFECT = FixtureResidual()
