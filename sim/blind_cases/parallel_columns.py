"""A device and its hidden effects as columns in parallel."""

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
class DriftFactors:
    """Factors of stiffness and permittivity while each point is measured; one number or shape (N,)."""

    stiffness: float | Complexes = 1.0
    permittivity: float | Complexes = 1.0


NO_DRIFT = DriftFactors()


def device_admittance(
    f: Reals, device: DeviceUnderTest, hidden: Hidden, step: str, drift: DriftFactors = NO_DRIFT
) -> Complexes:
    """Return the admittance of the device after a step, without the leads; S, shape (N,)."""
    if hidden.modes:
        return finite_disk_admittance(f, device)
    columns = _columns(f, device, hidden, step, drift)
    return admittance(2 * np.pi * f, [(part * device.area, column) for part, column in columns])


def mean_strain(f: Reals, device: DeviceUnderTest, hidden: Hidden, step: str, drift: DriftFactors) -> Complexes:
    """Return the disk's mean strain per ampere through the device; 1/A, shape (N,)."""
    omega = 2 * np.pi * f
    _, column = _columns(f, device, hidden, step, drift)[0]
    return respond(omega, column).strain / (1j * omega * device.area)


def _columns(
    f: Reals, device: DeviceUnderTest, hidden: Hidden, step: str, drift: DriftFactors
) -> list[tuple[float, LayerColumn]]:
    """Return all columns with their parts of the area, for a distribution of thickness, a void and a dot."""
    columns: list[tuple[float, LayerColumn]] = []
    for part, of_this_thickness in _thicknesses(device, hidden):
        columns += [(part * share, column) for share, column in _bonded(f, of_this_thickness, hidden, step, drift)]
    if hidden.dot is None:
        return columns
    share, mass, side = hidden.dot
    loaded = [(part * share, _with_sheet(column, mass, side)) for part, column in columns]
    return [(part * (1 - share), column) for part, column in columns] + loaded


def _thicknesses(device: DeviceUnderTest, hidden: Hidden) -> list[tuple[float, DeviceUnderTest]]:
    if hidden.taper is None:
        return [(1.0, device)]
    layer, half, shape = hidden.taper
    x = (np.arange(_THICKNESSES) + 0.5) / _THICKNESSES * 2 - 1
    weight = {
        "wedge": np.ones_like(x),
        "round wedge": np.sqrt(1 - x**2),
        "dome": np.ones_like(x),
        "rough": np.exp(-((2.5 * x) ** 2) / 2),
    }[shape]
    weight = weight / np.sum(weight)
    return [(float(w), _thicker(device, layer, 1 + half * float(k))) for w, k in zip(weight, x, strict=True)]


def _thicker(device: DeviceUnderTest, layer: str, factor: float) -> DeviceUnderTest:
    if layer == "disk":
        return replace(device, disk=replace(device.disk, thickness=device.disk.thickness * factor))
    layers = tuple(replace(c, thickness=c.thickness * factor) if c.name == layer else c for c in device.layers)
    return replace(device, layers=layers)


def _bonded(
    f: Reals, device: DeviceUnderTest, hidden: Hidden, step: str, drift: DriftFactors
) -> list[tuple[float, LayerColumn]]:
    layers = _true_layers(device, hidden, step)
    if hidden.void is None:
        return [(1.0, _column(f, device, layers, hidden, drift))]
    behind, share = hidden.void
    names = ["disk", *(layer.name for layer in layers)]
    bare = layers[: names.index(behind)] if behind in names else layers
    return [
        (1 - share, _column(f, device, layers, hidden, drift)),
        (share, _column(f, device, bare, hidden, drift)),
    ]


def _true_layers(device: DeviceUnderTest, hidden: Hidden, step: str) -> tuple[BondedLayer, ...]:
    layers = device.layers_of(step)
    if hidden.omitted is None:
        return layers
    name, thickness = hidden.omitted
    true_layers = (replace(layer, thickness=thickness) if layer.name == name else layer for layer in layers)
    return tuple(layer for layer in true_layers if layer.thickness > 0)


def _column(
    f: Reals, device: DeviceUnderTest, layers: Sequence[BondedLayer], hidden: Hidden, drift: DriftFactors
) -> LayerColumn:
    omega = 2 * np.pi * f
    parts: list[Part] = [InterfaceSheet(hidden.mass[0])] if hidden.mass[0] else []
    parts += _ceramic(f, device, hidden, drift)
    parts += [InterfaceSheet(hidden.mass[1])] if hidden.mass[1] else []
    parts += [_slice_of(f, device, layer, hidden) for layer in layers]
    back: complex | Complexes = device.back
    if hidden.backing is not None:
        parts.insert(0, _backing(device, hidden.backing))
        back = AIR
    front: complex | Complexes = device.front
    if hidden.face is not None:
        side, kind, size = hidden.face
        resting = size * (1 + 0.05j) / (1j * omega) if kind == "spring" else size
        back, front = (back + resting, front) if side == "back" else (back, front + resting)
    return LayerColumn(tuple(parts), back, front)


def _backing(device: DeviceUnderTest, size: tuple[float, float]) -> Slice:
    waves, q = size
    length = waves * _BACKING_SPEED / device.disk.f0
    stiffness = device.back * _BACKING_SPEED * (1 + 1j / q)
    return Slice(length, device.back / _BACKING_SPEED, stiffness)


def _ceramic(f: Reals, device: DeviceUnderTest, hidden: Hidden, drift: DriftFactors) -> list[Part]:
    disk = device.disk
    c = disk.c33D * drift.stiffness * _loss(f, device, hidden, "disk", disk.c33D.real / disk.c33D.imag)
    eps = disk.eps33S * drift.permittivity * _permittivity(f, device, hidden)
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


def _slice_of(f: Reals, device: DeviceUnderTest, layer: BondedLayer, hidden: Hidden) -> Slice:
    stiffness = layer.z * layer.c * (1 + 1j / layer.q) * _loss(f, device, hidden, layer.name, layer.q)
    return Slice(layer.thickness, layer.z / layer.c, stiffness)


def _loss(f: Reals, device: DeviceUnderTest, hidden: Hidden, layer: str, q: float) -> complex | Complexes:
    """Return the factor that makes a loss of constant Q one that follows a power of frequency, equal at f0."""
    if hidden.loss_power is None or hidden.loss_power[0] != layer:
        return 1.0
    _, power, causal = hidden.loss_power
    grown = (f / device.disk.f0) ** power
    real = (grown - 1) / np.tan(power * np.pi / 2) if causal else 0.0
    return (1 + (1j * grown + real) / q) / (1 + 1j / q)


def _permittivity(f: Reals, device: DeviceUnderTest, hidden: Hidden) -> float | Complexes:
    if hidden.dielectric is None:
        return 1.0
    kind, size = hidden.dielectric
    x = f / device.disk.f0
    if kind == "power":
        return np.asarray(x**-size, np.complex128)
    return 1 + size * (1 / (1 + 1j * x / 0.3) - 1 / (1 + 1j / 0.3))


def _with_sheet(column: LayerColumn, mass: float, side: str) -> LayerColumn:
    sheet = InterfaceSheet(mass)
    return replace(column, parts=(sheet, *column.parts) if side == "back" else (*column.parts, sheet))
