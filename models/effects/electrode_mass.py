"""`electrode-mass`: an electrode (or wax, ink) that the build omits, as a mass."""

from collections.abc import Mapping

from ..stack import Mass, Stack
from .base.added_layer import with_layer_on_piezo
from .base.assembly import Assembly
from .base.effect import FACES, Effect, EffectParameter, interfaces
from .base.scale import areal_mass


class ElectrodeMass(Effect):
    """A mass on a face or between two layers; within one band it resembles a softer or thicker disk, to 0.2 %."""

    name = "electrode-mass"
    stays = True
    errs_roughly = False
    says = "There is a mass at {where} that the build omits: an electrode, wax or ink."
    separates = (
        "weigh the disk and measure its thickness, or sweep the third and fifth overtone; one band is not enough"
    )
    references = (
        "Sauerbrey, Z. Phys. 155 (1959) 206",
        "Miller and Bolef, J. Appl. Phys. 39 (1968) 5815 (a film beyond the limit of small mass)",
        "left-out physics 4.2",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces and every interface."""
        return (*FACES, *interfaces(stack))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the mass per area in kg/m2."""
        unit = areal_mass(stack)
        return (EffectParameter("mass", "kg/m2", typical=5e-3 * unit, upper=unit, prior=(1.2e-2, 1.3)),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the mass in its place."""
        mass = values["mass"]
        if mass <= 0:
            return assembly
        paste = Mass(f"{self.name}@{where}", mass)
        return assembly.each_stack(lambda stack: with_layer_on_piezo(stack, where, paste))


EFFECT = ElectrodeMass()
