"""A specimen: one transducer as it truly is, and as its build file says it is."""

from dataclasses import dataclass, field

import numpy as np

AIR = 413.0
"""Rayl."""
DENSITY = 7700.0
"""kg/m3, of the ceramic."""
_C33D, _H33, _EPS33S = 144.4e9, 1.98367e9, 913.73 * 8.8541878128e-12
"""Pz27: around these specimens scatter."""


@dataclass(frozen=True)
class DiskShape:
    """The ceramic: m, Pa, V/m, F/m; exp(+jwt)."""

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
    """A glued layer, or the glue: m, Rayl, m/s; its stiffness is z c (1 + j/q)."""

    name: str
    thickness: float
    z: float
    c: float
    q: float
    glue: bool
    told_z: float
    told_c: float
    told_q: float
    """What the build file says; the true values lie within its uncertainty."""


@dataclass(frozen=True)
class DeviceUnderTest:
    """One transducer; its steps are `disk`, `ml1`, `ml2`, as many as there are."""

    name: str
    diameter: float
    disk: DiskShape
    coats: tuple[BondedLayer, ...] = ()
    back: float = AIR
    front: float = AIR
    """Rayl, what the last layer works into."""
    steps: tuple[str, ...] = ("disk",)
    told_thickness: float = field(default=0.0)
    """m, of the disk; the build file's."""
    sideways: tuple[float, ...] = (147e9, 105e9, 93.7e9, 23.0e9, -3.09, 11.64, 1130.0)
    """What plane waves do not see of the ceramic: c11E c12E c13E c44E (Pa), e31 e15 (C/m2), eps11S/eps0."""

    @property
    def area(self) -> float:
        """m2."""
        return float(np.pi) * self.diameter**2 / 4

    def coats_of(self, step: str) -> tuple[BondedLayer, ...]:
        """Return what is glued on in a step, back to front."""
        return self.coats[: 2 * self.steps.index(step)]


def random_disk(rng: np.random.Generator, thickness: float) -> DiskShape:
    """Return a disk of the family of Pz27, within some per cent of the data sheet."""
    c, h, eps = _C33D * rng.uniform(0.97, 1.07), _H33 * rng.uniform(0.96, 1.03), _EPS33S * rng.uniform(0.94, 1.08)
    return DiskShape(
        thickness,
        c * (1 + 1j / rng.uniform(60, 130)),
        h * (1 - 1j * rng.uniform(0.0003, 0.0045)),
        eps * (1 - 1j * rng.uniform(0.012, 0.02)),
    )


def random_specimen(rng: np.random.Generator, name: str, steps: int, backed: bool) -> DeviceUnderTest:
    """Return a specimen with `steps` gluing steps, with or without a backing behind the disk."""
    thickness = round(float(rng.uniform(0.4, 1.1)), 6) * 1e-3
    diameter = round(float(rng.uniform(10, 20)), 6) * 1e-3
    disk = random_disk(rng, thickness)
    coats: list[BondedLayer] = []
    for k in range(1, steps):
        told = (10.3e6, 2455.0, 40.0) if k == 1 else (3.3e6, 2400.0, 35.0)
        coats.append(
            BondedLayer(f"glue{k}", float(rng.uniform(4, 15)) * 1e-6, 2.9e6, 2550.0, 30.0, True, 2.9e6, 2550.0, 30.0)
        )
        # quarter-wave or thinner at the disk's resonance
        t = round(float(rng.uniform(0.6, 1.1)) * told[1] / (4 * disk.f0) * 1e3, 6) * 1e-3
        true = (told[0] * rng.normal(1, 0.04), told[1] * rng.normal(1, 0.03), float(rng.uniform(20, 60)))
        coats.append(BondedLayer(f"ml{k}", t, float(true[0]), float(true[1]), true[2], False, *told))
    back = float(rng.uniform(3e6, 7e6)) if backed else AIR
    names = ("disk", "ml1", "ml2")[:steps]
    return DeviceUnderTest(name, diameter, disk, tuple(coats), back, steps=names, told_thickness=thickness)
