"""`bond-layer`: a glue layer of finite thickness that the build omits."""

from collections.abc import Mapping

from ..stack import Elastic, Stack
from .base.added_layer import with_layer_between
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, interface_at, interfaces
from .base.scale import resonance

_Z, _C, _LOSS = 2.9e6, 2550.0, 1 / 30
"""Unfilled epoxy: Rayl, m/s and loss tangent. Of a thin layer only the compliance l/(z c) and its loss are visible, so
impedance and velocity are assumed."""
_LOSSES = (0.05, 0.03)
"""Prior loss tangent, mean and standard deviation: quality 10 where it is half cured, 50 where it is hard."""
SOFT, _THIN = 5e6, 0.05
"""Impedance (Rayl) and thickness (wavelengths at the active layer's resonance) below which a layer acts as glue."""
THICKEST = 2e-4
"""Greatest thickness of a glue line, m."""
_LEAST = 1e-3
"""Loss tangent below which glue counts as lossless."""


class BondLayer(Effect):
    """A thin soft layer between two others: a spring with a little mass."""

    name = "bond-layer"
    says = "There is a layer of glue at {where} that the build omits."
    separates = "measure the total thickness before and after gluing, or examine a cross-section"
    references = ("Tjelde (NTNU, 2012), section 3.4.2 and appendix B",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every interface."""
        return interfaces(stack)

    def looked_for(self, stack: Stack) -> tuple[str, ...]:
        """Return the interfaces, but none to a layer of glue: another one there would only make it thicker."""
        glue = {layer.name for layer in stack.layers if isinstance(layer, Elastic) and acts_as_glue(layer, stack)}
        return tuple(where for where in interfaces(stack) if not glue & set(interface_at(where)))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the thickness in metre, for an epoxy of 2.9 MRayl and 2550 m/s, and the loss tangent."""
        return (
            EffectParameter("thickness", "m", typical=5e-6, upper=THICKEST, prior=(8e-6, 1.0)),
            EffectParameter("loss", "1", typical=0.03, upper=0.5, null=_LOSS, prior=_LOSSES),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the glue in its place."""
        thickness = values["thickness"]
        if thickness <= 0:
            return assembly
        q = 1 / max(values.get("loss", _LOSS), _LEAST)
        bond = Elastic(f"bond-{where.removeprefix('interface:')}", thickness=thickness, z=_Z, c=_C, q=q)
        return assembly.each_stack(lambda stack: with_layer_between(stack, where, bond))


def acts_as_glue(layer: Elastic, stack: Stack) -> bool:
    """Return whether a layer is so soft and thin that only its compliance is visible."""
    return layer.z < SOFT and layer.thickness < _THIN * layer.c / resonance(stack)


EFFECT = BondLayer()
