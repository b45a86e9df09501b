"""`bond-void`: part of the bond area transmits no stress (air pockets, debonding), and its rim little."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.face_loads import HasFaces, OpenBond
from ..base.model import Model
from ..stack import AIR, Elastic, Piezo, Spring, Stack
from .base.added_layer import with_layer_between
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage, interface_at, interfaces
from .base.scale import acoustic_impedance, resonance
from .bond_layer import acts_as_glue

_HOLDS = 0.3
"""Spring of the rim while there is none."""
_SCAN = (0.1, 0.4, 1.5)
"""Start values: each lets the rim resonate at a frequency of its own."""
_OPEN = (0.02, 0.06, 0.15, 0.35)
"""Start values of the open part: the plate over it resonates at a frequency of its own."""
_Q = 10.0
"""Quality factor of the rim's spring: glue that has not set well, or was torn."""


class BondVoid(Effect):
    """Y = (1 - phi - rim) Y(bonded) + phi Y(free) + rim Y(weakly bonded): the free resonance reappears, weakly.

    In a stack of finite diameter the opening is round and in the middle, both sides of it bend at its edge, and where
    there is a layer of glue, air is in its place.
    """

    name = "bond-void"
    stage = Stage.VOIDS
    lies_on_faces = OpenBond
    says = "Part of the bond at {where} transmits no stress: an air pocket, or it has come off."
    separates = "examine the bond with an acoustic microscope, or press the parts together while sweeping"
    references = (
        "Baik and Thompson, J. Nondestruct. Eval. 4 (1984) 177 (imperfect interfaces)",
        "Tjelde (NTNU, 2012), section 3.4.2 (glue lines)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the interfaces with all piezoelectric layers on one side.

        `extend` also accepts `layer:NAME`, a void through that whole layer.
        """
        return tuple(where for where in interfaces(stack) if not _between_piezos(stack, where))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the unbonded part of the area, that of its rim relative to it, and the spring that holds the rim.

        The spring is in series with the bond, in units of 2 pi f0 Z0 of the active layer.
        """
        return (
            EffectParameter("fraction", "1", typical=0.01, upper=0.95, prior=(0.05, 1.3)),
            EffectParameter("rim", "1", typical=0.3, upper=1.0, fraction=True),
            EffectParameter("hold", "1", typical=0.1, lower=0.02, upper=5.0, null=_HOLDS, scan=_SCAN, varies=True),
        )

    def parameters_in(self, model: Model, nominal: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the same; the edge of an opening in a stack of finite diameter needs no spring that holds it."""
        plate = self.effect_parameters(nominal, where)
        return plate if not isinstance(model, HasFaces) else (replace(plate[0], scan=_OPEN),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the bonded, the free and the weakly bonded part of the face in parallel."""
        fraction = values["fraction"]
        if fraction <= 0:
            return assembly
        interface = _interface(assembly, where)
        if interface is None:
            return assembly
        if not assembly.parts:
            return assembly.on_face(interface, OpenBond(fraction, _glue_at(assembly.nominal, interface)))
        rim = min(fraction * values.get("rim", 0.0), 1 - fraction)
        unit = 2 * np.pi * resonance(assembly.nominal) * acoustic_impedance(assembly.nominal)
        spring = Spring(f"rim-{where.partition(':')[2]}", values.get("hold", _HOLDS) * unit, _Q)
        own, whole = f"{self.key}@{where}.", rim == 1 - fraction
        by_fraction, by_rim = (-1.0, 0.0) if whole else (rim / fraction, fraction)  # of the rim's part

        def parted(part: ParallelSection) -> tuple[ParallelSection, ...]:
            if not set(interface_at(interface)) <= {layer.name for layer in part.stack.layers}:
                return (part,)  # already cut off by a void nearer to the disk
            if rim <= 0:
                return part.share(1 - fraction), _free(part, interface).share(fraction)
            bonded = part.share(1 - fraction - rim, {f"{own}fraction": -1 - by_fraction, f"{own}rim": -by_rim})
            free = _free(part, interface).share(fraction, {f"{own}fraction": 1.0})
            weak = part.share(rim, {f"{own}fraction": by_fraction, f"{own}rim": by_rim})
            weak = replace(weak, stack=with_layer_between(part.stack, interface, spring))
            return bonded, free, weak.moving({f"{own}hold": {f"{spring.name}.stiffness": unit}})

        return assembly.split(parted)


def _piezos_before(stack: Stack, where: str) -> list[bool]:
    """Return for each piezoelectric layer whether it lies in front of the interface."""
    names = [layer.name for layer in stack.layers]
    k = names.index(interface_at(where)[1])
    return [at >= k for at, layer in enumerate(stack.layers) if isinstance(layer, Piezo)]


def _between_piezos(stack: Stack, where: str) -> bool:
    return len(set(_piezos_before(stack, where))) > 1


def _interface(assembly: Assembly, where: str) -> str | None:
    """Return the interface; for `layer:NAME` the one on the layer's side towards the piezoelectric layers.

    None if the device has no such layer.
    """
    if not where.startswith("layer:"):
        return where
    name = where.removeprefix("layer:")
    having = (one for one in (assembly.nominal, assembly.stack) if name in {layer.name for layer in one.layers})
    stack = next(having, None)
    if stack is None:
        return None
    names = [layer.name for layer in stack.layers]
    k = names.index(name)
    first = next(at for at, layer in enumerate(stack.layers) if isinstance(layer, Piezo))
    behind, before = (names[k - 1], names[k]) if first < k else (names[k], names[k + 1])
    return f"interface:{behind}|{before}"


def _glue_at(stack: Stack, where: str) -> str:
    """Return the name of the layer of glue at an interface, between two others; empty if there is none."""
    inner = stack.layers[1:-1]
    glue = [one.name for one in inner if isinstance(one, Elastic) and acts_as_glue(one, stack)]
    return next((name for name in interface_at(where) if name in glue), "")


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
