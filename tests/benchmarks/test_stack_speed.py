"""Speed of the stack relative to other implementations in the same run. Asserts only that all results agree."""

import timeit
from collections.abc import Callable

import numpy as np
import skrf
from skrf.media import DefinedGammaZ0

from pzctl.models.stack import AIR, Elastic, HalfSpace, Piezo, Stack

AREA = 2.01e-4
F = np.linspace(0.5e6, 15.5e6, 801)
OMEGA = 2 * np.pi * F
WATER = HalfSpace("water", 1.48e6)
DISK = Piezo(
    "disk",
    thickness=0.512e-3,
    density=7700.0,
    c33D=1.444e11 * (1 + 1j / 80),
    h33=1.98e9 * (1 + 0.002j),
    eps33S=8.09e-9 * (1 - 0.017j),
)
LAYERS = (
    Elastic("glue1", 11e-6, 2.8e6, 2442.0, 13.0),
    Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0),
    Elastic("glue2", 10e-6, 2.8e6, 2442.0, 13.0),
    Elastic("ml2", 129e-6, 3.3e6, 2400.0, 40.0),
)
STACK = Stack((DISK, *LAYERS), AIR, WATER, AREA)
NAMES = [
    *("disk.thickness", "disk.c33D.re", "disk.c33D.im", "disk.h33.re", "disk.h33.im", "disk.eps33S.re"),
    *("disk.eps33S.im", "glue1.thickness", "ml1.z", "ml1.c", "ml1.q", "glue2.thickness", "ml2.z", "ml2.c", "ml2.q"),
]


def seconds(call: Callable[[], object], number: int = 50) -> float:
    """The fastest of many short runs, so that other load on the machine does not count."""
    return min(timeit.repeat(call, number=number, repeat=20)) / number


def masons_three_port() -> np.ndarray:
    """The textbook formulas in NumPy: tan for layers, tan and sin for the plate."""
    load = WATER.z * np.ones_like(F, complex)
    for layer in reversed(LAYERS):
        root = np.sqrt(1 + 1j / layer.q)
        Zc, tan = layer.z * root, np.tan(OMEGA * layer.thickness / (layer.c * root))
        load = Zc * (load + 1j * Zc * tan) / (Zc + 1j * load * tan)
    v = np.sqrt(DISK.c33D / DISK.density)
    Za, phase = DISK.density * v, OMEGA * DISK.thickness / v
    M11, M12 = Za / (1j * np.tan(phase)), Za / (1j * np.sin(phase))
    a, d = M11 + AIR.z, M11 + load
    motional = (DISK.h33 / OMEGA) ** 2 * (a + d - 2 * M12) / (a * d - M12**2)
    return (DISK.thickness / (1j * OMEGA * DISK.eps33S) + motional) / AREA


def scikit_rf() -> np.ndarray:
    """Acoustic lines as transmission lines, cascaded by scikit-rf; then the three-port loaded with them."""
    frequency = skrf.Frequency.from_f(F, unit="Hz")
    chain = None
    for layer in LAYERS:
        root = np.sqrt(1 + 1j / layer.q)
        line = DefinedGammaZ0(frequency, z0=layer.z * root, gamma=1j * OMEGA / (layer.c * root)).line(
            layer.thickness, "m"
        )
        line.renormalize(1e6)
        chain = line if chain is None else chain**line
    S, r = chain.s, (WATER.z - 1e6) / (WATER.z + 1e6)
    seen = S[:, 0, 0] + S[:, 0, 1] * S[:, 1, 0] * r / (1 - S[:, 1, 1] * r)
    load = 1e6 * (1 + seen) / (1 - seen)
    v = np.sqrt(DISK.c33D / DISK.density)
    Za, phase = DISK.density * v, OMEGA * DISK.thickness / v
    M11, M12 = Za / (1j * np.tan(phase)), Za / (1j * np.sin(phase))
    a, d = M11 + AIR.z, M11 + load
    return (
        DISK.thickness / (1j * OMEGA * DISK.eps33S) + (DISK.h33 / OMEGA) ** 2 * (a + d - 2 * M12) / (a * d - M12**2)
    ) / AREA


def four_by_four() -> np.ndarray:
    """xMason's method: one 4 x 4 matrix of (pressure, velocity, voltage, current) per layer and frequency."""
    total = np.broadcast_to(np.eye(4, dtype=complex), (F.size, 4, 4))
    for layer in (DISK, *LAYERS):
        c33 = layer.c33D if isinstance(layer, Piezo) else layer.c33
        v = np.sqrt(c33 / layer.density)
        Z, k = layer.density * v, OMEGA * layer.thickness / v
        M = np.zeros((F.size, 4, 4), complex)
        M[:, 0, 0] = M[:, 1, 1] = np.cos(k)
        M[:, 0, 1], M[:, 1, 0] = -1j * Z * np.sin(k), -1j / Z * np.sin(k)
        M[:, 2, 2] = M[:, 3, 3] = 1
        if isinstance(layer, Piezo):
            H, W = layer.h33 / (1j * OMEGA), layer.thickness / (1j * OMEGA * layer.eps33S)
            M[:, 0, 3], M[:, 1, 3] = H * (1 - np.cos(k)), 1j * H / Z * np.sin(k)
            M[:, 2, 0], M[:, 2, 1] = 1j * H / Z * np.sin(k), H * (1 - np.cos(k))
            M[:, 2, 3] = W - H**2 * 1j / Z * np.sin(k)
        total = M @ total
    # back: F = -Z_back v; front: F = Z_front v; V counts from zero; I = 1
    by_v = total @ np.array([-AIR.z, 1, 0, 0])
    by_I = total @ np.array([0, 0, 0, 1])
    v0 = -(by_I[:, 0] - WATER.z * by_I[:, 1]) / (by_v[:, 0] - WATER.z * by_v[:, 1])
    return (by_I[:, 2] + v0 * by_v[:, 2]) / AREA


def by_differences() -> np.ndarray:
    """Fifteen derivatives by central differences of the stack's own value."""
    values, Z, rows = STACK.parameters(), STACK.impedance(F), []
    for name in NAMES:
        h = 1e-6 * values[name]
        up, down = (STACK.replace({name: values[name] + side}).impedance(F) for side in (h, -h))
        rows.append((up - down) / (2 * h * Z))
    return np.array(rows)


def test_speed() -> None:
    phases = np.random.default_rng(1).uniform(0, 20, (5, F.size)) * (1j - 0.01)
    yardstick = seconds(lambda: np.exp(phases))
    value = seconds(lambda: STACK.impedance(F))
    full = seconds(lambda: STACK.jacobian(F, NAMES))
    print(f"\n801 points, 5 layers, {len(NAMES)} parameters")
    print(f"  complex numpy.exp over (5, 801): {yardstick * 1e6:.1f} us")
    print(f"  value                 {value * 1e6:8.1f} us = {value / yardstick:5.2f} exp   (wanted: at most 1.5)")
    print(f"  value and Jacobian    {full * 1e6:8.1f} us = {full / yardstick:5.2f} exp   (wanted: at most 6)")
    print(f"  the same / value      {full / value:8.2f}                  (wanted: at most 3)")
    half_turns, growth = phases.imag / 2, phases.real
    kernel = seconds(lambda: (np.tan(half_turns), np.expm1(growth)))
    print(
        f"  transcendental functions: one real tan and one real expm1 per layer and point, {kernel * 1e6:.1f} us = "
        f"{kernel / value:.0%} of the value; the rest is some ten complex operations per layer, and the calls"
    )
    for rival in (masons_three_port, four_by_four, scikit_rf):
        assert np.max(np.abs(rival() / STACK.impedance(F) - 1)) < 1e-9
        time = seconds(rival, number=3)
        print(f"  {rival.__name__:20s}  {time * 1e6:8.1f} us = {time / value:5.1f} times the value")
    rows = STACK.jacobian(F, NAMES)[1]
    assert np.max(np.abs(by_differences() - rows) / np.abs(rows).max(axis=1, keepdims=True)) < 1e-5
    time = seconds(by_differences, number=3)
    print(f"  {by_differences.__name__:20s}  {time * 1e6:8.1f} us = {time / full:5.1f} times the exact Jacobian")


def test_batch() -> None:
    """Two hundred parameter sets one after the other, compared with the same set repeated."""
    values = STACK.parameters()
    draws = np.random.default_rng(2).normal(1, 0.01, (200, len(NAMES)))
    sets = [{name: values[name] * factor for name, factor in zip(NAMES, row, strict=True)} for row in draws]
    one = seconds(lambda: STACK.replace(sets[0]).impedance(F))
    many = seconds(lambda: [STACK.replace(changed).impedance(F) for changed in sets], number=1) / len(sets)
    value = seconds(lambda: STACK.impedance(F))
    print(f"\n  one set {one * 1e6:.1f} us, of it {(one - value) * 1e6:.1f} us to replace its parameters")
    print(f"  two hundred sets, per set {many * 1e6:.1f} us = {many / one:.2f} of one alone   (wanted: at most 1)")


def test_more_points_and_layers() -> None:
    """Cost of a point when there are many, and of a further layer."""
    print()
    for points in (201, 801, 3201, 12801):
        f = np.linspace(0.5e6, 15.5e6, points)
        phases = np.random.default_rng(1).uniform(0, 20, (5, points)) * (1j - 0.01)
        value, exp = seconds(lambda f=f: STACK.impedance(f), 10), seconds(lambda x=phases: np.exp(x), 10)
        print(f"  {points:6d} points: {value / points * 1e9:7.1f} ns per point = {value / exp:.2f} exp")
