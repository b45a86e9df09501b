"""`bond-void`: part of the bond area transmits no stress (air pockets, debonding)."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import AIR, Piezo, Stack
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage, interface_at, interfaces


class BondVoid(Effect):
    """Y = (1 - phi) Y(bonded) + phi Y(free): the resonance of the unbonded part reappears, weakly."""

    name = "bond-void"
    stage = Stage.VOIDS
    says = "Part of the bond at {where} transmits no stress: an air pocket, or it has come off."
    separates = "examine the bond with an acoustic microscope, or press the parts together while sweeping"
    references = ("left-out physics 4.5", "Tjelde (NTNU, 2012), section 3.4.2 (glue lines)")

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the interfaces with all piezoelectric layers on one side.

        `extend` also accepts `layer:NAME`, a void through that whole layer.
        """
        return tuple(where for where in interfaces(stack) if not _between_piezos(stack, where))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the unbonded part of the area."""
        return (EffectParameter("fraction", "1", typical=0.01, upper=0.95, prior=(0.05, 1.3)),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the bonded and the free part of the face in parallel."""
        fraction, interface = values["fraction"], _interface(assembly.nominal, where)
        if fraction <= 0:
            return assembly

        def parted(part: ParallelSection) -> tuple[ParallelSection, ...]:
            if not set(interface_at(interface)) <= {layer.name for layer in part.stack.layers}:
                return (part,)  # already cut off by a void nearer to the disk
            free = _free(part, interface)
            return (
                replace(part, fraction=part.fraction * (1 - fraction)),
                replace(free, fraction=part.fraction * fraction),
            )

        return assembly.split(parted)


def _piezos_before(stack: Stack, where: str) -> list[bool]:
    """Return for each piezoelectric layer whether it lies in front of the interface."""
    names = [layer.name for layer in stack.layers]
    k = names.index(interface_at(where)[1])
    return [at >= k for at, layer in enumerate(stack.layers) if isinstance(layer, Piezo)]


def _between_piezos(stack: Stack, where: str) -> bool:
    return len(set(_piezos_before(stack, where))) > 1


def _interface(stack: Stack, where: str) -> str:
    """Return the interface; for `layer:NAME` the one on the layer's side towards the piezoelectric layers."""
    if not where.startswith("layer:"):
        return where
    names = [layer.name for layer in stack.layers]
    k = names.index(where.removeprefix("layer:"))
    first = next(at for at, layer in enumerate(stack.layers) if isinstance(layer, Piezo))
    behind, before = (names[k - 1], names[k]) if first < k else (names[k], names[k + 1])
    return f"interface:{behind}|{before}"


def _free(part: ParallelSection, where: str) -> ParallelSection:
    """Return the part of the face without everything beyond the interface, ending in air.

    What other effects added between the two layers remains: an electrode belongs to the disk.
    """
    stack, names = part.stack, [layer.name for layer in part.stack.layers]
    behind, before = interface_at(where)
    to_front = not any(_piezos_before(stack, where))
    side = "front" if to_front else "back"
    kept = stack.layers[: names.index(before)] if to_front else stack.layers[names.index(behind) + 1 :]
    cut = replace(stack, layers=kept, front=AIR) if to_front else replace(stack, layers=kept, back=AIR)
    still = {f"{side}.{name}": 0.0 for name in AIR.parameters()}
    strips = part.strips if part.strips is not None and part.strips.layer in {layer.name for layer in kept} else None
    return replace(part, stack=cut, scale={**part.scale, **still}, strips=strips)


EFFECT = BondVoid()
