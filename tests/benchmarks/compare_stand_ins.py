"""Pairs as users bring them, of devices whose geometry nobody states.

Six elements of an array with and without their cable, five with and without a coil, a probe with a capacitor across,
a piezo bare, with a coil across, and with another in series, a device with a long and a short wire, the same twice,
one at two drive levels. Devices are plates with matching layers and a backing (chain matrices of lossy layers), free
disks (many modes) and published recordings; instruments are bridges, network analyzers and simple ones with few points.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from compare_bench import Mode, admittance, as_written, branch
from compare_components import coax, coil, resonator, rng_of, wire
from compare_world import RECORDINGS, MadePair, inductance, seen_through, series, shunt, warped

from pzctl.drivers.recordings import read_recording
from pzctl.models.sweep import Sweep

Record = Callable[[np.ndarray, np.ndarray], Sweep]


def element(rng: np.random.Generator, middle: float, clamped: float) -> Callable[[np.ndarray, bool], np.ndarray]:
    """Return the admittance of an array element: a plate with two matching layers, a lens, a backing, lateral modes.

    Y = jwC / (1 - k^2 tan(x)/x ...) by the chain matrix of the plate between its loads, all relative to the plate's
    acoustic impedance.
    """
    k2, loss = rng.uniform(0.3, 0.5), rng.uniform(0.01, 0.03)
    layers = [(rng.uniform(0.2, 0.35), rng.uniform(0.9, 1.1)), (rng.uniform(0.06, 0.12), rng.uniform(0.9, 1.1))]
    back, lens = rng.uniform(0.05, 0.25), rng.uniform(0.04, 0.06)
    weak = [(middle * rng.uniform(0.4, 1.6), rng.uniform(8, 30), 10 ** rng.uniform(-3.3, -2)) for _ in range(3)]
    drift, larger = 2e-4 * rng.normal(), 1e-3 * rng.normal()
    change = rng_of(middle)

    def at(f: np.ndarray, after: bool) -> np.ndarray:
        f0 = middle * (1 + drift * after)
        front = np.full(f.size, lens, complex)
        for z, quarter in reversed(layers):
            t = np.tan(np.pi / 2 * f / (middle * quarter) * (1 - 0.02j))
            front = z * (front + 1j * z * t) / (z + 1j * front * t)
        x = np.pi * f / f0 * (1 - 0.5j * loss)
        bottom = (1 + back * front) * np.sin(x) - 1j * (back + front) * np.cos(x)
        top = 2 * (np.cos(x) - 1) + 1j * (back + front) * np.sin(x)
        Y = 2j * np.pi * f * clamped * (1 + larger * after) * (1 - 0.02j) / (1 + k2 / x * top / bottom)
        now = [(p * (1 + drift + 5e-5 * change.normal()), q, c) for p, q, c in weak] if after else weak
        return Y + admittance(f, now, clamped) - admittance(f, [], clamped)

    return at


def bridge(rng: np.random.Generator, volt: float | None = None) -> Record:
    """Return an impedance analyzer."""
    return lambda f, Z: as_written(f, Z, rng, volt)


def network_analyzer(rng: np.random.Generator) -> Record:
    """Return a network analyzer; what its calibration left is the same in all recordings, to a tenth."""
    left = 10 ** rng.uniform(-3.3, -2.5) * (rng.normal(size=6) + 1j * rng.normal(size=6))
    noise = 10 ** rng.uniform(-4.5, -3.5)

    def record(f: np.ndarray, Z: np.ndarray) -> Sweep:
        own = left * (1 + 0.1 * rng.normal(size=6))
        u = np.log(f / f[0]) / np.log(f[-1] / f[0])
        S = (Z - 50) / (Z + 50)
        S = own[0] + own[1] * u + S * (1 + own[2] + own[3] * u) / (1 - S * (own[4] + own[5] * u))
        S = S + noise * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        dB, degrees = np.round(20 * np.log10(np.abs(S)), 4), np.round(np.degrees(np.angle(S)), 3)
        S = 10 ** (dB / 20) * np.exp(1j * np.radians(degrees))
        return Sweep(f, 50 * (1 + S) / (1 - S))

    return record


def simple(rng: np.random.Generator) -> Record:
    """Return a simple instrument: much noise, few digits."""
    noise, size = 10 ** rng.uniform(-3, -2.3), 3e-3 * rng.normal()

    def record(f: np.ndarray, Z: np.ndarray) -> Sweep:
        Z = Z * np.exp(size + 1e-3 * rng.normal() + noise * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)))
        magnitude = np.array([float(f"{v:.4g}") for v in np.abs(Z)])
        return Sweep(f, magnitude * np.exp(1j * np.radians(np.round(np.degrees(np.angle(Z)), 1))))

    return record


def _grids(rng: np.random.Generator, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequencies before and after: linear or logarithmic, mostly the same."""
    spaced = np.linspace if rng.uniform() < 0.6 else np.geomspace
    f = spaced(low, high, int(rng.choice([101, 201, 401, 801])))
    if rng.uniform() < 0.7:
        return f, f
    return f, np.linspace(low * rng.uniform(0.9, 1.05), high * rng.uniform(0.95, 1.1), int(rng.choice([201, 401])))


def _instrument(rng: np.random.Generator) -> Record:
    return (bridge, bridge, network_analyzer)[int(rng.integers(3))](rng)


def stand_ins(seed: int) -> Iterator[MadePair]:
    """Yield one of everything."""
    rng = np.random.default_rng((seed, 22))
    for k, pair in enumerate((*_array(rng), *_coils(rng), *_piezo(rng), *_others(rng), *_published(rng))):
        yield replace(pair, name=f"{pair.name} {k}")


def _made(
    name: str,
    record: Record,
    grids: tuple[np.ndarray, np.ndarray],
    device: Callable[[np.ndarray, bool], np.ndarray],
    element: Callable[[np.ndarray], list[np.ndarray]] = lambda _: [],
    **truth: object,
) -> MadePair:
    f, g = grids
    before, after = 1 / device(f, False), seen_through(g, 1 / device(g, True), element(g))
    return replace(MadePair(name, record(f, before), record(g, after), ""), **truth)


def _array(rng: np.random.Generator) -> Iterator[MadePair]:
    """Yield six elements of one kind, with a cable each."""
    middle, clamped = 10 ** rng.uniform(6.2, 6.9), 10 ** rng.uniform(-10.3, -9.5)
    meters, ohm, speed = rng.uniform(0.5, 2.2), float(rng.choice([50, 75, 85])), 3e8 * rng.uniform(0.66, 0.78)
    record, grids = _instrument(rng), _grids(rng, 0.35 * middle, 1.8 * middle)
    for _ in range(6):
        device = element(rng, middle * (1 + 0.01 * rng.normal()), clamped * (1 + 0.02 * rng.normal()))
        line = rng.integers(1 << 30)
        made = lambda f, line=line: coax(np.random.default_rng(line), f, meters, ohm, speed)  # noqa: E731
        yield _made(
            "array element, cable", record, grids, device, lambda f, made=made: made(f)[0],
            effect="cable", sizes=made(grids[1])[1],
        )  # fmt: skip


def _coils(rng: np.random.Generator) -> Iterator[MadePair]:
    """Yield five elements or resonators of one kind, with a coil each: of one type, within its tolerance."""
    middle, clamped = 10 ** rng.uniform(5.5, 6.7), 10 ** rng.uniform(-9.8, -8.8)
    record, grids = _instrument(rng), _grids(rng, 0.5 * middle, 1.6 * middle)
    henry = 10 ** rng.uniform(-0.6, 0.1) / (2 * np.pi * middle) ** 2 / clamped
    make, kind = (element, resonator)[int(rng.integers(2))], int(rng.integers(1 << 30))
    for _ in range(5):
        device = make(rng, middle * (1 + 0.01 * rng.normal()), clamped * (1 + 0.02 * rng.normal()))
        part = henry * (1 + 0.03 * rng.normal())
        coil_of = lambda f, part=part: coil(np.random.default_rng(kind), f, part, middle)  # noqa: E731
        L = coil_of(grids[1])[1]
        yield _made(
            "element, coil", record, grids, device, lambda f, c=coil_of: [series(c(f)[0])],
            effect="series-coil", sizes=(("inductance", L),),
        )  # fmt: skip


def _piezo(rng: np.random.Generator) -> Iterator[MadePair]:
    """Yield a free disk with a coil across, with another in series, and a probe with a capacitor across."""
    middle, clamped = 10 ** rng.uniform(4.8, 6.3), 10 ** rng.uniform(-9.5, -8.5)
    grids, kind = _grids(rng, 0.6 * middle, 1.5 * middle), int(rng.integers(1 << 30))
    for name, effect in (("piezo, coil across", "shunt-inductance"), ("piezo, coil in series", "series-coil")):
        device = resonator(np.random.default_rng(kind), middle, clamped)
        resonant = 1 / (2 * np.pi * middle) ** 2 / clamped
        henry = resonant * 10 ** (rng.uniform(-0.2, 0.4) if "across" in name else rng.uniform(-0.6, 0.1))
        wound = int(rng.integers(1 << 30))
        coil_of = lambda f, wound=wound, henry=henry: coil(np.random.default_rng(wound), f, henry, middle)  # noqa: E731
        in_place = (lambda f, c=coil_of: [shunt(1 / c(f)[0])]) if "across" in name else (
            lambda f, c=coil_of: [series(c(f)[0])]
        )  # fmt: skip
        sizes = (("inductance", coil_of(grids[1])[1]),)
        yield _made(name, bridge(rng), grids, device, in_place, effect=effect, sizes=sizes)
    middle, clamped = 10 ** rng.uniform(6.0, 6.8), 10 ** rng.uniform(-9.5, -9)
    C, tan = clamped * 10 ** rng.uniform(-0.7, 0.3), 10 ** rng.uniform(-3.5, -1.7)
    for _ in range(2):
        probe = element(rng, middle, clamped)
        yield _made(
            "probe, capacitor across", _instrument(rng), _grids(rng, 0.4 * middle, 1.7 * middle), probe,
            lambda f: [shunt(1 / (1 / (2j * np.pi * f * C * (1 - 1j * tan)) + 2j * np.pi * f * 6e-9 + 0.03))],
            effect="stray-capacitance", sizes=(("capacitance", C),),
        )  # fmt: skip


def _others(rng: np.random.Generator) -> Iterator[MadePair]:
    """Yield a long and a short wire, recordings repeated, drive levels, and a simple instrument."""
    for _ in range(2):
        middle, clamped = 10 ** rng.uniform(4.5, 5.5), 10 ** rng.uniform(-9.3, -8.3)
        device = resonator(rng, middle, clamped, 2.3)
        grids = _grids(rng, 0.7 * middle, 1.4 * middle)
        more = rng.uniform(1e-7, 4e-7)  # ten to forty centimetres
        yield _made("long and short wire", bridge(rng), grids, device, lambda f, m=more: [series(wire(rng, f, m))])
    for record in (bridge(rng), network_analyzer(rng), simple(rng)):
        middle = 10 ** rng.uniform(5.5, 6.7)
        yield _made("again", record, _grids(rng, 0.5 * middle, 1.6 * middle), element(rng, middle, 2e-10))
    for few in (41, 61):
        middle = 10 ** rng.uniform(5, 6.3)
        f = np.linspace(0.7 * middle, 1.4 * middle, few)
        L = 10 ** rng.uniform(-0.5, 0) / (2 * np.pi * middle) ** 2 / 1e-9
        wound = int(rng.integers(1 << 30))
        coil_of = lambda f, w=wound, L=L, m=middle: coil(np.random.default_rng(w), f, L, m)  # noqa: E731
        yield _made(
            "few points, coil", simple(rng), (f, f), resonator(rng, middle, 1e-9, 2.0),
            lambda f, c=coil_of: [series(c(f)[0])], effect="series-coil", sizes=(("inductance", coil_of(f)[1]),),
        )  # fmt: skip
    yield from (_levels(rng) for _ in range(3))


def _levels(rng: np.random.Generator) -> MadePair:
    """Return a disk at two levels; its strong mode bends by up to half of its width."""
    middle, q = 10 ** rng.uniform(4.6, 6.2), 10 ** rng.uniform(1.9, 2.8)
    modes: list[Mode] = [(middle, q, rng.uniform(0.05, 0.2)), (1.2 * middle, q / 2, 10 ** rng.uniform(-3, -2))]
    f = np.linspace(0.94 * middle, 1.08 * middle, int(rng.choice([201, 401, 801])))
    low, high = (float(v) for v in rng.choice([(0.1, 1.0), (0.5, 1.0), (0.2, 0.8)]))
    soft, lossy = 10 ** rng.uniform(-0.9, -0.15) / q / (high * q), rng.uniform(0.05, 0.5) / (high * q)
    now = [(f0 * (1 + 1e-4 * rng.normal()), q, c) for f0, q, c in modes]
    first, second = admittance(f, modes, 1e-9, low, soft, lossy), admittance(f, now, 1e-9, high, soft, lossy)
    largest = float(np.max(branch(f, modes[0], 1e-9, (high, soft, lossy))[1]))
    before, after = bridge(rng, low)(f, 1 / first), bridge(rng, high)(f, 1 / second)
    return MadePair("two levels", before, after, "drive-nonlinearity", (), (("softening", soft * largest / 2),))


def _published(rng: np.random.Generator) -> Iterator[MadePair]:
    """Yield published transducers with published coils on the same frequencies, in series and across."""
    folder = RECORDINGS / "air-40khz"
    for across in (False, True, False, True):
        device = read_recording(folder / f"trans_25-50k_001_{rng.integers(1, 21):03d}.csv")
        size = str(rng.choice(["150", "220", "330", "680"]))
        z = read_recording(folder / f"coil_{size}u_25kHz_50kHz.csv").impedance
        f, Z = device.frequency, device.impedance
        factor = float(rng.uniform(1, 10)) if not across else 1.0  # of several in series
        after = seen_through(f, warped(f, Z, rng), [shunt(1 / z) if across else series(factor * z)])
        L = factor * inductance(f, z)
        name = f"transducer, {factor:.1f} coils of {size} uH"
        effect = "shunt-inductance" if across else "series-coil"
        yield MadePair(name, Sweep(f, Z), bridge(rng)(f, after), effect, (), (("inductance", L),))
