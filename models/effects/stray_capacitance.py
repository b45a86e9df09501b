"""`stray-capacitance`: capacitance of fixture or cable in parallel with the device."""

from collections.abc import Mapping

import numpy as np

from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import TERMINALS, Effect, EffectParameter, Stage
from .base.scale import capacitance, resonance


class StrayCapacitance(Effect):
    """Y + jwC: visible where |Y| is smallest, at the antiresonance; in one band it resembles a larger permittivity."""

    name = "stray-capacitance"
    stage = Stage.TERMINALS
    errs_roughly = False
    says = "The fixture or cable adds a parallel capacitance that was not compensated."
    separates = "sweep the empty fixture, or compensate with it; sweep a disk of another size in the same fixture"
    references = ("Keysight Impedance Measurement Handbook, section 4",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return C in farad and the loss tangent of its insulation."""
        return (
            EffectParameter("capacitance", "F", typical=2e-3 * capacitance(stack), prior=(1e-11, 1.8)),
            EffectParameter("loss", "1", typical=0.01, upper=0.3, prior=(3e-3, 1.6)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device in parallel with a capacitance."""
        C, w0 = values["capacitance"], 2 * np.pi * resonance(assembly.nominal)
        power = 2 / np.pi * np.arctan(values["loss"])  # a constant loss angle: a constant-phase element is causal
        return assembly.beside(lambda jw: jw * C * (jw / w0) ** -power)


EFFECT = StrayCapacitance()
