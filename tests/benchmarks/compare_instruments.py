"""Pairs as simple instruments write them: hand-held network analyzers, LCR meters with few points, rounded columns.

Devices and elements are those of `compare_stand_ins`; what differs is the recording.
"""

from collections.abc import Callable, Iterator

import numpy as np
from compare_components import coax, coil, resonator, wire
from compare_stand_ins import element
from compare_world import MadePair, seen_through, series, shunt

from pzctl.models.sweep import Sweep

Record = Callable[[np.ndarray, np.ndarray], Sweep]


def hand_held(rng: np.random.Generator) -> Record:
    """Return a network analyzer whose calibration left -57 to -46 dB, a tenth of it different in each recording."""
    left = 10 ** rng.uniform(-2.8, -2.3) * (rng.normal(size=6) + 1j * rng.normal(size=6))
    noise = 10 ** rng.uniform(-3.8, -3.2)

    def record(f: np.ndarray, Z: np.ndarray) -> Sweep:
        own, u = left * (1 + 0.1 * rng.normal(size=6)), np.log(f / f[0]) / np.log(f[-1] / f[0])
        S = (Z - 50) / (Z + 50)
        S = own[0] + own[1] * u + S * (1 + own[2] + own[3] * u) / (1 - S * (own[4] + own[5] * u))
        S = S + noise * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        return Sweep(f, 50 * (1 + S) / (1 - S))

    return record


def _noisy(rng: np.random.Generator, Z: np.ndarray, gain: float, noise: float) -> np.ndarray:
    return Z * np.exp(gain * rng.normal() + noise * (rng.normal(size=Z.size) + 1j * rng.normal(size=Z.size)))


def meter(rng: np.random.Generator) -> Record:
    """Return an LCR meter: 0.2 %, four digits of |Z|, hundredths of a degree."""

    def record(f: np.ndarray, Z: np.ndarray) -> Sweep:
        Z = _noisy(rng, Z, 2e-3, 3e-4)
        size = np.array([float(f"{abs(z):.4g}") for z in Z])
        return Sweep(f, size * np.exp(1j * np.radians(np.round(np.degrees(np.angle(Z)), 2))))

    return record


def three_digits(rng: np.random.Generator) -> Record:
    """Return a table of R and X with three digits."""

    def record(f: np.ndarray, Z: np.ndarray) -> Sweep:
        Z = _noisy(rng, Z, 1e-3, 2e-4)
        return Sweep(f, np.array([complex(float(f"{z.real:.3g}"), float(f"{z.imag:.3g}")) for z in Z]))

    return record


def decibels(rng: np.random.Generator) -> Record:
    """Return a table of |Z| in tenths of a decibel and whole degrees."""

    def record(f: np.ndarray, Z: np.ndarray) -> Sweep:
        Z = _noisy(rng, Z, 1e-3, 2e-4)
        size = 10 ** (np.round(20 * np.log10(np.abs(Z)), 1) / 20)
        return Sweep(f, size * np.exp(1j * np.radians(np.round(np.degrees(np.angle(Z))))))

    return record


def instruments(seed: int) -> Iterator[MadePair]:
    """Yield every change with every instrument."""
    rng = np.random.default_rng((seed, 23))
    for name, make, points in (
        ("hand-held", hand_held, 101),
        ("meter, 31 points", meter, 31),
        ("meter, 24 points", meter, 24),
        ("three digits", three_digits, 201),
        ("decibels", decibels, 201),
    ):
        for change in ("cable", "coil", "capacitor", "coil across", "again", "wire"):
            yield _pair(rng, f"{name}: {change}", change, make(rng), points)


def _pair(rng: np.random.Generator, name: str, change: str, record: Record, points: int) -> MadePair:
    middle, clamped = 10 ** rng.uniform(5.3, 6.5), 10 ** rng.uniform(-9.7, -9)
    f, w = np.linspace(0.5 * middle, 1.6 * middle, points), 2 * np.pi * middle
    plate = rng.uniform() < 0.6 or points < 50
    device = element(rng, middle, clamped) if plate else resonator(rng, middle, clamped, 2.3)
    elements, truth = _change(rng, change, f, 1 / w**2 / clamped)
    after = seen_through(f, 1 / device(f, True), elements)
    return MadePair(name, record(f, 1 / device(f, False)), record(f, after), **truth)


def _change(rng: np.random.Generator, change: str, f: np.ndarray, resonant: float) -> tuple[list[np.ndarray], dict]:
    """Return the elements of a change, and its truth; `resonant`: the inductance in resonance with the device, H."""
    middle = float(np.sqrt(f[0] * f[-1]))
    if change == "cable":
        elements, sizes = coax(rng, f, 1.5, 50, 2e8)
        return elements, {"effect": "cable", "sizes": sizes}
    if change in ("coil", "coil across"):
        z, henry = coil(rng, f, resonant * (0.5 if change == "coil" else 1.2), middle)
        effect, place = ("series-coil", [series(z)]) if change == "coil" else ("shunt-inductance", [shunt(1 / z)])
        return place, {"effect": effect, "sizes": (("inductance", henry),)}
    if change == "capacitor":
        C = 0.5 / (2 * np.pi * middle) ** 2 / resonant
        return [shunt(2j * np.pi * f * C)], {"effect": "stray-capacitance", "sizes": (("capacitance", C),)}
    if change == "wire":
        z = wire(rng, f, 1e-7)
        names = ("lead-inductance", "series-coil")
        return [series(z)], {"effect": "perhaps", "also": names, "sizes": (("inductance", 1e-7),)}
    return [], {"effect": ""}
