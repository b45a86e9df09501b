"""`finite-backing`: a backing treated as infinite and lossless that has a rear face and absorbs sound."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.face_loads import FACES
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter
from .base.modified_loads import FiniteBackingLoad, is_backing
from .base.scale import resonance

_BACK = FACES[0]
_DELAYS = tuple(np.geomspace(0.7e-6, 25e-6, 72).tolist())
"""Round-trip delays of 0.7 to 25 mm of tungsten-filled epoxy, s, densely enough for a fit to converge."""
_LOSSES = (1e-5, 0.05, 0.15)
"""1/Q with which an echo is looked for; one that is invisible at the resonance may be strong far below."""


class FiniteBacking(Effect):
    """A layer with a free rear face: a ripple with the period 1/delay, as deep as the echo is strong, and its own loss.

    Even without an echo its own loss makes it differ from a half-space with a real impedance. 1/Q follows a power of
    frequency, and the speed of sound follows from that: over many wavelengths to the rear and back it counts. It is one
    medium, so the same loss damps the echo by pi f delay/Q on its way; a rough or glued rear face weakens it further.
    """

    name = "finite-backing"
    errs_roughly = False
    sizes = 2
    says = "The backing is not an infinite lossless medium: its rear face reflects an echo, or its own loss is visible."
    separates = "load the rear of the backing with water or putty: its ripple changes, that of the rim does not"
    references = (
        "Kossoff, IEEE Trans. Sonics Ultrason. 13 (1966) 20 (backing and matching)",
        "Szabo, J. Acoust. Soc. Am. 96 (1994) 491 (causal power laws)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `face:back` if the load behind is a half-space other than a gas."""
        return (_BACK,) if is_backing(stack.back) else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the echo's amplitude at the resonance, 1/Q, the echo's delay (s), and 1/Q's power.

        Epoxy filled with tungsten absorbs 1 to 10 dB/mm at 5 MHz: 1/Q of 0.01 to 0.1, with rubber up to 0.3.
        """
        return (
            EffectParameter("strength", "1", typical=0.01, upper=0.99),
            EffectParameter("loss", "1", typical=0.01, upper=0.5, prior=(0.04, 1.0), scan=_LOSSES),
            EffectParameter(
                "delay",
                "s",
                typical=0.1 / resonance(stack),
                lower=1e-7,
                upper=1e-4,
                null=4e-6,
                scan=_DELAYS,
                delay=True,
            ),
            EffectParameter("exponent", "1", typical=0.3, lower=-1.0, upper=1.0, prior=(0.0, 0.5)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device on a backing of finite thickness."""
        if values["strength"] <= 0 and values["loss"] <= 0:
            return assembly
        known = {name: values[name] for name in ("strength", "loss", "delay", "exponent")}
        reference = resonance(assembly.nominal)
        decay = math.pi * reference * known["delay"] * known["loss"]
        return assembly.each_stack(
            lambda stack: replace(stack, back=FiniteBackingLoad(stack.back, reference=reference, decay=decay, **known))
        )


EFFECT = FiniteBacking()
