"""A specimen with its flaws as parallel columns, solved as initial-value problems; and its electrode's resistance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import iv, kv

from ...device_under_test import DeviceUnderTest, DiskShape
from ...ritz import finite_disk_admittance
from ...waves import Complexes, LayerColumn, Part, Reals, Slice, respond
from .flaws import Flaws, Side
from .specimen import AIR, Ceramic, LabDevice, LabLayer, lossy

_NODES = 25, 601
"""Fewest and most thicknesses that a distribution is resolved into."""
_TAILS = 6.0
"""Standard deviations at which a normal distribution ends."""
_GRADES = 6
_INSIDE, _AREAS = np.polynomial.legendre.leggauss(40)
_HEIGHTS = 7 / 6 - 5 / 8 * ((1 - _INSIDE) / 2) ** 2 + 1 / 24
"""Heights of a dot of solder relative to the mean, from its rim to its top, where it is flat; `_AREAS` is twice the
part of the area that has each."""
_SILVER = 6500.0, 2800.0, 25.0
"""kg/m3, m/s and Q of fired silver paste."""
_BACKING_SPEED = 2300.0
"""m/s."""


@dataclass(frozen=True, eq=False)
class Instant:
    """Factors of stiffness and permittivity while each point is measured; one number or shape (N,)."""

    stiffness: float | Complexes = 1.0
    permittivity: float | Complexes = 1.0


STILL = Instant()
_Shares = list[tuple[float | Reals, LayerColumn]]


def admittance(f: Reals, specimen: LabDevice, flaws: Flaws, step: str, moment: Instant = STILL) -> Complexes:
    """Return the admittance in S of a step's device without its leads; f in Hz, shape (N,)."""
    whole = None if flaws.lateral else columns(f, specimen, flaws, step, moment)
    total = _finite(f, specimen, flaws.lateral) if whole is None else _sum(f, specimen.area, whole)
    if flaws.neighbour is not None:
        thickness, area = flaws.neighbour
        other = replace(specimen, ceramic=replace(specimen.ceramic, thickness=specimen.ceramic.thickness * thickness))
        total = total + _sum(f, specimen.area * area, columns(f, other, Flaws(), "disk", moment))
    for at, q, strength, how in flaws.modes:
        if how == "beside":
            total = total + 2j * np.pi * f * specimen.C0 * strength / (1 - (f / at) ** 2 + 1j / q)
    return total if flaws.sheet is None else _fed(total, *flaws.sheet)


def strain(f: Reals, specimen: LabDevice, flaws: Flaws, step: str, moment: Instant) -> Complexes:
    """Return the ceramic's mean strain per ampere through the device; 1/A, shape (N,)."""
    omega = 2 * np.pi * f
    shares = columns(f, specimen, replace(flaws, spread=(), dot=None, void=None), step, moment)
    return respond(omega, shares[0][1]).strain / (1j * omega * specimen.area)


def _sum(f: Reals, area: float, shares: _Shares) -> Complexes:
    """Add up columns; a share is one number, or has shape (K, 1) where a column has K thicknesses."""
    total = np.zeros_like(f, np.complex128)
    for share, column in shares:
        Y = share * area / respond(2 * np.pi * f, column).specific_impedance
        total = total + (Y if Y.ndim == 1 else Y.sum(axis=0))
    return total


def columns(f: Reals, specimen: LabDevice, flaws: Flaws, step: str, moment: Instant = STILL) -> _Shares:
    """Return all columns with their fractions of the area."""
    factors, weights = _spread(specimen, flaws)
    layers = _true_layers(specimen, flaws, step)
    whole: _Shares = [(1.0, _column(f, specimen, layers, flaws, step, moment, factors))]
    if flaws.void is not None:
        behind, share, rim = flaws.void
        names = ["disk", *(layer.name for layer in layers)]
        if behind in names and names.index(behind) + 1 < len(names):
            k = names.index(behind)
            soft = replace(layers[k], z=layers[k].z * 0.4, c=layers[k].c * 0.4, q=8.0)  # a sixth of the stiffness
            half = (*layers[:k], soft, *layers[k + 1 :])
            bare = _column(f, specimen, layers[:k], flaws, step, moment, factors)
            frayed = _column(f, specimen, half, flaws, step, moment, factors)
            whole = [(1 - share * (1 + rim), whole[0][1]), (share, bare), (share * rim, frayed)]
    if flaws.dot is not None:
        share, mass, side = flaws.dot
        loaded = [
            (part * share * area / 2, _with_dot(column, mass * height, side))
            for height, area in zip(_HEIGHTS.tolist(), _AREAS.tolist(), strict=True)
            for part, column in whole
        ]
        whole = [(part * (1 - share), column) for part, column in whole] + loaded
    return [(part * weights, column) for part, column in whole]


def _spread(specimen: LabDevice, flaws: Flaws) -> tuple[dict[str, Any], float | Reals]:
    """Return factors on thicknesses by layer, shape (K, 1), and their weights; only the widest one is resolved."""
    if not flaws.spread:
        return {}, 1.0
    layer, sigma, shape = max(flaws.spread, key=lambda one: one[1])
    # twelve standard deviations, in steps of a sixth of the width of a resonance
    wide = 72 * sigma * specimen.ceramic.c33D.real / specimen.ceramic.c33D.imag if layer == "disk" else 72.0
    nodes = int(np.clip(wide, *_NODES))
    x = (np.arange(nodes) + 0.5) / nodes * 2 - 1
    if shape == "gauss":
        w = np.exp(-0.5 * (_TAILS * x) ** 2)
    else:
        w = 1 - np.abs(x) if shape == "triangle" else (1 + x) ** 2 * (1 - x)
    w = w / w.sum()
    x = x - w @ x
    x = x / np.sqrt(w @ x**2)
    return {layer: (1 + sigma * x)[:, None]}, np.asarray(w)[:, None]


def _true_layers(specimen: LabDevice, flaws: Flaws, step: str) -> tuple[LabLayer, ...]:
    layers = specimen.layers_of(step)
    if flaws.untold is None:
        return layers
    name, thickness = flaws.untold
    there = (replace(layer, thickness=thickness) if layer.name == name else layer for layer in layers)
    return tuple(layer for layer in there if layer.thickness > 0)


def _column(
    f: Reals,
    specimen: LabDevice,
    layers: Sequence[LabLayer],
    flaws: Flaws,
    step: str,
    moment: Instant,
    factors: dict[str, Any],
) -> LayerColumn:
    x = f / specimen.ceramic.f0
    parts: list[Part] = [_paste(flaws.electrodes[0])] if flaws.electrodes[0] else []
    parts += _ceramic(f, specimen, flaws, step, moment, factors.get("disk", 1.0))
    parts += [_paste(flaws.electrodes[1])] if flaws.electrodes[1] else []
    parts += [_layer(x, layer, flaws, factors.get(layer.name, 1.0)) for layer in layers]
    back: complex | Complexes = specimen.back
    if flaws.backing is not None:
        waves, q, power = flaws.backing
        length = waves * _BACKING_SPEED / specimen.ceramic.f0
        stiff = lossy(x, specimen.back * _BACKING_SPEED * (1 + 1j / q), power, causal=True)
        parts.insert(0, Slice(length, specimen.back / _BACKING_SPEED, stiff))
        back = AIR
    front: complex | Complexes = specimen.front
    if flaws.face is not None:
        side, kind, size, shape = flaws.face
        on = _resting(x, kind, size, shape)
        back, front = (back + on, front) if side == "back" else (back, front + on)
    return LayerColumn(tuple(parts), back, front)


def _resting(x: Reals, kind: str, size: float, shape: float) -> Complexes:
    """Return the impedance in Rayl of the pad or liquid on a face."""
    if kind == "pad":  # a lossy spring and a damper: rubber, a jig's tip
        return size * (1 + shape * (0.15 - 1j) / x)
    if kind == "fluid":  # slightly lossy, a little stiffer than its z implies
        return size * (1 + 0.01 * shape * (1j - 1) * x)
    return size * np.sqrt(1j * x / (1 + 1j * x * shape)) * np.sqrt(2)  # viscous, shear waves of a Maxwell fluid


def _paste(mass: float) -> Slice:
    density, speed, q = _SILVER
    return Slice(mass / density, density, density * speed**2 * (1 + 1j / q))


def _with_dot(column: LayerColumn, mass: float, side: Side) -> LayerColumn:
    """Load a face with solder of one height: half a millimetre of it would be a resonator, so it is a slice, too."""
    dot = Slice(mass / 8500.0, 8500.0, 3.5e10 * (1 + 1j / 20))
    return replace(column, parts=(dot, *column.parts) if side == "back" else (*column.parts, dot))


def _layer(x: Reals, layer: LabLayer, flaws: Flaws, factor: float | Reals) -> Slice:
    stiffness = lossy(x, layer.z * layer.c * (1 + 1j / layer.q), layer.loss_power, layer.causal)
    stiffness = _viscous(x, stiffness, flaws, layer.name)
    return Slice(layer.thickness * factor, layer.z / layer.c, stiffness)


def _viscous(x: Reals, stiffness: Complexes, flaws: Flaws, layer: str) -> Complexes:
    """Let a part of the loss follow another power of frequency; the loss at f0 stays the same."""
    if flaws.viscosity is None or flaws.viscosity[0] != layer:
        return stiffness
    _, part, power = flaws.viscosity
    return stiffness.real + 1j * stiffness.imag * np.maximum(1 + part * (x**power - 1), 0.02)


def _ceramic(
    f: Reals, specimen: LabDevice, flaws: Flaws, step: str, moment: Instant, factor: float | Reals
) -> list[Part]:
    ceramic = specimen.ceramic
    x = f / ceramic.f0
    aged = flaws.ageing if flaws.ageing is not None and step != specimen.steps[0] else (0.0, 0.0, 0.0)
    c = _viscous(x, lossy(x, ceramic.c33D, ceramic.loss_power, ceramic.causal), flaws, "disk")
    c = c * moment.stiffness * (1 + aged[0])
    for at, q, strength, how in flaws.modes:
        if how == "within":
            c = c * (1 - strength / (1 - (f / at) ** 2 + 1j / q))
    if flaws.anelastic is not None:
        size, at = flaws.anelastic
        c = c * _relaxed(x, (-size, at, 1.0, 1.0))
    eps = ceramic.eps33S * x**-ceramic.slope * _relaxed(x, flaws.relaxation) * moment.permittivity * (1 + aged[2])
    h = ceramic.h33 * _relaxed(x, flaws.piezo) * (1 + aged[1])
    whole = ceramic.thickness * factor
    if flaws.surface is None:
        return [Slice(whole, ceramic.density, c, h, eps)]
    depth, side, stiff, less = flaws.surface
    # no coupling over the first half of the depth, then a linear rise
    z = (np.arange(_GRADES) + 0.5) / _GRADES
    poled = np.clip(2 * z - 1, 0.0, 1.0)
    layer: list[Part] = [
        Slice(
            1.5 * depth / _GRADES,
            ceramic.density,
            c * (stiff + (1 - stiff) * p),
            h * p,
            eps * (less + (1 - less) * p),
        )
        for p in poled
    ]
    rest = Slice(whole - 1.5 * depth, ceramic.density, c, h, eps)
    return [*layer, rest] if side == "back" else [rest, *reversed(layer)]


def _relaxed(x: Reals, relaxation: tuple[float, float, float, float] | None) -> float | Complexes:
    """Return a relaxation of Havriliak and Negami, 1 at f0."""
    if relaxation is None:
        return 1.0
    strength, at, alpha, beta = relaxation

    def of(y: Any) -> Any:
        return strength / (1 + (1j * y / at) ** alpha) ** beta

    return np.asarray(1 + of(x) - of(np.float64(1.0)), np.complex128)


def _fed(Y: Complexes, ohm: float, radius: float) -> Complexes:
    """Return the admittance of a disk contacted at a dot of its electrode, which has a resistance per square.

    The voltage under the electrode obeys V'' + V'/r = ohm y V with y = Y/(pi a^2), no current leaves at the rim, and
    the dot is at one voltage; radii are relative to a.
    """
    y = Y / np.pi
    k = np.sqrt(ohm * y)
    inner, outer = k * radius, k
    down = iv(1, outer) / kv(1, outer)
    slope = k * (iv(1, inner) - down * kv(1, inner)) / (iv(0, inner) + down * kv(0, inner))
    return np.asarray(-2 * np.pi * radius / ohm * slope + y * np.pi * radius**2, np.complex128)


def _finite(f: Reals, specimen: LabDevice, lateral: tuple[float, ...]) -> Complexes:
    """Return the admittance of the disk in both dimensions; its losses have constant Q."""
    ceramic: Ceramic = specimen.ceramic
    disk = DiskShape(ceramic.thickness, ceramic.c33D, ceramic.h33, ceramic.eps33S)
    return finite_disk_admittance(f, DeviceUnderTest(specimen.name, specimen.diameter, disk, lateral=lateral))
