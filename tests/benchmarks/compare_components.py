"""Pairs with real components: wires, cables and coils by their physics, at plates, array elements and sharp resonators.

Coils have a core whose permeability relaxes, a wire with the exact skin effect of a round conductor, and a capacitance
of their own; cables have the same wire, a lossy dielectric and a velocity of their own. Devices drift between the
recordings by 1e-4 to 1e-3 in frequency and by one per cent in Q.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from compare_bench import Mode, admittance, as_written, branch
from compare_world import LEVEL, RECORDINGS, MadePair, coax, inductance, round_wire, seen_through, series, shunt

from pzctl.drivers.recordings import read_recording

Device = Callable[[np.ndarray, bool], np.ndarray]
"""Returns the admittance at frequencies, before or after the drift."""


def wire(rng: np.random.Generator, f: np.ndarray, henry: float) -> np.ndarray:
    """Return the impedance of a wire with this external inductance, the resistance of its length and its contacts."""
    inside = round_wire(f, henry / 1e-6, 10 ** rng.uniform(-3.8, -3.2))
    return 2j * np.pi * f * henry + inside + 10 ** rng.uniform(-3, -1)


def coil(rng: np.random.Generator, f: np.ndarray, henry: float, middle: float) -> tuple[np.ndarray, float]:
    """Return the impedance of a coil in ohm: relaxing core, wire with proximity effect, own capacitance.

    And its inductance in the middle of the band, as without its own capacitance.
    """
    w = 2 * np.pi * f
    core = 1.0
    if rng.uniform() < 0.6:
        relax, spread = middle * 10 ** rng.uniform(0.7, 2.0), rng.uniform(0.0, 0.4)
        part = rng.uniform(0.3, 1.0)  # an open core: part of the inductance is that of air
        core = (1 - part) + part / (1 + (1j * f / relax) ** (1 - spread))
    reactance = 2 * np.pi * middle * henry
    radius = 10 ** rng.uniform(-4.2, -3.5)
    turns = round_wire(f, 1.0, radius)
    rough = turns * reactance / rng.uniform(30, 150) / turns[np.argmin(np.abs(f - middle))].real
    z = 1j * w * henry * core + rough
    own = 10 ** rng.uniform(-12, -10.8)
    own = min(own, 0.3 / ((2 * np.pi * middle) ** 2 * henry))
    return z / (1 + 1j * w * own * (1 - 0.02j) * z), inductance(f, z)


def plate(rng: np.random.Generator, middle: float, clamped: float) -> Device:
    """Return a plate with a matching layer, a backing and weak lateral modes."""
    k2, q = rng.uniform(0.2, 0.45), 10 ** rng.uniform(1.3, 2.0)
    back, layer = 10 ** rng.uniform(-2, -0.6), rng.uniform(0.1, 0.25)
    front = rng.uniform(0.01, 0.05)
    weak = [
        (middle * rng.uniform(0.5, 1.6), 10 ** rng.uniform(1.2, 1.9), 10 ** rng.uniform(-3.5, -2)) for _ in range(4)
    ]
    drift, lossier = 10 ** rng.uniform(-4, -3) * rng.choice([-1, 1]), 0.01 * rng.normal()
    has_layer = rng.uniform() < 0.6

    def at(f: np.ndarray, after: bool) -> np.ndarray:
        f0 = middle * (1 + drift * after)
        theta = np.pi * f / f0 * (1 - 1j / (2 * q * (1 + lossier * after)))
        z = front
        if has_layer:
            t = np.tan(np.pi / 2 * f / middle * (1 - 0.01j))
            z = layer * (front + 1j * layer * t) / (layer + 1j * front * t)
        top = 2 * (np.cos(theta) - 1) + 1j * (back + z) * np.sin(theta)
        bottom = (1 + back * z) * np.sin(theta) - 1j * (back + z) * np.cos(theta)
        jwC = 2j * np.pi * f * clamped * (1 - 0.01j)
        others = admittance(f, drifted(rng_of(middle), weak, drift) if after else weak, clamped)
        return jwC / (1 + k2 / theta * top / bottom) + others - admittance(f, [], clamped)

    return at


def rng_of(number: float) -> np.random.Generator:
    return np.random.default_rng(int(number))


def drifted(rng: np.random.Generator, modes: list[Mode], together: float) -> list[Mode]:
    return [(f0 * (1 + together + 3e-5 * rng.normal()), q * (1 + 0.01 * rng.normal()), c) for f0, q, c in modes]


def resonator(rng: np.random.Generator, middle: float, clamped: float, sharpest: float = 3.0) -> Device:
    """Return a resonator of several modes, with Q up to `sharpest` decades."""
    modes = [(middle * (1 + 0.03 * rng.normal()), 10 ** rng.uniform(1.5, sharpest), rng.uniform(0.05, 0.25))]
    modes += [
        (middle * rng.uniform(0.6, 1.5), 10 ** rng.uniform(1.5, sharpest), 10 ** rng.uniform(-3.5, -1.5))
        for _ in range(int(rng.integers(1, 7)))
    ]
    now = drifted(rng, modes, 10 ** rng.uniform(-4, -3) * rng.choice([-1, 1]))
    larger = 5e-4 * rng.normal()
    return lambda f, after: admittance(f, now if after else modes, clamped * (1 + larger * after))


def _grids(rng: np.random.Generator, middle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return two grids, mostly equal."""
    low, high = middle * rng.uniform(0.4, 0.75), middle * rng.uniform(1.3, 1.9)
    points = int(rng.choice([201, 401, 801]))
    first = np.linspace(low, high, points) if rng.uniform() < 0.8 else np.geomspace(low, high, points)
    if rng.uniform() < 0.75:
        return first, first
    return first, np.linspace(low * rng.uniform(0.9, 1.05), high * rng.uniform(0.95, 1.1), int(rng.choice([401, 801])))


KINDS = (
    "cable", "cable", "cable", "coil", "coil", "coil", "across", "across", "across", "capacitor", "capacitor",
    "wire", "wire", "wire", "levels", "levels", "stack", "recorded coil", "recorded coil", "still", "still",
)  # fmt: skip


def with_components(seed: int, rounds: int = 5) -> Iterator[MadePair]:
    """Yield pairs, `rounds` times all kinds."""
    for k in range(rounds):
        for j, kind in enumerate(KINDS):
            rng = np.random.default_rng((seed, k, j))
            made = _levels(rng) if kind == "levels" else _recorded(rng) if kind == "recorded coil" else _pair(rng, kind)
            yield replace(made, name=f"{kind} {k}.{j}")


def _pair(rng: np.random.Generator, kind: str) -> MadePair:
    middle = 10 ** rng.uniform(5.4, 6.9)
    clamped = 10 ** rng.uniform(-10.3, -8.9)
    f, g = _grids(rng, middle)
    own = plate(rng, middle, clamped) if rng.uniform() < 0.5 else resonator(rng, middle, clamped)
    if kind == "wire":
        own = resonator(rng, middle, clamped)
    before, now = own(f, False), own(g, True)
    w, zm = 2 * np.pi * middle, 1 / (2 * np.pi * middle * clamped)
    elements: list[np.ndarray] = []
    truth: dict[str, object] = {}
    if kind == "cable":
        meters, ohm = 10 ** rng.uniform(-1, 0.5), float(rng.choice([50, 75, 100]))
        speed = 3e8 * rng.uniform(0.66, 0.85)
        elements, sizes = coax(rng, g, meters, ohm, speed)
        truth = {"effect": "cable", "also": ("stray-capacitance", "lead-inductance"), "sizes": sizes}
    elif kind == "coil":
        L = zm * 10 ** rng.uniform(-0.8, 0.2) / w
        z, L = coil(rng, g, L, middle)
        elements = [series(z)]
        truth = {"effect": "series-coil", "also": ("lead-inductance",), "sizes": (("inductance", L),)}
    elif kind == "across":
        L = zm * 10 ** rng.uniform(-0.3, 0.5) / w
        z, L = coil(rng, g, L, middle)
        elements = [shunt(1 / z)]
        truth = {"effect": "shunt-inductance", "sizes": (("inductance", L),)}
    elif kind == "capacitor":
        C = clamped * 10 ** rng.uniform(-1, 0.5)
        z = 1 / (2j * np.pi * g * C * (1 - 1j * 10 ** rng.uniform(-3.5, -1.7))) + 2j * np.pi * g * 8e-9 + 0.05
        elements = [shunt(1 / z)]
        truth = {"effect": "stray-capacitance", "also": ("cable",), "sizes": (("capacitance", C),)}
    elif kind == "wire":
        L = 10 ** rng.uniform(np.log10(2e-8), np.log10(3e-7))
        z = wire(rng, g, L)
        elements, L = [series(z)], inductance(g, z)
        moved = np.sqrt(np.mean(np.abs(np.log(1 + z * now)) ** 2))
        effect = "perhaps" if moved < LEVEL else "lead-inductance"
        truth = {"effect": effect, "also": ("lead-inductance", "series-coil"), "sizes": (("inductance", L),)}
    elif kind == "stack":
        other = resonator(rng, middle * rng.uniform(0.85, 1.15), clamped * rng.uniform(0.5, 2))(g, False)
        elements = [series(1 / other)]
        truth = {"effect": "something else", "also": ("series-capacitance", "new-resonance")}
    made = MadePair(kind, as_written(f, 1 / before, rng), as_written(g, seen_through(g, 1 / now, elements), rng), "")
    made = replace(made, **truth)
    if elements and kind != "stack" and rng.uniform() < 0.3 and f is g:
        return replace(made, before=made.after, after=made.before, removed=True)
    return made


def _recorded(rng: np.random.Generator) -> MadePair:
    """Return a device made for one of the published recordings of coils, in series or across."""
    size = str(rng.choice(["150", "220", "330", "680"]))
    sweep = read_recording(RECORDINGS / "air-40khz" / f"coil_{size}u_1kHz_20MHz.csv")
    own_resonance = sweep.frequency[int(np.argmax(np.abs(sweep.impedance)))]
    low, high = 6e5, min(0.8 * own_resonance, 2.9e6)
    chosen = (sweep.frequency >= low) & (sweep.frequency <= high)
    low, high = (float(v) for v in sweep.frequency[chosen][[0, -1]])
    f = np.linspace(low, high, int(rng.choice([201, 401])))
    # Without its own capacitance a coil is smooth; near its own resonance the impedance itself is not.
    u = np.log(sweep.frequency[chosen])
    inductive = sweep.impedance[chosen] * (1 - (sweep.frequency[chosen] / own_resonance) ** 2)
    y = np.log(np.abs(inductive)) + 1j * np.unwrap(np.angle(inductive))
    x = 2 * (np.log(f) - u[0]) / (u[-1] - u[0]) - 1
    fit = np.polynomial.chebyshev.chebfit(2 * (u - u[0]) / (u[-1] - u[0]) - 1, np.stack([y.real, y.imag], 1), 5)
    smooth = np.polynomial.chebyshev.chebval(x, fit[:, 0]) + 1j * np.polynomial.chebyshev.chebval(x, fit[:, 1])
    z = np.exp(smooth) / (1 - (f / own_resonance) ** 2)
    middle = float(np.sqrt(low * high))
    at = int(np.argmin(np.abs(f - middle)))
    L = inductance(f, z * (1 - (f / own_resonance) ** 2))  # without its own capacitance
    across = bool(rng.uniform() < 0.5)
    part = 10 ** rng.uniform(-0.3, 0.3) if across else 10 ** rng.uniform(0, 0.8)
    clamped = 1 / (2 * np.pi * middle * abs(z[at]) * part)
    own = resonator(rng, middle, clamped, 2.5)
    before, now = 1 / own(f, False), 1 / own(f, True)
    after = seen_through(f, now, [shunt(1 / z) if across else series(z)])
    effect, also = ("shunt-inductance", ()) if across else ("series-coil", ("lead-inductance",))
    return MadePair(
        f"{size} uH {effect}", as_written(f, before, rng), as_written(f, after, rng), effect, also, (("inductance", L),)
    )


def _levels(rng: np.random.Generator) -> MadePair:
    """Return a device at two drive levels; its strong mode bends by 0.3 to 1.5 of its widths."""
    middle, clamped = 10 ** rng.uniform(5, 6.5), 10 ** rng.uniform(-9.5, -8.7)
    q = 10 ** rng.uniform(1.7, 2.8)
    modes: list[Mode] = [(middle, q, rng.uniform(0.05, 0.2))]
    modes += [
        (middle * rng.uniform(0.85, 1.15), q * rng.uniform(0.4, 1), 10 ** rng.uniform(-3, -1.5))
        for _ in range(int(rng.integers(0, 4)))
    ]
    width = 3 * middle / q
    span = max(width * 4, 0.05 * middle)
    f = np.linspace(middle - span, middle + span, int(rng.choice([201, 401, 801])))
    low, high = (float(v) for v in rng.choice([(0.1, 1.0), (0.5, 1.0), (0.2, 1.0), (0.05, 0.5)]))
    bend = 10 ** rng.uniform(-0.5, 0.2)
    soft, lossy = bend / q / (high * q), rng.uniform(0.05, 0.6) / (high * q)
    now = drifted(rng, modes, 1e-4 * rng.normal())
    first, second = admittance(f, modes, clamped, low, soft, lossy), admittance(f, now, clamped, high, soft, lossy)
    largest = float(np.max(branch(f, modes[0], clamped, (high, soft, lossy))[1]))
    before, after = as_written(f, 1 / first, rng, low), as_written(f, 1 / second, rng, high)
    made = MadePair("", before, after, "drive-nonlinearity", (), (("softening", soft * largest / 2),))
    return made if bend < 0.8 else replace(made, effect="beyond the law", also=("drive-nonlinearity",))
