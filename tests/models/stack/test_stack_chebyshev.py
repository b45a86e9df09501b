"""The stack compared with a direct solution of its differential equations without closed forms.

In every layer (c33 u')' = -w^2 rho u is collocated at Chebyshev points; stress T = c33D u' - h33 D and displacement
are continuous at the interfaces, T = -/+ jw Z u at the loads, E = -h33 u' + D/eps33S gives the voltage.
"""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg

from pzctl.models.stack import Elastic, HalfSpace, Mass, Piezo, Spring, Stack

POINTS = 40


def chebyshev(n: int) -> np.ndarray:
    """Differentiation at the Chebyshev points of [0, 1] (Trefethen, Spectral Methods in MATLAB, cheb.m)."""
    x = np.cos(np.longdouble(np.pi) * np.arange(n + 1) / n)
    c = np.hstack([2, np.ones(n - 1, np.longdouble), 2]) * (-1) ** np.arange(n + 1)
    dx = x[:, None] - x[None, :] + np.eye(n + 1)
    D = np.outer(c, 1 / c) / dx
    D -= np.diag(D.sum(axis=1))
    return -2 * D


class Collocation:
    """One stack at one frequency; the unknowns are u at all points, every D, u of the back face, and the voltage."""

    def __init__(self, stack: Stack, f: float) -> None:
        self.stack, self.w, self.n = stack, 2 * np.pi * f, POINTS + 1
        self.derive = chebyshev(POINTS)
        self.bodies = [layer for layer in stack.layers if isinstance(layer, Piezo | Elastic)]
        self.piezos = [layer for layer in self.bodies if isinstance(layer, Piezo)]
        self.size = self.n * len(self.bodies) + len(self.piezos) + 2

    def row(self) -> np.ndarray:
        return np.zeros(self.size, np.clongdouble)

    def displacement(self, k: int, point: int) -> np.ndarray:
        row = self.row()
        row[self.n * k + point] = 1
        return row

    def charge(self, layer: Piezo) -> np.ndarray:
        row = self.row()
        row[self.n * len(self.bodies) + self.piezos.index(layer)] = 1
        return row

    def stress(self, k: int, point: int) -> np.ndarray:
        layer, row = self.bodies[k], self.row()
        row[self.n * k : self.n * (k + 1)] = stiffness(layer) * self.derive[point] / layer.thickness
        if isinstance(layer, Piezo):
            row -= layer.polarity * layer.h33 * CHARGE * self.charge(layer)
        return row

    def inside(self) -> list[np.ndarray]:
        """(c33 u')' + w^2 rho u = 0 at the inner points of every layer."""
        rows: list[np.ndarray] = []
        for k, layer in enumerate(self.bodies):
            ratio = stiffness(layer) / layer.density / (self.w * layer.thickness) ** 2
            bulk = ratio * self.derive @ self.derive + np.eye(self.n)
            for point in range(1, self.n - 1):
                row = self.row()
                row[self.n * k : self.n * (k + 1)] = bulk[point]
                rows.append(row)
        return rows

    def joints(self) -> list[np.ndarray]:
        """Walk from load to load with displacement and stress, through springs and masses."""
        rows: list[np.ndarray] = []
        u, k = self.row(), 0
        u[-2] = 1
        T = 1j * self.w * self.stack.back.z * u
        for layer in self.stack.layers:
            if isinstance(layer, Mass):
                T = T - self.w**2 * layer.mass * u
            elif isinstance(layer, Spring):
                u = u + T / (layer.stiffness * (1 + 1j / layer.q))
            else:
                rows += [(T - self.stress(k, 0)) / 1e15, u - self.displacement(k, 0)]
                u, T = self.displacement(k, self.n - 1), self.stress(k, self.n - 1)
                k += 1
        return [*rows, (T + 1j * self.w * self.stack.front.z * u) / 1e15]

    def voltage(self, layer: Piezo) -> np.ndarray:
        k = self.bodies.index(layer)
        gap = self.displacement(k, self.n - 1) - self.displacement(k, 0)
        return layer.thickness / layer.eps33S * CHARGE * self.charge(layer) - layer.polarity * layer.h33 * gap

    def wiring(self) -> tuple[list[np.ndarray], list[float]]:
        """One current through all layers and the sum of voltages, or one voltage and the sum of currents."""
        terminal = self.row()
        terminal[-1] = 1
        voltages, charges = map(self.voltage, self.piezos), map(self.charge, self.piezos)
        if self.stack.connection == "parallel":
            return [*((V - terminal) / 1e9 for V in voltages), sum(charges)], [0.0] * len(self.piezos) + [1.0]
        return [*charges, (sum(voltages) - terminal) / 1e9], [1.0] * len(self.piezos) + [0.0]

    def Z(self) -> complex:
        wires, ends = self.wiring()
        still = [*self.inside(), *self.joints()]
        voltage = refined(np.array([*still, *wires]), np.array([0.0] * len(still) + ends))[-1]
        return complex(voltage / (1j * self.w * CHARGE * self.stack.area))


def stiffness(layer: Piezo | Elastic) -> complex:
    return layer.c33D if isinstance(layer, Piezo) else layer.c33


def refined(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve with residuals in long double; otherwise the second derivative costs the collocation five digits."""
    scale = np.abs(matrix).max(axis=0)
    factors = linalg.lu_factor((matrix / scale).astype(complex))
    x = np.zeros(right.size, np.clongdouble)
    for _ in range(4):
        x = x + linalg.lu_solve(factors, (right - matrix / scale @ x).astype(complex))
    return x / scale


CHARGE = 1e-3
"""C/m2: the unit of D in the unknowns, so that all have similar size."""


def around(value: float, spread: float = 0.3) -> st.SearchStrategy[float]:
    return st.floats(value * (1 - spread), value * (1 + spread))


@st.composite
def piezos(draw: st.DrawFn, name: str) -> Piezo:
    return Piezo(
        name,
        thickness=draw(around(0.4e-3)),
        density=draw(around(7700)),
        c33D=draw(around(1.4e11)) * (1 + 1j * draw(st.floats(0.003, 0.05))),
        h33=draw(around(1.8e9)) * (1 + 1j * draw(st.floats(-0.01, 0.01))),
        eps33S=draw(around(8e-9)) * (1 - 1j * draw(st.floats(0.001, 0.04))),
        polarity=draw(st.sampled_from([1, -1])),
    )


@st.composite
def elastics(draw: st.DrawFn, name: str) -> Elastic:
    thickness = draw(st.sampled_from([2e-6, 20e-6, 150e-6, 600e-6]))
    return Elastic(name, thickness, draw(around(5e6, 0.8)), draw(around(2500)), draw(st.floats(5, 200)))


@st.composite
def stacks(draw: st.DrawFn) -> Stack:
    kinds = draw(st.lists(st.sampled_from("pesm"), min_size=0, max_size=4))
    kinds.insert(draw(st.integers(0, len(kinds))), "p")
    made = {
        "p": piezos,
        "e": elastics,
        "s": lambda name: st.builds(Spring, st.just(name), around(3e14), st.floats(5, 100)),
        "m": lambda name: st.builds(Mass, st.just(name), around(0.03)),
    }
    layers = tuple(draw(made[kind](f"{kind}{i}")) for i, kind in enumerate(kinds))
    loads = (HalfSpace("load", draw(st.sampled_from([0.0, 413.0, 1.5e6, 2e7]))) for _ in range(2))
    return Stack(layers, *loads, 1e-4, draw(st.sampled_from(["series", "parallel"])))


@settings(max_examples=20, deadline=None)
@given(stacks(), st.floats(0.2e6, 12e6))
def test_random_stacks_solve_their_differential_equations(stack: Stack, f: float) -> None:
    found, expected = stack.impedance(np.array([f]))[0], Collocation(stack, f).Z()
    assert abs(found / expected - 1) < 1e-9
