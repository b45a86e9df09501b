"""`clamp`: a holder or clip that presses on part of a face."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.face_loads import FACES
from ..stack import Stack, Support
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage
from .base.modified_loads import resting_on
from .base.part_of_face import FRACTION, satellite
from .base.scale import acoustic_impedance, resonance

_STIFFNESSES = tuple(np.geomspace(0.01, 10.0, 36).tolist())
"""Stiffness in units of 2 pi f0 Z0 of the active layer: each causes a satellite at its own frequency, so start values
must lie closer than a linewidth for a fit to converge."""
_USUAL_LOSS = 0.05


class Clamp(Effect):
    """Y = (1 - phi) Y(free) + phi Y(held): there the face moves against K (1 + j loss)/(jw) per area.

    A ring on which the device lies, a spring contact, a clip: what holds them does not move. A satellite above the
    resonance appears, up to that of a face that cannot move; that of a `local-mass` lies below. A clip that touches
    next to nothing is mistaken for a weak `spurious-resonance`, a soft one over much of the face for a `face-load`.
    Beside it a plate moves as if there were none; a disk also bends there.
    """

    name = "clamp"
    stage = Stage.SHARES
    only_named = True
    says = "A clip or a ring of the holder presses on part of {where}."
    separates = "sweep with another clamping force, with the holder elsewhere on the face, or hung from its leads"
    references = ("Johnson, Contact Mechanics (1985), chapter 3 (stiffness of a contact)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces."""
        return FACES

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the part of the area under the clip, its stiffness per area in Pa/m, and its loss tangent."""
        unit = 2 * np.pi * resonance(stack) * acoustic_impedance(stack)
        return (
            FRACTION,
            satellite("stiffness", "Pa/m", unit, _STIFFNESSES),
            EffectParameter("loss", "1", typical=0.05, upper=1.0, null=_USUAL_LOSS, prior=(_USUAL_LOSS, 0.1)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the free and the held part of the face in parallel."""
        fraction = values["fraction"]
        if fraction <= 0:
            return assembly
        clip = Support(self.name, stiffness=values["stiffness"], loss=values["loss"])
        own = f"{self.key}@{where}.fraction"

        def parted(part: ParallelSection) -> tuple[ParallelSection, ...]:
            held = replace(part.share(fraction, {own: 1.0}), stack=resting_on(part.stack, where, clip))
            return part.share(1 - fraction, {own: -1.0}), held

        return assembly.split(parted)


EFFECT = Clamp()
