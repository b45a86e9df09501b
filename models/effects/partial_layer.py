"""`partial-layer`: a layer that does not cover the whole face, or that was glued on beside its place."""

from ..stack import Stack
from .base.effect import EffectParameter
from .base.scale import active
from .bond_void import BondVoid


class PartialLayer(BondVoid):
    """Y = (1 - phi) Y(covered) + phi Y(bare): the part of the face beside the layer vibrates as if there were none."""

    name = "partial-layer"
    lies_on_faces = None
    only_named = True
    says = "{where} does not cover the whole face: it is smaller, or was glued on beside its place."
    separates = "look from above: the bare part of the face is that of the area"
    references = ("Tjelde (NTNU, 2012), section 3.4.2 (layers and glue lines)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer beside which the face can be bare: those on one side of all piezoelectric layers."""
        names = [layer.name for layer in stack.layers]
        own = names.index(active(stack).name)
        bonds = super().places(stack)
        return tuple(
            f"layer:{name}"
            for k, name in enumerate(names)
            if (k > own and f"interface:{names[k - 1]}|{name}" in bonds)
            or (k < own and f"interface:{name}|{names[k + 1]}" in bonds)
        )

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the bare part of the area."""
        return (EffectParameter("fraction", "1", typical=0.01, upper=0.95, prior=(0.05, 1.3)),)


EFFECT = PartialLayer()
