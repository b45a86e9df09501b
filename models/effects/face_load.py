"""`face-load`: a face radiates into something or rests on it (fluid, fixture, rubber)."""

from collections.abc import Mapping

import numpy as np

from ..base.face_loads import FACES
from ..stack import Stack, Support
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter
from .base.modified_loads import resting_on
from .base.scale import acoustic_impedance, resonance


class FaceLoad(Effect):
    """A resistance and a spring added to the load of a face; within one band the resistance resembles loss."""

    name = "face-load"
    errs_roughly = False
    sizes = 2
    says = "Something that the build omits loads {where}: a liquid, the fixture, rubber."
    separates = "sweep with three clamp forces, or with point contacts; turn the transducer over; dry the face"
    references = (
        "Kinsler et al., Fundamentals of Acoustics, sections 7.5 and 10",
        "Martin, Granstaff and Frye, Anal. Chem. 63 (1991) 2272 (mass and liquid on one face)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces."""
        return FACES

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the specific resistance in Rayl and the stiffness per area in Pa/m."""
        resistance = 1e-3 * acoustic_impedance(stack)
        return (
            EffectParameter("resistance", "Rayl", resistance, prior=(1e5, 2.0)),
            EffectParameter(
                "stiffness",
                "Pa/m",
                2 * np.pi * resonance(stack) * resistance,
                prior=(0.3 * np.pi * resonance(stack) * 1e5, 2.5),
            ),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with that face pressed against the support."""
        support = Support("face-load", resistance=values["resistance"], stiffness=values["stiffness"])
        return assembly.each_stack(lambda stack: resting_on(stack, where, support))


EFFECT = FaceLoad()
