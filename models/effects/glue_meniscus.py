"""`glue-meniscus`: glue is thicker on a part of the area, as at its rim."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import Elastic, Stack
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .bond_layer import THICKEST, acts_as_glue


class GlueMeniscus(Effect):
    """Y = (1 - phi) Y + phi Y(thicker glue): a part of the bond, mostly its rim, has a resonance of its own.

    Glue whose thickness is spread over all of the area has a `thickness-variation`.
    """

    name = "glue-meniscus"
    stage = Stage.SHARES
    only_named = True
    says = "{where} is thicker on a part of the area: a meniscus at its rim, or a drop that was not pressed out."
    separates = "look at the rim under a microscope, and wipe off the glue before it sets"
    references = ("Tjelde (NTNU, 2012), section 3.4.2 (glue lines)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer of glue."""
        glue = (layer for layer in stack.layers if isinstance(layer, Elastic) and acts_as_glue(layer, stack))
        return tuple(f"layer:{layer.name}" for layer in glue)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the part of the area, and how much thicker the glue is there, m."""
        return (
            EffectParameter("fraction", "1", typical=0.01, upper=0.9, prior=(0.05, 1.3)),
            EffectParameter(
                "thickness", "m", typical=1e-5, lower=1e-6, upper=THICKEST, null=2e-5, scan=(5e-6, 2e-5, 8e-5)
            ),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with both parts of the bond in parallel."""
        fraction, name = values["fraction"], f"{layer_at(where)}.thickness"
        if fraction <= 0:
            return assembly

        def parted(part: ParallelSection) -> tuple[ParallelSection, ...]:
            now = part.stack.parameters()
            if name not in now:
                return (part,)
            thicker = part.stack.replace({name: now[name] + values["thickness"]})
            return part.share(1 - fraction), replace(part.share(fraction), stack=thicker)

        return assembly.split(parted)


EFFECT = GlueMeniscus()
