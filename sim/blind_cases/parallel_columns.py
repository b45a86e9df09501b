"""A specimen with what is hidden in it, as columns side by side."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .device_under_test import AIR, DENSITY, BondedLayer, DeviceUnderTest
from .ritz import finite_disk_admittance
from .scenario import Hidden
from .waves import Complexes, InterfaceSheet, LayerColumn, Part, Reals, Slice, admittance, respond

_THICKNESSES = 41
_SLICES = 14
_BACKING_SPEED = 2500.0
"""m/s."""


@dataclass(frozen=True, eq=False)
class Moment:
    """By how much stiffness and permittivity differ while each point is taken; one factor or shape (N,)."""

    stiffness: float | Complexes = 1.0
    permittivity: float | Complexes = 1.0


STILL = Moment()


def device_admittance(
    f: Reals, specimen: DeviceUnderTest, hidden: Hidden, step: str, moment: Moment = STILL
) -> Complexes:
    """Return the admittance of a step's device without what leads to it; S, shape (N,)."""
    if hidden.modes:
        return finite_disk_admittance(f, specimen)
    columns = _columns(f, specimen, hidden, step, moment)
    return admittance(2 * np.pi * f, [(part * specimen.area, column) for part, column in columns])


def mean_strain(f: Reals, specimen: DeviceUnderTest, hidden: Hidden, step: str, moment: Moment) -> Complexes:
    """Return the disk's mean strain per ampere through the device; 1/A, shape (N,)."""
    omega = 2 * np.pi * f
    _, column = _columns(f, specimen, hidden, step, moment)[0]
    return respond(omega, column).strain / (1j * omega * specimen.area)


def _columns(
    f: Reals, specimen: DeviceUnderTest, hidden: Hidden, step: str, moment: Moment
) -> list[tuple[float, LayerColumn]]:
    """Return all columns with their parts of the area: a distribution of thickness, voids, a dot."""
    whole: list[tuple[float, LayerColumn]] = []
    for part, of_thickness in _thicknesses(specimen, hidden):
        whole += [(part * share, column) for share, column in _bonded(f, of_thickness, hidden, step, moment)]
    if hidden.dot is None:
        return whole
    share, mass, side = hidden.dot
    loaded = [(part * share, _with_sheet(column, mass, side)) for part, column in whole]
    return [(part * (1 - share), column) for part, column in whole] + loaded


def _thicknesses(specimen: DeviceUnderTest, hidden: Hidden) -> list[tuple[float, DeviceUnderTest]]:
    if hidden.taper is None:
        return [(1.0, specimen)]
    layer, half, shape = hidden.taper
    x = (np.arange(_THICKNESSES) + 0.5) / _THICKNESSES * 2 - 1
    weight = {
        "wedge": np.ones_like(x),
        "round wedge": np.sqrt(1 - x**2),
        "dome": np.ones_like(x),
        "rough": np.exp(-((2.5 * x) ** 2) / 2),
    }[shape]
    weight = weight / np.sum(weight)
    return [(float(w), _thicker(specimen, layer, 1 + half * float(k))) for w, k in zip(weight, x, strict=True)]


def _thicker(specimen: DeviceUnderTest, layer: str, factor: float) -> DeviceUnderTest:
    if layer == "disk":
        return replace(specimen, disk=replace(specimen.disk, thickness=specimen.disk.thickness * factor))
    coats = tuple(replace(c, thickness=c.thickness * factor) if c.name == layer else c for c in specimen.coats)
    return replace(specimen, coats=coats)


def _bonded(
    f: Reals, specimen: DeviceUnderTest, hidden: Hidden, step: str, moment: Moment
) -> list[tuple[float, LayerColumn]]:
    coats = _true_coats(specimen, hidden, step)
    if hidden.void is None:
        return [(1.0, _column(f, specimen, coats, hidden, moment))]
    behind, share = hidden.void
    names = ["disk", *(coat.name for coat in coats)]
    bare = coats[: names.index(behind)] if behind in names else coats
    return [
        (1 - share, _column(f, specimen, coats, hidden, moment)),
        (share, _column(f, specimen, bare, hidden, moment)),
    ]


def _true_coats(specimen: DeviceUnderTest, hidden: Hidden, step: str) -> tuple[BondedLayer, ...]:
    coats = specimen.coats_of(step)
    if hidden.untold is None:
        return coats
    name, thickness = hidden.untold
    there = (replace(coat, thickness=thickness) if coat.name == name else coat for coat in coats)
    return tuple(coat for coat in there if coat.thickness > 0)


def _column(
    f: Reals, specimen: DeviceUnderTest, coats: Sequence[BondedLayer], hidden: Hidden, moment: Moment
) -> LayerColumn:
    omega = 2 * np.pi * f
    parts: list[Part] = [InterfaceSheet(hidden.mass[0])] if hidden.mass[0] else []
    parts += _ceramic(f, specimen, hidden, moment)
    parts += [InterfaceSheet(hidden.mass[1])] if hidden.mass[1] else []
    parts += [_coat(f, specimen, coat, hidden) for coat in coats]
    back: complex | Complexes = specimen.back
    if hidden.backing is not None:
        parts.insert(0, _backing(specimen, hidden.backing))
        back = AIR
    front: complex | Complexes = specimen.front
    if hidden.face is not None:
        side, kind, size = hidden.face
        resting = size * (1 + 0.05j) / (1j * omega) if kind == "spring" else size
        back, front = (back + resting, front) if side == "back" else (back, front + resting)
    return LayerColumn(tuple(parts), back, front)


def _backing(specimen: DeviceUnderTest, size: tuple[float, float]) -> Slice:
    waves, q = size
    length = waves * _BACKING_SPEED / specimen.disk.f0
    stiffness = specimen.back * _BACKING_SPEED * (1 + 1j / q)
    return Slice(length, specimen.back / _BACKING_SPEED, stiffness)


def _ceramic(f: Reals, specimen: DeviceUnderTest, hidden: Hidden, moment: Moment) -> list[Part]:
    disk = specimen.disk
    c = disk.c33D * moment.stiffness * _loss(f, specimen, hidden, "disk", disk.c33D.real / disk.c33D.imag)
    eps = disk.eps33S * moment.permittivity * _permittivity(f, specimen, hidden)
    if hidden.surface is None:
        return [Slice(disk.thickness, DENSITY, c, disk.h33, eps)]
    depth, side, kind = hidden.surface
    if kind == "dead":
        thin = [Slice(depth, DENSITY, c, 0.0, eps)]
    else:  # the coupling rises towards its bulk value as 1 - exp(-z/depth)
        edges = depth * 5 * (np.arange(_SLICES + 1) / _SLICES)
        middle = (edges[1:] + edges[:-1]) / 2
        thin = [
            Slice(float(t), DENSITY, c, disk.h33 * (1 - float(np.exp(-z / depth))), eps)
            for t, z in zip(np.diff(edges), middle, strict=True)
        ]
    rest = Slice(disk.thickness - sum(part.thickness for part in thin), DENSITY, c, disk.h33, eps)
    return [*thin, rest] if side == "back" else [rest, *reversed(thin)]


def _coat(f: Reals, specimen: DeviceUnderTest, coat: BondedLayer, hidden: Hidden) -> Slice:
    stiffness = coat.z * coat.c * (1 + 1j / coat.q) * _loss(f, specimen, hidden, coat.name, coat.q)
    return Slice(coat.thickness, coat.z / coat.c, stiffness)


def _loss(f: Reals, specimen: DeviceUnderTest, hidden: Hidden, layer: str, q: float) -> complex | Complexes:
    """Return the factor that makes a loss of constant Q one that follows a power of frequency, equal at f0."""
    if hidden.loss_power is None or hidden.loss_power[0] != layer:
        return 1.0
    _, power, causal = hidden.loss_power
    grown = (f / specimen.disk.f0) ** power
    real = (grown - 1) / np.tan(power * np.pi / 2) if causal else 0.0
    return (1 + (1j * grown + real) / q) / (1 + 1j / q)


def _permittivity(f: Reals, specimen: DeviceUnderTest, hidden: Hidden) -> float | Complexes:
    if hidden.dielectric is None:
        return 1.0
    kind, size = hidden.dielectric
    x = f / specimen.disk.f0
    if kind == "power":
        return np.asarray(x**-size, np.complex128)
    return 1 + size * (1 / (1 + 1j * x / 0.3) - 1 / (1 + 1j / 0.3))


def _with_sheet(column: LayerColumn, mass: float, side: str) -> LayerColumn:
    sheet = InterfaceSheet(mass)
    return replace(column, parts=(sheet, *column.parts) if side == "back" else (*column.parts, sheet))
