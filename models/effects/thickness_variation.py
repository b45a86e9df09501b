"""`thickness-variation`: faces that are not parallel, or a distribution of thickness over the area."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..base.arrays import Reals
from ..stack import Stack, Strips
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.scale import active

_FEWEST, _MOST = 7, 97
"""Number of strips, at least and at most."""
_NEARLY = 1e-7
"""Tolerated error of the mean over the face, relative to it; determines the number of strips."""
_WEDGE, _ARCHED = 1.0, 0.6
"""Shape of a wedge, and of faces that are mostly far from the mean; at 1/2 the quadrature is singular."""
_NORMAL = 60.0
"""Largest shape: a normal distribution leaves 0.1 % of ln Z even where the spread is twice the width of a line."""
_TAILS = 4.5
"""Standard deviations that count: beyond, a distribution of large shape has no weight."""
_STEP = 1e-4
"""Half step of the derivative by the shape; its error is of the order of its square."""
_THIN = 0.1
"""In units of the disk's thickness: a glue line varies by tens of per cent, ground layers by one."""
_WIDEST = 0.95
"""Largest half range of thickness, relative to its mean."""


class ThicknessVariation(Effect):
    """Parallel strips of different thickness: Y is the mean of Y(t) over a symmetric distribution of t.

    (t/t0 - 1)/w has the density (1 - x^2)^(shape - 1) in -1 ... 1 (a beta distribution): shape 1 is uniform, for a
    rectangular wedge or a dome-shaped disk; 3/2 is a wedge-shaped disk; large values are nearly normal, as for
    roughness.
    """

    name = "thickness-variation"
    divides = True
    stage = Stage.SHARES
    says = "The faces of {where} are not parallel: its thickness varies over the area."
    separates = "measure the thickness at five places with a micrometer, or sweep the third overtone"
    references = ("Y = integral of p(t) Y(t); micrometer maps show +-0.5 % on lapped disks",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if "thickness" in layer.parameters())

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the variance of the relative thickness (on which Z depends linearly), and the shape."""
        name = layer_at(where)
        thin = stack.parameters()[f"{name}.thickness"] < _THIN * active(stack).thickness
        shape = EffectParameter("shape", "1", typical=0.5, lower=_ARCHED, upper=_NORMAL, null=_WEDGE, varies=True)
        if thin:
            return (EffectParameter("variance", "1", typical=0.02, upper=0.3, prior=(0.02, 1.5)), shape)
        typical = 3e-6 if name == active(stack).name else 1e-4
        return (EffectParameter("variance", "1", typical=typical, upper=0.01, prior=(typical, 2.0)), shape)

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return half the relative range of thickness of a wedge with this variance.

        For a small effect a recording determines the variance, but hardly the shape on which the true range depends.
        """
        return {"half_range": (_half_range({**values, "shape": _WEDGE}), "1")}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as parallel strips."""
        w, shape = _half_range(values), values["shape"]
        if w == 0:
            return assembly

        wide = min(w, _TAILS * float(np.sqrt(values["variance"])))

        def varied(part: ParallelSection) -> list[ParallelSection]:
            each = part.each_strip()
            nodes, weights = _gauss(_strips(part.stack, wide, max(one.fraction for one in each)), shape)
            moved_by = {
                f"{self.key}@{where}.variance": lambda: (_by_variance(values) * nodes, np.zeros_like(weights)),
                f"{self.key}@{where}.shape": lambda: _by_shape(values, nodes.size),
            }
            strips = Strips(layer_at(where), 1 + w * nodes, weights, moved_by)
            return [replace(one, strips=strips) for one in each]

        return assembly.split(varied)


def _half_range(values: Mapping[str, float]) -> float:
    """Return w of the distribution with this variance and shape, below 1 because no thickness is negative."""
    return min(_WIDEST, float(np.sqrt((2 * values["shape"] + 1) * values["variance"])))


def _by_variance(values: Mapping[str, float]) -> float:
    """Return the derivative of w by the variance."""
    w = _half_range(values)
    return 0.0 if w == _WIDEST else (2 * values["shape"] + 1) / (2 * w)


def _by_shape(values: Mapping[str, float], n: int) -> tuple[Reals, Reals]:
    """Return the derivatives of n factors and weights by the shape, at a fixed variance."""
    w, shape = _half_range(values), values["shape"]
    (nodes, weights), (further, heavier) = _gauss(n, shape - _STEP), _gauss(n, shape + _STEP)
    of_w = 0.0 if w == _WIDEST else values["variance"] / w
    return of_w * (nodes + further) / 2 + w * (further - nodes) / (2 * _STEP), (heavier - weights) / (2 * _STEP)


def _strips(stack: Stack, w: float, fraction: float) -> int:
    """Return the number of strips of a range: Gauss's error falls by rho^2 with each, rho by how far poles are.

    On a part of the face a larger relative error is tolerated, inversely to its `fraction`.
    """
    c33D = active(stack).c33D
    away = c33D.imag / (2 * c33D.real * w)
    needed = np.log(fraction / _NEARLY) / (2 * np.arcsinh(max(away, 1e-3)))
    return min(max(int(np.ceil(needed)), _FEWEST), _MOST)


@lru_cache(maxsize=64)
def _gauss(n: int, shape: float) -> tuple[Reals, Reals]:
    """Return nodes and normalised weights of Gauss-Jacobi quadrature with the density of this shape."""
    from scipy.special import roots_jacobi  # imported late: a list of the effects need not wait for it

    nodes, weights = roots_jacobi(n, shape - 1, shape - 1)
    return nodes, weights / np.sum(weights)


EFFECT = ThicknessVariation()
