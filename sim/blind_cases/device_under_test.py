"""A device under test: one transducer as it is, and as its build file states it."""

from dataclasses import dataclass, field

import numpy as np

AIR = 413.0
"""Rayl."""
DENSITY = 7700.0
"""kg/m3, of the ceramic."""
_C33D, _H33, _EPS33S = 144.4e9, 1.98367e9, 913.73 * 8.8541878128e-12
"""Data sheet of Pz27; the devices scatter around these values."""


@dataclass(frozen=True)
class DiskShape:
    """The ceramic: thickness in m, stiffness in Pa, h33 in V/m, permittivity in F/m; time convention exp(+jwt)."""

    thickness: float
    c33D: complex
    h33: complex
    eps33S: complex

    @property
    def f0(self) -> float:
        """Antiresonance without load, Hz."""
        return float(np.sqrt(self.c33D.real / DENSITY)) / (2 * self.thickness)


@dataclass(frozen=True)
class BondedLayer:
    """A layer that is glued on, or the glue: m, Rayl, m/s; its stiffness is z c (1 + j/q)."""

    name: str
    thickness: float
    z: float
    c: float
    q: float
    glue: bool
    stated_z: float
    stated_c: float
    stated_q: float
    """The values that the build file states; the true values lie within their uncertainty."""


@dataclass(frozen=True)
class DeviceUnderTest:
    """One transducer; its steps are the first one, two or three of `disk`, `ml1`, `ml2`."""

    name: str
    diameter: float
    disk: DiskShape
    layers: tuple[BondedLayer, ...] = ()
    back: float = AIR
    front: float = AIR
    """Rayl, the load in front of the last layer."""
    steps: tuple[str, ...] = ("disk",)
    stated_thickness: float = field(default=0.0)
    """m, of the disk, as the build file states it."""
    lateral: tuple[float, ...] = (147e9, 105e9, 93.7e9, 23.0e9, -3.09, 11.64, 1130.0)
    """Constants that do not affect plane waves: c11E c12E c13E c44E (Pa), e31 e15 (C/m2), eps11S/eps0."""

    @property
    def area(self) -> float:
        """m2."""
        return float(np.pi) * self.diameter**2 / 4

    def layers_of(self, step: str) -> tuple[BondedLayer, ...]:
        """Return the layers that are glued on after a step, back to front."""
        return self.layers[: 2 * self.steps.index(step)]


def random_disk(rng: np.random.Generator, thickness: float) -> DiskShape:
    """Return a disk of Pz27 whose constants differ from the data sheet by some per cent."""
    c, h, eps = _C33D * rng.uniform(0.97, 1.07), _H33 * rng.uniform(0.96, 1.03), _EPS33S * rng.uniform(0.94, 1.08)
    return DiskShape(
        thickness,
        c * (1 + 1j / rng.uniform(60, 130)),
        h * (1 - 1j * rng.uniform(0.0003, 0.0045)),
        eps * (1 - 1j * rng.uniform(0.012, 0.02)),
    )


def random_device(rng: np.random.Generator, name: str, steps: int, backed: bool) -> DeviceUnderTest:
    """Return a device with `steps` gluing steps, with or without a backing behind the disk."""
    thickness = round(float(rng.uniform(0.4, 1.1)), 6) * 1e-3
    diameter = round(float(rng.uniform(10, 20)), 6) * 1e-3
    disk = random_disk(rng, thickness)
    layers: list[BondedLayer] = []
    for k in range(1, steps):
        stated = (10.3e6, 2455.0, 40.0) if k == 1 else (3.3e6, 2400.0, 35.0)
        layers.append(
            BondedLayer(f"glue{k}", float(rng.uniform(4, 15)) * 1e-6, 2.9e6, 2550.0, 30.0, True, 2.9e6, 2550.0, 30.0)
        )
        # quarter-wave or thinner at the disk's resonance
        t = round(float(rng.uniform(0.6, 1.1)) * stated[1] / (4 * disk.f0) * 1e3, 6) * 1e-3
        true = (stated[0] * rng.normal(1, 0.04), stated[1] * rng.normal(1, 0.03), float(rng.uniform(20, 60)))
        layers.append(BondedLayer(f"ml{k}", t, float(true[0]), float(true[1]), true[2], False, *stated))
    back = float(rng.uniform(3e6, 7e6)) if backed else AIR
    names = ("disk", "ml1", "ml2")[:steps]
    return DeviceUnderTest(name, diameter, disk, tuple(layers), back, steps=names, stated_thickness=thickness)
