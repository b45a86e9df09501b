"""`cable`: an uncompensated length of transmission line between analyzer and device."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Impedances
from ..circuits.terminals import TransmissionLine
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import TERMINALS, Effect, EffectParameter, Stage

_VELOCITY = 2e8
"""Velocity of a wave in polyethylene, m/s; only length/velocity is visible."""


class Cable(Effect):
    """A lossy line: if short, a series inductance and a parallel capacitance; if long, a transformer."""

    name = "cable"
    stage = Stage.CABLE
    errs_roughly = False
    odds = 0.7
    implies = frozenset({"lead-inductance"})
    says = "A length of cable between analyzer and device was not compensated."
    separates = "sweep the cable open and shorted at the device's end, or compensate there"
    references = (
        "Agilent 4294A Operation Manual, fixture and adapter compensation",
        "Pozar, Microwave Engineering, section 2.7 (the lossy line)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return its inductance in henry, characteristic impedance in ohm, attenuation in Np/m at 1 MHz.

        A short line is little more than its inductance, so a fit finds the inductance more easily than the length,
        whatever the other parameters are. Coaxial lines have 50 to 93 ohm and a quarter of a microhenry in a metre; a
        pair of wires is a lead.
        """
        return (
            EffectParameter("inductance", "H", typical=2.5e-8, upper=2.5e-5, prior=(5e-8, 1.2)),
            EffectParameter("impedance", "ohm", typical=10.0, lower=40.0, upper=120.0, null=50.0, varies=True),
            EffectParameter("loss", "Np/m", typical=2e-3, upper=1.0, prior=(2e-3, 1.5)),
        )

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return its length at 2e8 m/s."""
        return {"length": (_length(values), "m")}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device at the end of a cable."""
        line = TransmissionLine(_length(values), values["impedance"], _VELOCITY, values["loss"])

        def through(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            seen, slope, _ = line.see(Z, jw.imag / (2 * np.pi))
            return seen, slope

        return assembly.behind(through)


def _length(values: Mapping[str, float]) -> float:
    return values["inductance"] * _VELOCITY / values["impedance"]


EFFECT = Cable()
