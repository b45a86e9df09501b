"""Pairs as recorded in another laboratory: devices of many modes, cables, coils, wires, levels, formats and grids.

Devices are solved by nodal analysis of R, L, C branches. Strongly driven devices are solved by harmonic balance:
iterated currents, with a stiffness that falls and a loss that grows in proportion to the charge.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from compare_world import MadePair, coax, inductance, seen_through, series, shunt

from pzctl.models.sweep import Sweep

Mode = tuple[float, float, float]
"""Hz, Q, capacitance over the static one."""


def device(rng: np.random.Generator, middle: float, clamped: float) -> list[Mode]:
    """Draw a device: a strong mode with overtones or neighbours, and weak ones in between."""
    strong = middle * (1 + 0.03 * rng.normal())
    modes = [(strong, 10 ** rng.uniform(1.3, 2.2), rng.uniform(0.05, 0.25))]
    modes += [
        (middle * rng.uniform(0.6, 1.5), 10 ** rng.uniform(1.3, 2.2), 10 ** rng.uniform(-3.5, -1.5))
        for _ in range(int(rng.integers(2, 9)))
    ]
    return modes


def admittance(
    f: np.ndarray, modes: list[Mode], clamped: float, volt: float = 0.0, soft: float = 0.0, lossy: float = 0.0
) -> np.ndarray:
    """Return Y of a lossy clamped capacitance parallel to branches; `soft`, `lossy`: per volt over each capacitance."""
    branches = [1 / branch(f, mode, clamped, (volt, soft, lossy))[0] for mode in modes]
    return sum(branches, 2j * np.pi * f * clamped * (1 - 0.008j))


def branch(
    f: np.ndarray, mode: Mode, clamped: float, drive: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the impedance of a branch and the voltage over its capacitance at this level, softening and loss."""
    w, (f0, q, part), (volt, soft, lossy) = 2 * np.pi * f, mode, drive
    C = part * clamped
    L = 1 / ((2 * np.pi * f0) ** 2 * C)
    R = 2 * np.pi * f0 * L / q
    over = current = np.zeros(f.size)
    for _ in range(400):
        over = current / (w * C)
        z = R * (1 + lossy * over) + 1j * w * L + (1 - soft * over) / (1j * w * C)
        current = 0.7 * current + 0.3 * volt / np.abs(z)
    return z, over


def as_written(f: np.ndarray, Z: np.ndarray, rng: np.random.Generator, volt: float | None = None) -> Sweep:
    """Return a bench's recording: gain, phase, fixture, coloured noise, and rounded |Z| and degrees or R and X."""
    u = np.log(f / f[0]) / np.log(f[-1] / f[0])
    w = 2 * np.pi * f
    residue = 1j * w * 1e-9 * rng.normal() + 0.01 * rng.normal()
    Z = 1 / (1 / (Z + residue) + 1j * w * 2e-14 * rng.normal())
    gain = 1e-3 * (rng.normal() + 0.3 * rng.normal() * u) + 0.3e-3j * (rng.normal() + rng.normal() * u)
    noise = np.empty(f.size, complex)
    last, colour = 0j, rng.uniform(0, 0.5)
    for k in range(f.size):
        last = colour * last + np.sqrt(1 - colour**2) * complex(rng.normal(), rng.normal())
        noise[k] = last
    Z = Z * np.exp(gain + 10 ** rng.uniform(-4.3, -3.3) * noise)
    digits = int(rng.integers(5, 8))
    if rng.uniform() < 0.5:
        size, degrees = np.array([float(f"{v:.{digits}g}") for v in np.abs(Z)]), np.round(np.degrees(np.angle(Z)), 3)
        Z = size * np.exp(1j * np.radians(degrees))
    else:
        Z = np.array([complex(float(f"{v.real:.{digits}g}"), float(f"{v.imag:.{digits}g}")) for v in Z])
    return Sweep(f, Z, settings={} if volt is None else {"oscillator_V": volt})


def drifted(rng: np.random.Generator, modes: list[Mode]) -> list[Mode]:
    together = 1e-4 * rng.normal()
    return [(f0 * (1 + together + 5e-5 * rng.normal()), q * (1 + 3e-3 * rng.normal()), c) for f0, q, c in modes]


def _grids(rng: np.random.Generator, middle: float, q: float) -> tuple[np.ndarray, np.ndarray]:
    """Return two grids: mostly equal, otherwise with another number of points, spacing and range."""
    points = int(rng.choice([101, 201, 401, 801]))
    low, high = 0.65 * middle, 1.45 * middle
    first = np.linspace(low, high, points)
    if rng.uniform() < 0.6:
        return first, first
    more = int(rng.choice([201, 401, 801]))
    return first, np.geomspace(low * rng.uniform(0.85, 1.1), high * rng.uniform(0.9, 1.15), more)


def from_others(seed: int, rounds: int = 4) -> Iterator[MadePair]:
    """Yield pairs, `rounds` times all kinds."""
    rng = np.random.default_rng(seed)
    for k in range(rounds):
        for kind in (
            "cable",
            "cable",
            "coil",
            "coil",
            "capacitor",
            "across",
            "stack",
            "wire",
            "wire",
            "still",
            "still",
        ):
            yield _pair(rng, kind, k)
        for kind in ("levels", "levels", "same kind", "others"):
            yield _pair(rng, kind, k)


def _pair(rng: np.random.Generator, kind: str, k: int) -> MadePair:
    middle = 10 ** rng.uniform(5.6, 6.8)
    clamped = 10 ** rng.uniform(-10, -9)
    modes = device(rng, middle, clamped)
    f, g = _grids(rng, middle, modes[0][1])
    Y, now = admittance(f, modes, clamped), admittance(g, drifted(rng, modes), clamped)
    w, wg = 2 * np.pi * middle, 2 * np.pi * g
    zm = 1 / (w * clamped)
    name = f"{kind} {k}"
    made = MadePair(name, as_written(f, 1 / Y, rng), as_written(g, 1 / now, rng), "")
    elements: list[np.ndarray] = []
    if kind == "cable":
        meters = 10 ** rng.uniform(-0.2, 0.4)
        elements, sizes = coax(rng, g, meters, 50.0, 2e8)
        made = replace(made, effect="cable", also=("stray-capacitance", "lead-inductance"), sizes=sizes)
    elif kind == "coil":
        L = zm * 10 ** rng.uniform(-0.7, 0.1) / w
        z = 1j * wg * L + w * L / 40 * np.sqrt(1j * g / middle)
        elements = [series(z / (1 + 1j * wg * 4e-12 * z))]
        sizes = (("inductance", inductance(g, z)),)
        made = replace(made, effect="series-coil", also=("lead-inductance",), sizes=sizes)
    elif kind == "across":
        L = zm * 10 ** rng.uniform(-0.1, 0.5) / w
        z = 1j * wg * L + w * L / 40 * np.sqrt(1j * g / middle)
        elements = [shunt(1 / z + 1j * wg * 4e-12)]
        made = replace(made, effect="shunt-inductance", sizes=(("inductance", inductance(g, z)),))
    elif kind == "capacitor":
        C = clamped * 10 ** rng.uniform(-1, 0.3)
        elements = [shunt(1j * wg * C * (1 - 2e-3j))]
        made = replace(made, effect="stray-capacitance", also=("cable",), sizes=(("capacitance", C),))
    elif kind == "wire":
        L = zm * 6e-4 / (w * 1.45)  # about a centimetre: the usual difference between two set-ups
        elements = [series(1j * wg * L)]
    elif kind == "stack":
        other = admittance(g, device(rng, middle * rng.uniform(0.8, 1.2), clamped), clamped * rng.uniform(0.5, 2))
        elements = [series(1 / other)]
        made = replace(made, effect="something else", also=("series-capacitance",))
    elif kind == "levels":
        low, high = 0.1, 1.0
        # All modes have the material's losses. One with several times the strong mode's Q would be bistable, and its
        # recording would depend on the direction of the sweep.
        modes = [(f0, min(q, modes[0][1]), part) for f0, q, part in modes]
        # At the strong mode's peak the stiffness falls by 0.25 to 1.6 linewidths.
        at_peak = high * modes[0][1]
        soft = 10 ** rng.uniform(-0.6, 0.2) / modes[0][1] / at_peak
        lossy = rng.uniform(0.05, 0.4) / at_peak
        first = 1 / admittance(f, modes, clamped, low, soft, lossy)
        second = 1 / admittance(g, drifted(rng, modes), clamped, high, soft, lossy)
        before, after = as_written(f, first, rng, low), as_written(g, second, rng, high)
        largest = float(np.max(branch(g, modes[0], clamped, (high, soft, lossy))[1]))
        sizes = (("softening", soft * largest / 2),)
        return replace(made, before=before, after=after, effect="drive-nonlinearity", sizes=sizes)
    elif kind == "same kind":
        unlike = [
            (f0 * (1 + 8e-3 * rng.normal()), q * np.exp(0.2 * rng.normal()), c * np.exp(0.1 * rng.normal()))
            for f0, q, c in modes
        ]
        second = 1 / admittance(g, unlike, clamped * (1 + 0.03 * rng.normal()))
        return replace(made, after=as_written(g, second, rng), effect="something else")
    elif kind == "others":
        size = clamped * 10 ** rng.uniform(-0.4, 0.4)
        second = 1 / admittance(g, device(rng, middle * rng.uniform(0.8, 1.2), size), size)
        return replace(made, after=as_written(g, second, rng), effect="something else")
    return replace(made, after=as_written(g, seen_through(g, 1 / now, elements), rng))
