"""`vessel-echo`: the liquid before the front is no half-space: the wall of its vessel reflects."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.arrays import Complexes, Frequencies
from ..base.face_loads import FACES
from ..base.uncertain_numbers import with_uncertainty
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter
from .base.modified_loads import CorrectedLoad, is_backing
from .base.scale import WATER, resonance

_DELAYS = tuple(np.geomspace(1.4e-6, 1.4e-4, 72).tolist())
"""Round-trip delays of 1 to 100 mm of water, s."""


class VesselEcho(Effect):
    """The load z becomes z (1 - e)/(1 + e), e an echo after a delay: a ripple with the period 1/delay."""

    name = "vessel-echo"
    errs_roughly = False
    only_named = True
    says = "The liquid before {where} ends at a wall that reflects."
    separates = "move the transducer to or from the wall, tilt it, or put an absorber before the wall"
    references = ("Kinsler et al., Fundamentals of Acoustics, chapter 6 (transmission through layers)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `face:front` if the load there is a half-space other than a gas."""
        return (FACES[1],) if is_backing(stack.front) else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the echo's amplitude, and its delay (s)."""
        shortest = 0.1 / resonance(stack)
        return (
            EffectParameter("strength", "1", typical=0.01, upper=0.95, prior=(0.1, 1.3)),
            EffectParameter(
                "delay", "s", typical=shortest, lower=1e-7, upper=1e-3, null=1.35e-5, scan=_DELAYS, delay=True
            ),
        )

    def sentence(self, where: str, sizes: Mapping[str, tuple[float, float, str]]) -> str:
        """Return the sentence with the distance of the wall, if the liquid is water."""
        delay, u, _ = sizes["delay"]
        away = with_uncertainty(500 * WATER * delay, 500 * WATER * u)
        return f"{self.says.format(where=where)} In water, it would be {away} mm away."

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device before the wall."""
        strength, delay = values["strength"], values["delay"]
        if strength <= 0:
            return assembly

        def standing(frequency: Frequencies) -> Complexes:
            echo = strength * np.exp(-2j * np.pi * frequency * delay)
            return np.asarray(-2 * echo / (1 + echo), np.complex128)

        return assembly.each_stack(lambda stack: replace(stack, front=CorrectedLoad(stack.front, standing)))


EFFECT = VesselEcho()
