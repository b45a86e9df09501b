"""`electrode-mass`: an electrode (or wax, ink) that the build omits, as a mass."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import Mass, Piezo, Stack
from .base.added_layer import with_layer_on_piezo, with_layers_around
from .base.assembly import Assembly, ParallelSection
from .base.effect import FACES, Effect, EffectParameter, interfaces, layer_at
from .base.scale import areal_mass


class ElectrodeMass(Effect):
    """A mass on a face, between two layers, or the same on both faces of a ceramic, as electrodes are printed.

    Within one band it resembles a softer or thicker disk, to 0.2 %.
    """

    name = "electrode-mass"
    stays = True
    errs_roughly = False
    says = "There is a mass at {where} that the build omits: an electrode, wax or ink."
    _on_both = "Both faces of {where} have a mass that the build omits: electrodes."
    separates = (
        "weigh the disk and measure its thickness, or sweep the third and fifth overtone; one band is not enough"
    )
    references = (
        "Sauerbrey, Z. Phys. 155 (1959) 206",
        "Miller and Bolef, J. Appl. Phys. 39 (1968) 5815 (a film beyond the limit of small mass)",
        "left-out physics 4.2",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces, every interface, and every piezoelectric layer for its two faces together."""
        around = (f"layer:{layer.name}" for layer in stack.layers if isinstance(layer, Piezo))
        return (*FACES, *interfaces(stack), *around)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the mass per area in kg/m2, of each face."""
        unit = areal_mass(stack)
        return (EffectParameter("mass", "kg/m2", typical=5e-3 * unit, upper=unit, prior=(1.2e-2, 1.3)),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the mass in its place."""
        mass = values["mass"]
        if mass <= 0:
            return assembly
        paste = Mass(f"{self.name}@{where}", mass)
        if not where.startswith("layer:"):
            return assembly.each_stack(lambda stack: with_layer_on_piezo(stack, where, paste))
        other = replace(paste, name=f"{paste.name}-front")

        def printed(part: ParallelSection) -> ParallelSection:
            stack = with_layers_around(part.stack, layer_at(where), paste, other)
            both = {f"{paste.name}.mass": (f"{other.name}.mass",)}
            return replace(part, stack=stack, linked_parameters={**part.linked_parameters, **both})

        return assembly.split(lambda part: (printed(part),))

    def sentence(self, where: str, sizes: Mapping[str, tuple[float, float, str]]) -> str:
        """Return the sentence for the technician."""
        return (self._on_both if where.startswith("layer:") else self.says).format(where=where)


EFFECT = ElectrodeMass()
