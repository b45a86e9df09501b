"""Recordings of a glued piezoelectric plate with changes inside, which share no formula with the models.

They come from the textbook formula of a plate between two acoustic loads (Kino, Acoustic Waves, 1987, section 1.4), and
have a lead and a spurious mode that no build of it knows of.
"""

from dataclasses import dataclass

import numpy as np

from pzctl.models.sweep import Sweep

F = np.linspace(2e6, 6e6, 121)
JW = 2j * np.pi * F
AREA = np.pi * 8e-3**2


@dataclass(frozen=True)
class Disk:
    """A disk with glue and matching layer, SI units."""

    e33: float = 16.0
    c33E: complex = 1.13e11 * (1 + 0.012j)
    eps: complex = 8.1e-9 * (1 - 0.015j)
    glue: float = 12e-6
    matched: bool = True
    loose: float = 0.0
    """Part of the area without glue."""
    load: float = 413.0
    """Rayl, in front."""
    dead: float = 0.0
    """Depth in m under the back."""


def layer(behind: np.ndarray, z: complex, c: complex, thickness: float) -> np.ndarray:
    """Return the acoustic impedance in front of a layer."""
    tan = np.tan(2 * np.pi * F * thickness / c)
    return z * (behind + 1j * z * tan) / (z + 1j * behind * tan)


def plate(one: Disk, z_back: np.ndarray, z_front: np.ndarray) -> np.ndarray:
    """Return the impedance of the piezoelectric plate in ohm."""
    h, thickness = one.e33 / one.eps, 0.512e-3 - one.dead
    stiff = one.c33E + one.e33**2 / one.eps
    z0, phase = np.sqrt(7700 * stiff), 2 * np.pi * F * thickness / np.sqrt(stiff / 7700)
    a, b = z_back / z0, z_front / z0
    sin, cos = np.sin(phase), np.cos(phase)
    inner = 1j * (1j * (a + b) * sin - 2 * (1 - cos)) / ((a + b) * cos + 1j * (1 + a * b) * sin)
    live = (1 + h**2 * one.eps / stiff / phase * inner) * thickness
    return (live + one.dead) / (JW * one.eps * AREA)


def impedance(one: Disk) -> np.ndarray:
    """Return the impedance of the device, seen through the lead, with its spurious mode."""
    air = np.full(F.size, 413.0)
    back = layer(air, np.sqrt(7700 * one.c33E), np.sqrt(one.c33E / 7700), one.dead) if one.dead else air
    front = np.full(F.size, one.load)
    bare = plate(one, back, front)
    if one.matched:
        front = layer(front, 10.3e6 * (1 + 0.008j), 2455 * (1 + 0.008j), 0.139e-3)
        front = layer(front, 2.8e6 * (1 + 0.04j), 2450 * (1 + 0.04j), one.glue)
    glued = plate(one, back, front)
    Y = (1 - one.loose) / glued + one.loose / bare + JW * 4e-13 / (1 - (F / 3.1e6) ** 2 + 1j * F / 3.1e6 / 40)
    return 1 / Y + JW * 1e-8 + 0.02


def recorded(one: Disk, seed: int) -> Sweep:
    rng = np.random.default_rng(seed)
    noise = 1e-4 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
    return Sweep(F, impedance(one) * np.exp(noise + 1e-3 * rng.normal()))
