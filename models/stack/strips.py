"""A layer whose thickness is distributed over the area: parallel strips of the stack, evaluated together."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals, j_omega
from .acoustic_line import Line, one_minus_exp
from .active import ActiveLine
from .graded import sections_by_layer, slices_of
from .layers import Elastic, Piezo
from .loss_laws import ComplexLike
from .network import Network, Section
from .sections import sections_of
from .slopes import Slopes
from .stack import Stack

_TOGETHER = 8192
"""Largest number of elements per array, so that the arrays fit into the processor's cache."""


@dataclass(frozen=True, eq=False)
class Strips:
    """A distribution of one layer's thickness, as strips of the area."""

    layer: str
    factors: Reals
    """Thickness of each strip's layer, relative to the stack's, shape (Q,)."""
    fractions: Reals
    """Part of the area of each strip, shape (Q,)."""
    moved_by: Mapping[str, Callable[[], tuple[Reals, Reals]]] = field(
        default_factory=dict[str, Callable[[], tuple[Reals, Reals]]]
    )
    """By parameter of the distribution: a function that returns the derivatives of factors and fractions."""

    def admittance(self, stack: Stack, frequency: Frequencies) -> Complexes:
        """Return the admittance of all strips of a stack, S, shape (N,)."""
        total = np.zeros(frequency.size, np.complex128)
        for part, network in self._networks(stack, frequency):
            total += self.fractions[part] @ (stack.area / network.Z)
        return total

    def jacobian(self, stack: Stack, frequency: Frequencies, names: Sequence[str]) -> tuple[Complexes, Complexes]:
        """Return the same, and its derivatives, shape (P, N), by parameters of the stack or of the distribution."""
        loads = {"back": stack.back, "front": stack.front}
        total = np.zeros(frequency.size, np.complex128)
        slopes = np.zeros((len(names), frequency.size), np.complex128)
        moved = {name: self.moved_by[name]() for name in names if name in self.moved_by}
        thickness, layer = f"{self.layer}.thickness", self._found(stack)
        for part, network in self._networks(stack, frequency):
            admittance = stack.area / network.Z
            total += self.fractions[part] @ admittance
            weight = -self.fractions[part, None] * admittance / network.Z
            of_layers = Slopes(network, stack.layers, loads, frequency, stack.bolt)
            sums: dict[tuple[str, str], Complexes] = {}  # over the strips
            for p, name in enumerate(names):
                if name == "area":
                    slopes[p] -= _over_strips(weight, network.Z + network.path_weight) / stack.area
                    continue
                quantity, each, size = of_layers.factors(thickness if name in moved else name)
                if name in moved:
                    factors, fractions = moved[name]
                    relative = layer.thickness * factors[part] / self.factors[part]
                    slopes[p] += fractions[part] @ admittance + _over_strips(relative[:, None] * weight, each) * size
                    continue
                if quantity not in sums:
                    sums[quantity] = _over_strips(weight, each)
                slopes[p] += sums[quantity] * size
        return total, slopes

    def _networks(self, stack: Stack, frequency: Frequencies) -> Iterator[tuple[slice, Network]]:
        """Yield slices of the strips, and their networks: quantities that depend on the thickness have shape (Q, N)."""
        layer = self._found(stack)
        own = sections_by_layer(stack.layers)[layer.name]
        loads = stack.back.impedance(frequency), stack.front.impedance(frequency)
        sections = sections_of(stack.layers, frequency)
        path = stack.path(frequency)
        few = max(1, _TOGETHER // frequency.size)
        for at in range(0, self.factors.size, few):
            part = slice(at, min(at + few, self.factors.size))
            sections[own.start : own.stop] = (
                _line(one, frequency, self.factors[part, None]) for one in slices_of(layer)
            )
            yield part, Network(sections, *loads, parallel=stack.connection == "parallel", path=path)

    def _found(self, stack: Stack) -> Elastic | Piezo:
        """Return the layer of varied thickness. Raises KeyError if a stack has no such layer."""
        for layer in stack.layers:
            if layer.name == self.layer and isinstance(layer, Elastic | Piezo):
                return layer
        raise KeyError(f"no layer {self.layer!r} with a thickness in the stack")


def _over_strips(weight: Complexes, each: ComplexLike) -> Complexes:
    """Return the weighted sum over strips, shape (N,); `each`: of every strip, shape (Q, N), or the same for all."""
    return np.einsum("qn,qn->n", weight, np.broadcast_to(each, weight.shape))


def _line(layer: Elastic | Piezo, frequency: Frequencies, part: Reals) -> Section:
    """Return a layer at its thickness times each `part`, shape (Q, 1): its quantities have shape (Q, N)."""
    jw = j_omega(frequency)
    Zc, delay = layer.wave(frequency)
    delays = np.asarray(delay * part, np.complex128)
    D = one_minus_exp(delays.imag * jw.imag, 0.5 * delays.real * jw.imag)
    b = D * (1.0 - 0.5 * D)
    if isinstance(layer, Elastic):
        return Line(Zc, delays, jw, D, b)
    H = np.asarray(layer.field_per_strain(frequency) / jw, np.complex128)
    W = np.asarray(layer.clamped_elastance(frequency) * part / jw, np.complex128)
    return ActiveLine(Zc, delays, jw, D, b, H, W, layer.h33 != 0)
