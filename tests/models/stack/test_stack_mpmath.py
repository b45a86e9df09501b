"""The stack compared with high-precision arithmetic: the textbook's cosh and sinh, and differences for derivatives.

The reference carries (pressure, velocity) from face to face through the layers with hundreds of digits, so that its
own cancellations do not matter, and solves for the end condition and the wiring at the end.
"""

from collections.abc import Mapping
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from pzctl.models.stack import (
    AIR,
    CONSTANT,
    VACUUM,
    CausalConstantQ,
    Elastic,
    HalfSpace,
    LossLaw,
    Mass,
    Piezo,
    PowerLoss,
    Spring,
    Stack,
)

Values = Mapping[str, mp.mpf]


def continued(law: LossLaw, value: mp.mpc, x: mp.mpf, exponent: mp.mpf | None) -> mp.mpc:
    """The complex constant at x times the reference frequency."""
    if isinstance(law, CausalConstantQ):
        return value * x ** (2 * mp.arg(value) / mp.pi)
    if isinstance(law, PowerLoss):
        n = exponent if exponent else mp.mpf(10) ** -60
        lossless = value.real - value.imag * mp.cot(n * mp.pi / 2)
        return lossless + value.imag / mp.sin(n * mp.pi / 2) * mp.expj(n * mp.pi / 2) * x**n
    return value


def constant(values: Values, name: str, law: LossLaw, f: mp.mpf) -> mp.mpc:
    value = mp.mpc(values[f"{name}.re"], values[f"{name}.im"])
    x = f / law.reference if law != CONSTANT else mp.mpf(1)
    return continued(law, value, x, values.get(f"{name}.exponent"))


def reference(stack: Stack, f: float, values: Values) -> mp.mpc:
    """Z in ohm from parameters by name. Unknowns: velocity of the back face, and the current of every piezo layer."""
    s, f = mp.mpc(0, 2 * mp.pi * f), mp.mpf(f)
    piezos = [layer.name for layer in stack.layers if isinstance(layer, Piezo)]
    size = 1 + len(piezos)
    unit = [mp.matrix([1 if i == k else 0 for i in range(size)]) for k in range(size)]
    v, F = unit[0], -values["back.z"] * unit[0]
    voltages = []
    for layer in stack.layers:
        own = {key.partition(".")[2]: value for key, value in values.items() if key.startswith(layer.name + ".")}
        if isinstance(layer, Mass):
            F = F - s * own["mass"] * v
        elif isinstance(layer, Spring):
            v = v - s / (own["stiffness"] * (1 + 1j / own["q"])) * F
        else:
            drive = 0 * unit[0]
            if isinstance(layer, Piezo):
                density, c33 = own["density"], constant(own, "c33D", layer.c_law, f)
                H = layer.polarity * constant(own, "h33", layer.h_law, f) / s
                W = own["thickness"] / (s * constant(own, "eps33S", layer.eps_law, f))
                current = unit[1 + piezos.index(layer.name)]
                drive = H * current
            else:
                density = own["z"] / own["c"]
                x = f / layer.law.reference if layer.law != CONSTANT else mp.mpf(1)
                c33 = continued(layer.law, own["z"] * own["c"] * (1 + 1j / own["q"]), x, own.get("q.exponent"))
            Zc, theta = mp.sqrt(density * c33), s * own["thickness"] * mp.sqrt(density / c33)
            E = F - drive
            v_next = mp.cosh(theta) * v - mp.sinh(theta) / Zc * E
            F = mp.cosh(theta) * E - mp.sinh(theta) * Zc * v + drive
            if isinstance(layer, Piezo):
                voltages.append(H * (v - v_next) + W * current)
            v = v_next
    rows, right = [F - values["front.z"] * v], [0]
    if stack.connection == "series":
        rows += unit[1:]
        right += [1] * len(piezos)
    else:
        rows += [voltage - voltages[0] for voltage in voltages[1:]] + [sum(unit[1:], 0 * unit[0])]
        right += [0] * (len(piezos) - 1) + [1]
    matrix = mp.matrix(size)
    for i, row in enumerate(rows):
        for k in range(size):
            matrix[i, k] = row[k]
    x = mp.lu_solve(matrix, mp.matrix(right))
    total = sum(voltages, 0 * unit[0]) if stack.connection == "series" else voltages[0]
    return (total.T * x)[0] / values["area"]


def exactly(stack: Stack) -> dict[str, mp.mpf]:
    return {name: mp.mpf(value) for name, value in stack.parameters().items()}


DISK = Piezo(
    "disk",
    thickness=0.512e-3,
    density=7700.0,
    c33D=1.444e11 * (1 + 1j / 80),
    h33=1.98e9 * (1 + 0.002j),
    eps33S=8.09e-9 * (1 - 0.017j),
)
GLUE = Elastic("glue1", thickness=11e-6, z=2.8e6, c=2442.0, q=13.0)
ML1 = Elastic("ml1", thickness=139e-6, z=10.3e6, c=2455.0, q=60.0)
WATER = HalfSpace("water", 1.48e6)

THIN = Elastic("glue1", 1e-6, 2.8e6, 2442.0, 13.0)
BACKED = AIR | Elastic("backing", 30e-3, 6e6, 1900.0, 8.0) | DISK | THIN | ML1
GLUE2, ML2 = Elastic("glue2", 10e-6, 2.8e6, 2442.0, 13.0), Elastic("ml2", 1.3e-4, 3e6, 2500.0, 40)
FIVE = AIR | DISK | GLUE | ML1 | GLUE2 | ML2
SECOND = Piezo(
    "second",
    thickness=0.3e-3,
    density=7500.0,
    c33D=1.3e11 * (1 + 0.02j),
    h33=2.1e9 * (1 - 0.01j),
    eps33S=8e-9 * (1 - 0.02j),
    polarity=-1,
    c_law=CausalConstantQ(3e6),
    h_law=PowerLoss(2e6, 0.3),
    eps_law=CausalConstantQ(1e6),
)
ODD = (
    Mass("wax", 0.05),
    Elastic("back plate", 0.2e-3, 15e6, 3000.0, 30.0, PowerLoss(3e6, 0.0)),
    DISK,
    Spring("joint", 2.2e14, 13.0),
    Elastic("foil", 20e-6, 3e6, 2500.0, 9.0, PowerLoss(3e6, 0.7)),
    SECOND,
    Elastic("lens", 0.5e-3, 1.3e6, 1100.0, 12.0, CausalConstantQ(2e6)),
)

STACKS = {
    "free disk": (VACUUM | DISK | VACUUM).with_area(2.01e-4),
    "lossless disk": (VACUUM | Piezo("disk", 0.5e-3, 7700.0, 1.4e11, 2e9, 8e-9) | VACUUM).with_area(2.01e-4),
    "five layers": (FIVE | WATER).with_area(2.01e-4),
    "1 um glue, 30 mm backing": (BACKED | AIR).with_area(2.01e-4),
    "dead layer on the disk": (AIR | DISK | replace(DISK, name="dead", thickness=8e-6, h33=0.0) | AIR).with_area(2e-4),
    "two piezo layers in series": Stack(ODD, HalfSpace("b", 3e6), WATER, 2e-4),
    "two piezo layers in parallel": Stack(ODD, HalfSpace("b", 3e6), WATER, 2e-4, "parallel"),
}
FREQUENCIES = np.array([40.0, 1e3, 0.97e5, 1.234e6, 3.99e6, 4.217e6, 12.7e6, 41e6, 110e6])


@pytest.fixture(autouse=True)
def digits(request: pytest.FixtureRequest):
    """Digits: a cosh of 1e150 in the thick backing still leaves more than fifty; elsewhere cosh stays below 1e60."""
    with mp.workdps(400 if "backing" in request.node.name else 160):
        yield


@pytest.mark.parametrize("name", STACKS)
def test_the_impedance_is_accurate_from_40_hz_to_110_mhz(name: str) -> None:
    """Rounding of the phase by itself costs |theta| Q 2^-53 near a resonance."""
    stack = STACKS[name]
    found = stack.impedance(FREQUENCIES)
    for f, Z in zip(FREQUENCIES, found, strict=True):
        exact = reference(stack, f, exactly(stack))
        assert abs(Z / complex(exact) - 1) < 5e-13, f"{f:g} Hz"


@pytest.mark.parametrize("name", STACKS)
def test_every_derivative_is_exact(name: str) -> None:
    """d ln Z / dp against a central difference in 400 digits, where its own error is some 1e-60."""
    stack, names = STACKS[name], list(STACKS[name].parameters())
    some = FREQUENCIES[::5]
    Z, J = stack.jacobian(some, names)
    assert np.array_equal(Z, stack.impedance(some))
    for k, f in enumerate(some):
        for p, parameter in enumerate(names):
            exact = complex(slope(stack, f, parameter))
            rounding = 1e-15 / abs(
                stack.parameters()[parameter] or 1
            )  # error of d ln Z / d ln p: density contributes only 1e-11 at 40 Hz
            assert abs(J[p, k] - exact) <= 1e-8 * abs(exact) + rounding, f"{parameter} at {f:g} Hz"


def random_stack(seed: int) -> Stack:
    """Any kinds of layers in any order, at least one of them piezoelectric."""
    rng = np.random.default_rng(seed)
    laws = [CONSTANT, CausalConstantQ(2e6), PowerLoss(3e6, rng.uniform(-0.5, 1))]

    def layer(kind: str, name: str) -> Piezo | Elastic | Spring | Mass:
        if kind == "spring":
            return Spring(name, 10 ** rng.uniform(12, 16), rng.uniform(3, 100))
        if kind == "mass":
            return Mass(name, 10 ** rng.uniform(-3, 0))
        law = laws[rng.integers(3)]
        if kind == "elastic":
            z, c = 10 ** rng.uniform(5.5, 7.5), rng.uniform(1000, 6000)
            return Elastic(name, 10 ** rng.uniform(-6, -2.5), z, c, rng.uniform(4, 300), law)
        values = {
            key: complex(getattr(DISK, key)) * complex(rng.uniform(0.7, 1.3), 0.0) for key in ("c33D", "h33", "eps33S")
        }
        thickness, density = 10 ** rng.uniform(-4.5, -2.7), rng.uniform(5000, 9000)
        return Piezo(name, thickness, density, **values, polarity=rng.choice([1, -1]), c_law=law, eps_law=law)

    kinds = ["piezo", *rng.choice(["piezo", "elastic", "spring", "mass"], rng.integers(1, 6))]
    rng.shuffle(kinds)
    layers = tuple(layer(kind, f"layer{i}") for i, kind in enumerate(kinds))
    wiring = ("series", "parallel")[rng.integers(2)]
    return Stack(layers, HalfSpace("b", rng.uniform(0, 1e7)), WATER, 1e-4, wiring)


@pytest.mark.parametrize("seed", range(5))
def test_value_and_derivatives_of_a_random_stack(seed: int) -> None:
    stack = random_stack(seed)
    f = 10 ** np.random.default_rng(seed).uniform(5, 7.3)
    names = list(stack.parameters())
    Z, J = stack.jacobian(np.array([f]), names)
    assert abs(Z[0] / complex(reference(stack, f, exactly(stack))) - 1) < 1e-12
    exact = np.array([complex(slope(stack, f, name)) for name in names])
    assert np.max(np.abs(J[:, 0] - exact) / (np.abs(exact) + 1e-300)) < 1e-8


def slope(stack: Stack, f: float, parameter: str) -> mp.mpc:
    values = exactly(stack)
    middle = values[parameter]
    if mp.isinf(middle):
        return mp.mpc(0)
    h = (abs(middle) or mp.mpf(1)) * mp.mpf(10) ** -30
    up, down = (reference(stack, f, values | {parameter: middle + side}) for side in (h, -h))
    return (mp.log(up) - mp.log(down)) / (2 * h)
