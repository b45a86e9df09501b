"""`thickness-variation`: faces that are not parallel; a distribution of thickness over the area."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..stack import Stack
from .assembly import Assembly, Part
from .effect import Effect, Knob, Stage, layer_at
from .scale import active

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(9)
"""Exact while the resonance moves by less than some line widths over the face."""
_THIN = 0.1
"""Of the disk's thickness: a glue line varies by tens of per cent where ground layers vary by one."""


class ThicknessVariation(Effect):
    """Strips of different thickness side by side: Y = mean of Y(t), t uniform in t0 (1 - w) ... t0 (1 + w)."""

    name = "thickness-variation"
    stage = Stage.SHARES
    says = "The faces of {where} are not parallel: its thickness varies over the area."
    separates = "measure the thickness at five places with a micrometer, or sweep the third overtone"
    references = ("left-out physics 4.2: Y = integral of p(t) Y(t); micrometer maps show +-0.5 % on lapped disks",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if "thickness" in layer.parameters())

    def knobs(self, stack: Stack, where: str) -> tuple[Knob, ...]:
        """Return the variance of the thickness, relative to its mean squared; the effect is linear in it."""
        name = layer_at(where)
        thin = stack.parameters()[f"{name}.thickness"] < _THIN * active(stack).thickness
        if thin:
            return (Knob("variance", "1", typical=0.02, upper=0.3),)
        return (Knob("variance", "1", typical=3e-6 if name == active(stack).name else 1e-4, upper=0.01),)

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return half the range of thickness, relative to its mean."""
        return {"half_range": (float(np.sqrt(3 * values["variance"])), "1")}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as strips side by side."""
        name, w = f"{layer_at(where)}.thickness", float(np.sqrt(3 * values["variance"]))
        if w == 0:
            return assembly

        def strips(part: Part) -> list[Part]:
            t0 = part.stack.parameters()[name]
            return [
                replace(
                    part,
                    fraction=part.fraction * weight / 2,
                    stack=part.stack.replace({name: t0 * (1 + w * node)}),
                    scale={**part.scale, name: part.scale.get(name, 1.0) * (1 + w * node)},
                )
                for node, weight in zip(_NODES.tolist(), _WEIGHTS.tolist(), strict=True)
            ]

        return assembly.split(strips)


EFFECT = ThicknessVariation()
