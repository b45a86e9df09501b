"""The thesis's tables recomputed: from its own printed numbers, by its own formulas and by the correct ones."""

import cmath
import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Reals
from ..constants.piezo_constants import Radial, Thickness
from ..constants.sherrit import antiresonance_frequencies, radial_constants, resonance_frequencies, thickness_constants
from ..disk.round_disk import RadialDisk
from ..materials import SHERRIT_RADIAL
from ..stack import VACUUM, Piezo, Stack
from .printed import TABLE_4_8, RadialSample

RADIAL_NAMES = ("s11E", "s12E", "d31", "eps33T", "c11p", "sigma_p", "kp_IEEE", "eps33p")
_RADIUS, _THICKNESS, _DENSITY = 5e-3, 0.5e-3, 7800.0
# A disk for the proofs; the constants that come back do not depend on its size.


def thesis_formulas(sample: RadialSample) -> dict[str, complex]:
    """Return s11E, s12E and d31 as the thesis computes them: with 1/c11p taken for s11E.

    From the printed c11p, sigma_p, k^p and eps33T; SI units.
    """
    s11E = 1 / sample.c11p
    s12E = -sample.sigma_p / sample.c11p
    eps33p = sample.eps33T / (1 + 2 * sample.kp_IEEE**2 / (1 + sample.sigma_p))
    d31 = -cmath.sqrt(sample.kp_IEEE**2 * eps33p * (s11E + s12E) / (1 + sample.sigma_p))
    return {"s11E": s11E, "s12E": s12E, "d31": d31}


def corrected(sample: RadialSample) -> Radial:
    """Return the radial-mode constants that follow from the printed c11p, sigma_p, k^p and eps33T."""
    eps33p = sample.eps33T / (1 + 2 * sample.kp_IEEE**2 / (1 + sample.sigma_p))
    return Radial.from_sherrit(sample.c11p, sample.sigma_p, sample.kp_IEEE, eps33p)


def implied_coupling(sample: RadialSample) -> complex:
    """Return the k^p that the printed eps33T and eps33p imply."""
    return cmath.sqrt((sample.eps33T / sample.eps33p - 1) * (1 + sample.sigma_p) / 2)


def mean_and_deviation(values: list[complex]) -> tuple[complex, complex]:
    """Return mean and sample standard deviation, each of real and imaginary part."""
    both: Reals = np.array([[value.real, value.imag] for value in values])
    mean, deviation = both.mean(axis=0), both.std(axis=0, ddof=1)
    return complex(*mean), complex(*deviation)


def table_4_9(*, right: bool) -> dict[str, tuple[complex, complex]]:
    """Return mean and deviation over the three samples of table 4.8: as printed, or by the right formulas."""
    samples = [corrected(sample) for sample in TABLE_4_8] if right else list(TABLE_4_8)
    return {name: mean_and_deviation([getattr(sample, name) for sample in samples]) for name in RADIAL_NAMES}


@dataclass(frozen=True)
class Recovery:
    """One constant that was turned into a spectrum and recovered from it."""

    name: str
    truth: complex
    found: complex


def recovered_radial() -> list[Recovery]:
    """Return Sherrit's radial constants, and those recovered from their noise-free spectrum."""
    area = math.pi * _RADIUS**2
    disk = RadialDisk.of("disk", SHERRIT_RADIAL, area, _THICKNESS, _DENSITY)
    first, second, low = np.arange(130e3, 300e3, 2.0), np.arange(430e3, 580e3, 2.0), np.array([1e3])
    Z = disk.impedance(first)
    eps33T = complex((_THICKNESS / (2j * np.pi * low * area * disk.impedance(low)))[0])
    found = radial_constants(
        resonance_frequencies(first, Z).complex,
        resonance_frequencies(second, disk.impedance(second)).complex,
        antiresonance_frequencies(first, Z).complex,
        eps33T,
        _RADIUS,
        _DENSITY,
    )
    return [Recovery(name, getattr(SHERRIT_RADIAL, name), getattr(found, name)) for name in (*RADIAL_NAMES, "kp")]


def recovered_thickness(truth: Thickness) -> list[Recovery]:
    """Return thickness constants, and those recovered from their noise-free spectrum."""
    area = math.pi * _RADIUS**2
    layer = Piezo("disk", _THICKNESS, _DENSITY, truth.c33D, truth.h33, truth.eps33S)
    plate = Stack((layer,), VACUUM, VACUUM, area)
    fp = abs(truth.speed(_DENSITY)) / (2 * _THICKNESS)
    f, above = np.linspace(0.7 * fp, 1.2 * fp, 40001), np.array([2.7 * fp])
    Z = plate.impedance(f)
    point = float(above[0]), complex(plate.impedance(above)[0])
    critical = resonance_frequencies(f, Z).complex, antiresonance_frequencies(f, Z).complex
    found = thickness_constants(*critical, _THICKNESS, _DENSITY, point, area)
    return [Recovery(name, getattr(truth, name), getattr(found, name)) for name in ("c33D", "h33", "eps33S", "kt")]
