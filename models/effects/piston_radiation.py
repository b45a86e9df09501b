"""`piston-radiation`: the front radiates into its liquid as a finite piston, not as an infinite plane."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.arrays import Complexes, Frequencies
from ..base.face_loads import FACES
from ..stack import Stack
from ..stack.radiation import piston
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter
from .base.modified_loads import CorrectedLoad, is_backing
from .base.scale import resonance


class PistonRadiation(Effect):
    """The load z becomes z (R1(x) + j X1(x)), x = 2 k a = f/(f0 narrowness): a rigid piston of radius a in a baffle.

    A plane has no narrowness; a disk of 16 mm in water has 0.004 at 4 MHz, so that it matters at low frequency only.
    """

    name = "piston-radiation"
    errs_roughly = False
    only_named = True
    says = "{where} is so narrow that it radiates into its liquid as a piston, with a mass of liquid that moves along."
    separates = "sweep the device in air, and from a tenth of its resonance on in the liquid"
    references = ("Kinsler et al., Fundamentals of Acoustics, section 7.5 (radiation impedance of a piston)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `face:front` if the load there is a half-space other than a gas."""
        return (FACES[1],) if is_backing(stack.front) else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return 1/(2 k a) at the resonance."""
        return (EffectParameter("narrowness", "1", typical=0.01, upper=1.0, prior=(0.01, 1.0), ripples=True),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the load of a piston."""
        narrowness, f0 = values["narrowness"], resonance(assembly.nominal)
        if narrowness <= 0:
            return assembly

        def beyond(frequency: Frequencies) -> Complexes:
            return np.asarray(piston(frequency / (f0 * narrowness)) - 1, np.complex128)

        return assembly.each_stack(lambda stack: replace(stack, front=CorrectedLoad(stack.front, beyond)))


EFFECT = PistonRadiation()
