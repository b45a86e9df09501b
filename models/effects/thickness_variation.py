"""`thickness-variation`: faces that are not parallel; a distribution of thickness over the area."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.special import roots_jacobi

from ..base.arrays import Reals
from ..stack import Stack
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.scale import active

_STRIPS = (9, 17, 33, 65)
_NEARLY = 1e-7
"""Error of the mean over the face, relative, that more strips would mend."""
_WEDGE, _ARCHED = 1.0, 0.6
"""Shape of a wedge, and of the faces that are mostly far from the mean; at 1/2 quadrature has a singular case."""
_THIN = 0.1
"""Of the disk's thickness: a glue line varies by tens of per cent where ground layers vary by one."""
_WIDEST = 0.95
"""Half the range of thickness, relative to its mean, at most."""


class ThicknessVariation(Effect):
    """Strips of different thickness side by side: Y = mean of Y(t) over a symmetric distribution of t.

    (t/t0 - 1)/w has the density (1 - x^2)^(shape - 1) in -1 ... 1 (a beta distribution): shape 1 is uniform, as of a
    rectangle that is a wedge or a disk that is a dome; 3/2 a disk that is a wedge; large ones nearly normal, as of
    roughness.
    """

    name = "thickness-variation"
    stage = Stage.SHARES
    says = "The faces of {where} are not parallel: its thickness varies over the area."
    separates = "measure the thickness at five places with a micrometer, or sweep the third overtone"
    references = ("left-out physics 4.2: Y = integral of p(t) Y(t); micrometer maps show +-0.5 % on lapped disks",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if "thickness" in layer.parameters())

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the variance of the thickness, relative to its mean squared (it acts linearly), and the shape."""
        name = layer_at(where)
        thin = stack.parameters()[f"{name}.thickness"] < _THIN * active(stack).thickness
        shape = EffectParameter("shape", "1", typical=0.5, lower=_ARCHED, upper=8.0, null=_WEDGE)
        if thin:
            return (EffectParameter("variance", "1", typical=0.02, upper=0.3, prior=(0.02, 1.5)), shape)
        own = 3e-6 if name == active(stack).name else 1e-4
        return (EffectParameter("variance", "1", typical=own, upper=0.01, prior=(own, 2.0)), shape)

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return half the range of thickness, relative to its mean, of a wedge of this variance.

        Where the effect is small a recording tells the variance, and hardly the shape on which the true range hangs.
        """
        return {"half_range": (_half_range({**values, "shape": _WEDGE}), "1")}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as strips side by side."""
        name, w = f"{layer_at(where)}.thickness", _half_range(values)
        if w == 0:
            return assembly

        def strips(part: ParallelSection) -> list[ParallelSection]:
            t0 = part.stack.parameters()[name]
            nodes, weights = _gauss(_strips(part.stack, w), values["shape"])
            return [
                replace(
                    part,
                    fraction=part.fraction * weight,
                    stack=part.stack.replace({name: t0 * (1 + w * node)}),
                    scale={**part.scale, name: part.scale.get(name, 1.0) * (1 + w * node)},
                )
                for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True)
            ]

        return assembly.split(strips)


def _half_range(values: Mapping[str, float]) -> float:
    """Return w of the distribution of this variance and shape: less than 1, for nothing is thinner than nothing."""
    return min(_WIDEST, float(np.sqrt((2 * values["shape"] + 1) * values["variance"])))


def _strips(stack: Stack, w: float) -> int:
    """Return how many strips it takes: Gauss's error falls by rho^2 with each, rho by how far off the poles are."""
    c33D = active(stack).c33D
    away = c33D.imag / (2 * c33D.real * w)
    needed = -np.log(_NEARLY) / (2 * np.arcsinh(max(away, 1e-3)))
    return next((n for n in _STRIPS if n >= needed), _STRIPS[-1])


@lru_cache(maxsize=64)
def _gauss(n: int, shape: float) -> tuple[Reals, Reals]:
    """Return nodes and weights, their sum 1, of Gauss and Jacobi's quadrature with the density of this shape."""
    nodes, weights = roots_jacobi(n, shape - 1, shape - 1)
    return nodes, weights / np.sum(weights)


EFFECT = ThicknessVariation()
