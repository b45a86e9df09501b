"""`viscous-load`: a liquid on a face that is dragged along by its viscosity."""

from collections.abc import Mapping

import numpy as np

from ..base.face_loads import FACES
from ..stack import Stack
from ..stack.loads import ShearedLiquid
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter
from .base.modified_loads import resting_on
from .base.scale import acoustic_impedance, resonance


class ViscousLoad(Effect):
    """(1 + j) sqrt(w rho eta / 2) added to the load of a face: as much reactance as resistance."""

    name = "viscous-load"
    errs_roughly = False
    odds = 0.3  # a face that moves along its normal drags little along: what loads it is mostly a `face-load`
    says = "A viscous liquid or paste that the build omits is dragged along by {where}."
    separates = "clean and dry the face; a liquid of another viscosity changes it by the square root of the ratio"
    references = (
        "Kanazawa and Gordon, Anal. Chem. 57 (1985) 1770",
        "Martin, Granstaff and Frye, Anal. Chem. 63 (1991) 2272 (mass and liquid on one face)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces."""
        return FACES

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the resistance at the resonance in Rayl: 2500 of water at 2 MHz, some 1e5 of glycerol."""
        typical = 1e-3 * acoustic_impedance(stack)
        return (EffectParameter("resistance", "Rayl", typical, upper=0.3e3 * typical, prior=(3e4, 1.5)),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the liquid on that face."""
        if values["resistance"] == 0:
            return assembly
        liquid = ShearedLiquid(self.name, values["resistance"] ** 2 / (np.pi * resonance(assembly.nominal)))
        return assembly.each_stack(lambda stack: resting_on(stack, where, liquid))


EFFECT = ViscousLoad()
