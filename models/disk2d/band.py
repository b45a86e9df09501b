"""One band of frequencies of a reduced disk with given constants: poles and residues, and what dispersion adds.

Three steps, each exact but for what the next orders would add:
1. The lossless disk's own modes near the band, each turned by the losses' first order into the modes outside, and
   static shapes for the force on the modes outside: a complex basis W of some fifty shapes. The model is projected
   on it as a stationary form, so what W misses enters the capacitance as its square.
2. At the middle of the band the projected pencil is solved for its poles and residues.
3. Causal constants move with frequency by 1 % or so. In the basis of step 2 that is nearly diagonal: the diagonal is
   taken exactly, the rest by iteration (a Neumann series). Where it does not converge each frequency is solved.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Complexes, Frequencies, Reals
from .full import Shape
from .reduced import ELASTIC, EPS11, EPS33, PIEZO, ReducedDisk

_BELOW, _ABOVE, _FAR = 0.5, 1.5, 3.0
# Modes that are taken as they are reach from 0.5 times the lowest to 1.5 times the highest frequency, or 3 times.
_STATIC = 6
_NODES = np.array([-0.8660254037844386, 0.0, 0.8660254037844386])
_TOLERANCE, _ROUNDS = 1e-6, 25


@dataclass(frozen=True, eq=False)
class Modes:
    """The modes of the reduced disk for the real parts of constants at one frequency, and its losses between them."""

    squared: Reals
    """(2 pi f)^2 of the modes, shape (nu,), rising."""
    shapes: Reals
    """Columns over the displacement shapes of the reduced disk, shape (nu, nu)."""
    losses: Complexes
    """Stiffness of the lossy disk less that of the lossless one, between modes, over mass, shape (nu, nu)."""
    force: Complexes
    """Force on each mode over mass, shape (nu,)."""


def modes_of(disk: ReducedDisk, shape: Shape, weights: Complexes) -> Modes:
    """Return the modes of the disk for weights of TERMS, shape (13,)."""
    lossy = np.asarray(disk.condensed(weights) / shape.mass, np.complex128)
    squared, shapes = np.linalg.eigh(disk.condensed(weights.real) / shape.mass)
    losses = shapes.T @ times(lossy, shapes) - np.diag(squared)
    return Modes(squared, shapes, losses, shapes.T @ (weights[PIEZO] @ disk.drive) / shape.mass)


def times(left: Complexes, right: Reals) -> Complexes:
    """Return the product of a complex and a real matrix by real products alone."""
    return left.real @ right + 1j * (left.imag @ right)


def real_times(left: Reals, right: Complexes) -> Complexes:
    """Return the product of a real and a complex matrix by one real product; `right` is C-contiguous."""
    return (left @ np.ascontiguousarray(right).view(np.float64)).view(np.complex128)


def band_shapes(modes: Modes, low: float, high: float, highest: float) -> Complexes:
    """Return the basis W for frequencies from `low` to `high` in Hz, over the shapes of the reduced disk.

    `highest`: Hz, that of all bands. In the lower bands, where modes are few and constants have moved away from those
    of `modes`, it reaches further above.
    """
    bottom, top = (2 * np.pi * low) ** 2, (2 * np.pi * high) ** 2
    above = 2 * np.pi * min(_FAR * high, max(_ABOVE * high, _ABOVE * highest))
    inside = (modes.squared > _BELOW**2 * bottom) & (modes.squared < above**2)
    outside = ~inside
    near, far = modes.squared[inside], modes.squared[outside]
    turned = -modes.losses[np.ix_(outside, inside)] / (far[:, None] - np.clip(near, bottom, top)[None, :])
    middle = (bottom + top) / 2
    lossy = far + np.diag(modes.losses)[outside] - middle
    static = [modes.force[outside] / lossy]
    for _ in range(_STATIC - 1):
        static.append(static[-1] / lossy * (top - bottom + middle / 10))
    coordinates = np.zeros((near.size + far.size, near.size + _STATIC), np.complex128)
    coordinates[inside, : near.size] = np.eye(near.size)
    coordinates[outside, : near.size] = turned
    coordinates[outside, near.size :] = _orthonormal(np.array(static).T)
    return real_times(modes.shapes, coordinates)


def _orthonormal(columns: Complexes) -> Complexes:
    return np.linalg.qr(columns)[0].astype(np.complex128)


@dataclass(frozen=True, eq=False)
class Band:
    """A reduced disk projected once more, for one set of constants and one band."""

    frequency: Frequencies
    weights: Complexes
    """Of TERMS at each frequency, shape (N, 13)."""
    stiffness: Complexes
    """Shape (7, m, m)."""
    coupling: Complexes
    """Shape (4, m, np)."""
    drive: Complexes
    """Shape (4, m)."""
    mass: Complexes
    """Shape (m, m)."""
    disk: ReducedDisk

    @classmethod
    def of(
        cls, disk: ReducedDisk, shapes: Complexes, shape: Shape, frequency: Frequencies, weights: Complexes
    ) -> "Band":
        """Project the disk on `shapes`; weights of TERMS at each frequency, shape (N, 13)."""
        return cls(
            frequency,
            weights,
            np.array([shapes.T @ real_times(K, shapes) for K in disk.stiffness]),
            np.array([real_times(G.T, shapes).T for G in disk.coupling]),
            disk.drive @ shapes,
            shape.mass * (shapes.T @ shapes),
            disk,
        )

    def solve(self) -> tuple[Complexes, Complexes]:
        """Return the displacement for one volt, shape (N, m), and u H u + 2 u b in J/V2, shape (N,)."""
        force = self.weights[:, PIEZO] @ self.drive
        squared = (2 * np.pi * self.frequency) ** 2
        at, nodes = self._nodes()
        matrices = np.array([self._condensed(w) for w in nodes])
        y = _by_poles(matrices, self.mass, at, force, squared) if len(nodes) == _NODES.size else None
        if y is None:
            y = _by_each(matrices, self.mass, at, force, squared)
        whole = sum(at[:, [k]] * (y @ M) for k, M in enumerate(matrices)) - squared[:, None] * (y @ self.mass)
        return y, np.einsum("ni,ni->n", y, whole + 2 * force)

    def _nodes(self) -> tuple[Reals, Complexes]:
        """Return what each node counts for at each frequency, shape (N, 3), and the weights of TERMS there, (3, 13).

        Constants are smooth over an octave, so the parabola through all of them serves. One or two frequencies are
        their own nodes.
        """
        if self.frequency.size < _NODES.size:
            return np.eye(self.frequency.size), self.weights
        log_f: Reals = np.log(self.frequency)
        low, high = float(log_f[0]), float(log_f[-1])
        at = _lagrange((log_f - (low + high) / 2) * (2 / (high - low)))
        return at, np.linalg.pinv(at) @ self.weights

    def _condensed(self, weights: Complexes) -> Complexes:
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        stiffness = np.tensordot(weights[ELASTIC], self.stiffness, 1)
        return stiffness + (coupling / self.disk.permittivity(weights)) @ coupling.T

    def slopes(self, y: Complexes) -> tuple[Complexes, Complexes]:
        """Return d(X H X)/d weight of each of TERMS, shape (N, 13), and by the weight of mass, shape (N,); volt apart.

        X is the stationary solution, so its own change does not count: each is X (term) X.
        """
        made = np.zeros((y.shape[0], self.weights.shape[1]), np.complex128)
        for k, K in zip(ELASTIC.tolist(), self.stiffness, strict=True):
            made[:, k] = np.einsum("ni,ni->n", y, y @ K)
        fields = [y @ G for G in self.coupling]
        charge = sum(self.weights[:, [k]] * field for k, field in zip(PIEZO.tolist(), fields, strict=True))
        potential = charge / self.disk.permittivity(self.weights)
        for k, field, b in zip(PIEZO.tolist(), fields, self.drive, strict=True):
            made[:, k] = 2 * (np.einsum("ni,ni->n", field, potential) + y @ b)
        made[:, EPS11] = -np.einsum("ni,i,ni->n", potential, self.disk.kappa, potential)
        made[:, EPS33] = -np.einsum("ni,ni->n", potential, potential)
        return made, np.einsum("ni,ni->n", y, y @ self.mass)


def _lagrange(x: Reals) -> Reals:
    """Return the three Lagrange polynomials on _NODES at x, shape (N, 3)."""
    made = np.ones((x.size, 3))
    for k in range(3):
        for i in range(3):
            if i != k:
                made[:, k] *= (x - _NODES[i]) / (_NODES[k] - _NODES[i])
    return made


def _by_poles(matrices: Complexes, mass: Complexes, at: Reals, force: Complexes, squared: Reals) -> Complexes | None:
    """Return -(A(f) - squared mass)^-1 force, shape (N, m), by poles; None where that does not converge."""
    poles, vectors = np.linalg.eig(np.linalg.solve(mass, matrices[1]))
    norm = np.einsum("ik,ik->k", vectors, mass @ vectors)
    if np.any(np.abs(norm) < 1e-6 * np.abs(norm).max()):
        return None
    X = vectors / np.sqrt(norm)
    moved = np.array([X.T @ M @ X for M in matrices])
    diagonal = np.einsum("mii->mi", moved).copy()
    if np.abs(moved[1] - np.diag(diagonal[1])).max() > 1e-6 * np.abs(poles).max():
        return None
    own = 1 / (at @ diagonal - squared[:, None])
    for k in range(3):
        np.fill_diagonal(moved[k], 0.0)
    drive = -(force @ X)
    y = drive * own
    for _ in range(_ROUNDS):
        coupled = at[:, [0]] * (y @ moved[0]) + at[:, [2]] * (y @ moved[2])
        after = (drive - coupled) * own
        change = np.abs(after - y).max(axis=1) / np.abs(after).max(axis=1)
        y = after
        if change.max() < _TOLERANCE:
            return y @ X.T
    return None


def _by_each(matrices: Complexes, mass: Complexes, at: Reals, force: Complexes, squared: Reals) -> Complexes:
    """Return the same, each frequency solved by itself."""
    made: list[Complexes] = [
        np.linalg.solve(np.tensordot(a, matrices, 1) - s * mass, f)
        for a, s, f in zip(at, squared.tolist(), force, strict=True)
    ]
    return -np.array(made)
