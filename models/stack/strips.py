"""Parallel stacks: those that differ in the thickness of one layer only are evaluated together."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals, j_omega
from .acoustic_line import Line, one_minus_exp
from .active import ActiveLine
from .layers import Elastic, Piezo
from .network import Network, Section
from .sections import sections_of
from .slopes import Slopes
from .stack import Stack

_TOGETHER = 4096
"""Largest number of elements per array, so that the arrays fit into the processor's cache."""


def parallel_admittance(stacks: Sequence[Stack], fractions: Sequence[float], frequency: Frequencies) -> Complexes:
    """Return the sum of fraction/Z, S, shape (N,), of Q stacks."""
    alike: dict[tuple[object, ...], list[int]] = defaultdict(list)
    for i, stack in enumerate(stacks):
        alike[tuple(layer.name for layer in stack.layers), stack.back, stack.front].append(i)
    total = np.zeros(frequency.size, np.complex128)
    for indices in alike.values():
        total += _together([stacks[i] for i in indices], np.array([fractions[i] for i in indices]), frequency)
    return total


def parallel_jacobian(
    stacks: Sequence[Stack], fractions: Reals, frequency: Frequencies, names: Sequence[str], scale: Reals
) -> tuple[Complexes, Complexes] | None:
    """Return the sum of fraction/Z, S, shape (N,), and its derivatives by each parameter, shape (P, N).

    `scale`, shape (Q, P), is d (parameter of a stack) / d (parameter of the device). None if the stacks differ in more
    than the thickness of one layer.
    """
    varied = _varied(stacks)
    if varied is None:
        return None
    k, thickness = varied
    first = stacks[0]
    loads = {"back": first.back, "front": first.front}
    total = np.zeros(frequency.size, np.complex128)
    slopes = np.zeros((len(names), frequency.size), np.complex128)
    for part, network in _networks(first, k, thickness, frequency):
        total += fractions[part] @ (first.area / network.Z)
        weight = -fractions[part, None] * first.area / network.Z**2
        of_layers = Slopes(network, first.layers, loads, frequency, first.bolt)
        row = np.empty(network.Z.shape, np.complex128)
        for p, name in enumerate(names):
            if name == "area":
                np.multiply(network.Z + network.path_weight, -1 / first.area, out=row)
            else:
                of_layers.write(name, row)
            if name == f"{first.layers[k].name}.thickness":
                row *= thickness[0] / thickness[part, None]
            slopes[p] += np.einsum("qn,qn->n", weight * scale[part, p, None], row)
    return total, slopes


def _together(stacks: Sequence[Stack], fractions: Reals, frequency: Frequencies) -> Complexes:
    """Return the sum of fraction/Z of stacks with the same layers, with array operations over those that allow it."""
    varied = _varied(stacks)
    total = np.zeros(frequency.size, np.complex128)
    if varied is None:
        for stack, fraction in zip(stacks, fractions.tolist(), strict=True):
            total += fraction / stack.impedance(frequency)
        return total
    for part, network in _networks(stacks[0], *varied, frequency):
        total += fractions[part] @ (stacks[0].area / network.Z)
    return total


def _networks(first: Stack, k: int, thickness: Reals, frequency: Frequencies) -> Iterator[tuple[slice, Network]]:
    """Yield slices of the stacks, and their networks: quantities that depend on the thickness have shape (Q, N)."""
    loads = first.back.impedance(frequency), first.front.impedance(frequency)
    sections = sections_of(first.layers, frequency)
    path = first.path(frequency)
    few = max(1, _TOGETHER // frequency.size)
    for at in range(0, len(thickness), few):
        part = slice(at, min(at + few, len(thickness)))
        sections[k] = _line(first.layers[k], frequency, thickness[part, None])
        yield part, Network(sections, *loads, parallel=first.connection == "parallel", path=path)


def _varied(stacks: Sequence[Stack]) -> tuple[int, Reals] | None:
    """Return the index of the only layer that differs, and its thickness in each stack; None if more differs."""
    first = stacks[0]
    if len(stacks) < 2:
        return None
    known = Stack.varied_layer(stacks)
    if known is not None:
        return known, _thicknesses(stacks, known)
    places: set[int] = set()
    for other in stacks[1:]:
        ends = (first.back, other.back), (first.front, other.front), (first.area, other.area), (first.bolt, other.bolt)
        if len(other.layers) != len(first.layers) or any(a is not b and a != b for a, b in ends):
            return None
        places |= {k for k, (a, b) in enumerate(zip(first.layers, other.layers, strict=True)) if a is not b}
    if len(places) != 1:
        return None
    k = places.pop()
    layers = [stack.layers[k] for stack in stacks]
    if not all(_same_but_thickness(layers[0], layer) for layer in layers[1:]):
        return None
    return k, _thicknesses(stacks, k)


def _thicknesses(stacks: Sequence[Stack], k: int) -> Reals:
    layers = [stack.layers[k] for stack in stacks]
    return np.array([layer.thickness for layer in layers if isinstance(layer, Elastic | Piezo)])


def _same_but_thickness(first: object, second: object) -> bool:
    if type(first) is not type(second) or not isinstance(first, Elastic | Piezo):
        return False
    others = vars(second)
    return all(key == "thickness" or value is others[key] or value == others[key] for key, value in vars(first).items())


def _line(layer: object, frequency: Frequencies, thickness: Reals) -> Section:
    """Return a layer at all of these thicknesses, shape (Q, 1): its quantities have shape (Q, N)."""
    if not isinstance(layer, Elastic | Piezo):
        raise TypeError(f"no thickness in {type(layer).__name__}")
    jw = j_omega(frequency)
    Zc, delay = layer.wave(frequency)
    part = thickness / layer.thickness
    delays = np.asarray(delay * part, np.complex128)
    D = one_minus_exp(delays.imag * jw.imag, 0.5 * delays.real * jw.imag)
    b = D * (1.0 - 0.5 * D)
    if isinstance(layer, Elastic):
        return Line(Zc, delays, jw, D, b)
    H = np.asarray(layer.field_per_strain(frequency) / jw, np.complex128)
    W = np.asarray(layer.clamped_elastance(frequency) * part / jw, np.complex128)
    return ActiveLine(Zc, delays, jw, D, b, H, W)
