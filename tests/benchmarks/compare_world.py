"""Pairs of recordings with known changes, simulated without any formula of `fitters/compare`.

Two-ports are numeric chain matrices; drift is an interpolation of the recording on a warped
frequency axis; devices that change inside are circuits of resonators.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.special import ive

from pzctl.drivers.recordings import RecordingError, read_recording
from pzctl.models.sweep import Sweep

RECORDINGS = Path(os.environ.get("PZCTL_RECORDINGS", Path(__file__).resolve().parents[3] / "shared" / "recordings"))
LEVEL, DRIFT, GAIN, NOISE = 0.02, 1e-4, 1e-3, 1e-4
"""Smallest change that must be named, root mean square of ln Z; and the other differences of real pairs."""


@dataclass(frozen=True)
class MadePair:
    """A pair and its change."""

    name: str
    before: Sweep
    after: Sweep
    effect: str
    """Empty where nothing was changed; `perhaps` where that may be said as well, `something else` where no name is
    right, and `beyond the law` where the right name or none is."""
    also: tuple[str, ...] = ()
    """Other names for the same thing at this size."""
    sizes: tuple[tuple[str, float], ...] = ()
    """Parameter names of the size in a finding, and the true size."""
    removed: bool = False


def recordings() -> list[tuple[str, Sweep]]:
    """Return every real recording that the project's reader reads."""
    found: list[tuple[str, Sweep]] = []
    for path in sorted(RECORDINGS.rglob("*")):
        if path.suffix not in (".csv", ".txt"):
            continue
        try:
            found.append((f"{path.parent.name}/{path.stem}", read_recording(path)))
        except RecordingError:
            continue  # notes of an equivalent circuit
    return found


def seen_through(f: np.ndarray, Z: np.ndarray, elements: list[np.ndarray]) -> np.ndarray:
    """Return Z behind elements, each a matrix (N, 2, 2), the first at the device."""
    state = np.stack([Z, np.ones_like(Z)], axis=-1)[..., None]
    for matrix in elements:
        state = matrix @ state
    return state[:, 0, 0] / state[:, 1, 0]


def series(z: np.ndarray) -> np.ndarray:
    M = np.tile(np.eye(2, dtype=complex), (z.size, 1, 1))
    M[:, 0, 1] = z
    return M


def shunt(y: np.ndarray) -> np.ndarray:
    M = np.tile(np.eye(2, dtype=complex), (y.size, 1, 1))
    M[:, 1, 0] = y
    return M


def round_wire(f: np.ndarray, meters: float, radius: float) -> np.ndarray:
    """Return the internal impedance of a round copper wire, ohm, by Bessel functions."""
    gamma = np.sqrt(2j * np.pi * f * 4e-7 * np.pi * 5.8e7)
    z = gamma * radius
    return gamma / (2 * np.pi * radius * 5.8e7) * ive(0, z) / ive(1, z) * meters


def coax(
    rng: np.random.Generator, f: np.ndarray, meters: float, ohm: float, speed: float
) -> tuple[list[np.ndarray], tuple[tuple[str, float], ...]]:
    """Return a coaxial cable: external inductance, wire, capacitance and loss of the dielectric; and its sizes."""
    w = 2 * np.pi * f
    inner = 10 ** rng.uniform(-3.8, -3.3)
    z = 1j * w * ohm / speed + round_wire(f, 1.0, inner) * (1 + 0.3)
    y = 1j * w / (ohm * speed) * (1 - 1j * 10 ** rng.uniform(-4, -3))
    root, Z0 = np.sqrt(z * y) * meters, np.sqrt(z / y)
    M = np.empty((f.size, 2, 2), complex)
    M[:, 0, 0] = M[:, 1, 1] = np.cosh(root)
    M[:, 0, 1], M[:, 1, 0] = Z0 * np.sinh(root), np.sinh(root) / Z0
    return [M], (("capacitance", meters / ohm / speed), ("inductance", meters * inductance(f, z)))


def inductance(f: np.ndarray, z: np.ndarray) -> float:
    """Return the inductance in the middle of the band."""
    return float(np.interp(np.sqrt(f[0] * f[-1]), f, z.imag / (2 * np.pi * f)))


Draw = Callable[[np.random.Generator, np.ndarray, float], tuple[list[np.ndarray], tuple]]


def _lead_or_coil(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    w, part = 2 * np.pi * f, 10 ** rng.uniform(-1.3, 0.2)
    L = part * zm / w[f.size // 2]
    if L < 2e-6:
        z = 1j * w * L + 0.1 * part * rng.uniform() + 1e-2 * np.sqrt(f / 1e6) * (1 + 1j) * rng.uniform()
        return [series(z)], ("lead-inductance", ("series-coil",), (("inductance", inductance(f, z)),))
    z = 1j * w * L + w[f.size // 2] * L / rng.uniform(20, 100)
    own = min(10e-12, 0.02 / (w[-1] ** 2 * L))
    return [series(z / (1 + 1j * w * own * z))], ("series-coil", ("lead-inductance",), (("inductance", L),))


def _shunt_coil(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    w, part = 2 * np.pi * f, 10 ** rng.uniform(-1.0, 0.3)
    L = zm / part / w[f.size // 2]
    z = 1j * w * L + w[f.size // 2] * L / rng.uniform(20, 100)
    own = min(10e-12, 0.02 / (w[-1] ** 2 * L))
    return [shunt(1 / z + 1j * w * own)], ("shunt-inductance", (), (("inductance", L),))


def _shunt_c(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    w, part = 2 * np.pi * f, 10 ** rng.uniform(-1.3, 0.2)
    C = part / zm / w[f.size // 2]
    return [shunt(1j * w * C * (1 - 1j * 10 ** rng.uniform(-4, -2)))], (
        "stray-capacitance",
        ("cable",),
        (("capacitance", C),),
    )


def _series_c(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    w, part = 2 * np.pi * f, 10 ** rng.uniform(-1.3, 0.2)
    C = 1 / (part * zm * w[f.size // 2])
    return [series((1 + 1j * 10 ** rng.uniform(-4, -2)) / (1j * w * C))], (
        "series-capacitance",
        (),
        (("capacitance", C),),
    )


def _series_r(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    R = zm * 10 ** rng.uniform(-1.3, 0.2)
    return [series(np.full(f.size, R, complex))], ("series-resistance", (), (("resistance", R),))


def _shunt_g(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    G = 10 ** rng.uniform(-1.3, 0.2) / zm
    return [shunt(np.full(f.size, G, complex))], ("leakage", (), (("conductance", G),))


def _cable(rng: np.random.Generator, f: np.ndarray, zm: float) -> tuple[list[np.ndarray], tuple]:
    meters, ohm = 10 ** rng.uniform(-0.5, 1.0), float(rng.choice([50.0, 75.0, 93.0]))
    also = ("stray-capacitance", "lead-inductance", "series-coil")
    elements, sizes = coax(rng, f, meters, ohm, 2e8)
    return elements, ("cable", also, sizes)


DRAWS: tuple[Draw, ...] = (_lead_or_coil, _shunt_coil, _shunt_c, _series_c, _series_r, _shunt_g, _cable)


def warped(f: np.ndarray, Z: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a recording with drifted resonances: a common part, and a part that varies over frequency."""
    u = (f - f[0]) / (f[-1] - f[0])
    shift = DRIFT * (rng.normal() + 0.5 * rng.normal() * np.cos(np.pi * u) + 0.5 * rng.normal() * np.cos(3 * np.pi * u))
    y = np.log(np.abs(Z)) + 1j * np.unwrap(np.angle(Z))
    made = np.empty_like(y)
    for k, place in enumerate(f * (1 - shift)):  # the polynomial through eight neighbours
        first = int(np.clip(np.searchsorted(f, place) - 4, 0, f.size - 8))
        own = slice(first, first + 8)
        made[k] = BarycentricInterpolator((f[own] - f[k]) / (f[1] - f[0]), y[own])((place - f[k]) / (f[1] - f[0]))
    return np.exp(made)


def as_measured(f: np.ndarray, Z: np.ndarray, rng: np.random.Generator) -> Sweep:
    """Return Z with a gain error, a phase error and noise."""
    u = np.linspace(-1, 1, f.size)
    gain = GAIN * (rng.normal() + 0.3 * rng.normal() * u) + 0.3j * GAIN * (rng.normal() + rng.normal() * u)
    noise = NOISE * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
    return Sweep(f, Z * np.exp(gain + noise))


def at_terminals(seed: int, per_recording: int = 4) -> Iterator[MadePair]:
    """Yield pairs: each real recording with elements between it and the analyzer, or none."""
    rng = np.random.default_rng(seed)
    for name, sweep in recordings():
        f, inverted = sweep.frequency, bool(np.mean(sweep.impedance.real < 0) > 0.5)
        Z = -sweep.impedance if inverted else sweep.impedance
        zm = float(np.median(np.abs(Z)))
        for _ in range(per_recording):
            drifted = warped(f, Z, rng)
            for _ in range(40):
                draw = DRAWS[int(rng.integers(len(DRAWS)))]
                elements, truth = draw(rng, f, zm)
                if np.sqrt(np.mean(np.abs(np.log(seen_through(f, Z, elements) / Z)) ** 2)) > LEVEL:
                    break
            sign = -1 if inverted else 1
            bare = Sweep(f, sign * Z)
            changed = as_measured(f, sign * seen_through(f, drifted, elements), rng)
            removed = bool(rng.uniform() < 0.3)
            yield MadePair(name, *((changed, bare) if removed else (bare, changed)), *truth, removed)
        still = as_measured(f, (-1 if inverted else 1) * warped(f, Z, rng), rng)
        yield MadePair(name, Sweep(f, sweep.impedance), still, "")


def _resonators(rng: np.random.Generator) -> list[list[float]]:
    count = int(rng.integers(2, 6))
    places = np.sort(rng.uniform(0.75, 1.25, count))
    return [[1e6 * p, 10 ** rng.uniform(1.5, 2.4), 10 ** rng.uniform(-2.3, -0.9)] for p in places]


def circuit(f: np.ndarray, resonators: list[list[float]]) -> np.ndarray:
    """Return 300 pF parallel to series branches of R, L and C, as impedances of their elements."""
    w = 2 * np.pi * f
    Y = 1j * w * 3e-10 * (1 - 5e-3j)
    for f0, q, part in resonators:
        C = part * 3e-10
        L = 1 / ((2 * np.pi * f0) ** 2 * C)
        Y = Y + 1 / (2 * np.pi * f0 * L / q + 1j * w * L + 1 / (1j * w * C))
    return 1 / Y


def in_device(seed: int, count: int) -> Iterator[MadePair]:
    """Yield pairs of resonator circuits with a change inside."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        f = np.linspace(0.65e6, 1.35e6, int(rng.choice([401, 801])))
        own = _resonators(rng)
        now = [list(one) for one in own]
        kind = ("frequency-shift", "damping-change", "coupling-change", "one-resonance", "new-resonance", "")[k % 6]
        size: tuple[tuple[str, float], ...] = ()
        if kind == "frequency-shift":
            shift = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-2.8, -1.7))
            now = [[f0 * (1 + shift), q, c] for f0, q, c in now]
            size = (("shift", np.log1p(shift)),)
        elif kind == "damping-change":
            factor = 10 ** (rng.uniform(0.05, 0.35) * float(rng.choice([-1, 1])))
            now = [[f0, q * factor, c] for f0, q, c in now]
            size = (("ln Q", float(np.log(factor))),)
        elif kind == "coupling-change":
            factor = float(rng.uniform(0.75, 0.95))
            now = [[f0, q, c * factor] for f0, q, c in now]
            size = (("ln strength", float(np.log(factor))),)
        elif kind == "one-resonance":
            one = int(np.argmax([c * q for _, q, c in now]))
            shift = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-2.5, -1.8))
            now[one] = [now[one][0] * (1 + shift), now[one][1] * rng.uniform(0.6, 1.0), now[one][2]]
            size = (("shift", float(np.log1p(shift))),)
        elif kind == "new-resonance":
            place, part = float(rng.uniform(0.8e6, 1.2e6)), 10 ** rng.uniform(-2.0, -1.2)
            now.append([place, 10 ** rng.uniform(1.5, 2.2), part])
        drift = 1 + DRIFT * rng.normal()
        now = [[f0 * drift * (1 + DRIFT * rng.normal() / 2), q, c] for f0, q, c in now]
        if kind == "new-resonance":
            size = (("frequency", now[-1][0]),)  # as it is when it is recorded
        after = circuit(f, now)
        yield MadePair(f"circuit {k}", as_measured(f, circuit(f, own), rng), as_measured(f, after, rng), kind, (), size)
