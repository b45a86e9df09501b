"""One frequency band of a reduced disk with given constants: poles and residues, and the effect of dispersion.

Three steps, each exact up to higher orders:
1. The lossless disk's own modes near the band, each corrected to first order for the losses' coupling to modes outside,
   and static shapes for the force on the modes outside: a complex basis W of some fifty shapes. The model is projected
   on it as a stationary form, so the part missing in W enters the capacitance as its square.
2. At the middle of the band the projected pencil is solved for its poles and residues.
3. Causal constants change with frequency by 1 % or so. In the basis of step 2 this change is nearly diagonal: the
   diagonal is exact, the rest follows by iteration (a Neumann series). If it does not converge each frequency is
   solved.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.linalg import orth

from ..base.arrays import Complexes, Frequencies, Reals
from .coat import FaceTraces, FaceWeights, face_forms
from .full import Shape
from .line_elements import Numbers, real_times
from .reduced import ELASTIC, EPS11, EPS33, PIEZO, DiskError, ReducedDisk, symmetric_modes

_BELOW, _ABOVE = 0.9, 1.1
# Modes from 0.8 times the lowest to 1.2 times the highest frequency are included explicitly.
_STATIC = 6
# Number of static shapes at each end of the band and at its middle.
_STATIC_LOADS = 2
# The same for each load of a face: derivatives by the constants are then right to 2e-5 of the largest.
_DEPENDENT = 1e-8
# Static shapes that add less than this are dropped as linearly dependent.
_NODES = np.array([-0.8660254037844386, 0.0, 0.8660254037844386])
_TOLERANCE, _ROUNDS = 1e-4, 25
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class BandModes:
    """The modes of the reduced disk for the real parts of constants at one frequency, and its losses between them."""

    squared: Reals
    """(2 pi f)^2 of the modes, shape (nu,), rising."""
    shapes: Reals
    """Modes as columns over the displacement shapes of the reduced disk, shape (nu, nu)."""
    losses: Reals | None
    """Imaginary stiffness between modes over mass, to first order in the losses, shape (nu, nu); or none."""
    force: Complexes
    """Force on each mode over mass, shape (nu,)."""
    weights: Complexes
    """Weights of TERMS that the modes belong to, shape (13,)."""


def modes_of(
    disk: ReducedDisk, shape: Shape, weights: Complexes, rough: bool, faces: FaceWeights | None = None
) -> BandModes:
    """Return the modes of the disk for weights of TERMS, shape (13,); `rough`: without the losses between them.

    `faces`: what is on them at the same frequency alone. Raises DiskError for losses that are not finite.
    """
    stiffness, on_faces = disk.condensed(weights.real), np.zeros((), np.complex128)
    if faces is not None:
        real, imag = (
            np.tensordot(part, disk.on_face, 1) for part in (faces.stiffness[0].real, faces.stiffness[0].imag)
        )
        on_faces = real + 1j * imag
        if faces.is_dead:
            charge = disk.charge_of(weights)
            on_faces = on_faces + (charge.T * faces.series[0]) @ charge
    of_all = (stiffness + on_faces.real) / shape.mass
    if faces is None:
        squared, shapes = np.linalg.eigh(of_all)
    else:
        heavier = np.tensordot(faces.inertia, disk.on_face, 1) / shape.mass
        squared, shapes = symmetric_modes(of_all, np.eye(len(of_all)) + heavier)
    losses = None
    if not rough:
        lossy = disk.losses(weights) + on_faces.imag
        losses = shapes.T @ (lossy / shape.mass) @ shapes
    if losses is not None and not np.all(np.isfinite(losses)):
        raise DiskError("the losses of these constants are not finite: they are those of no disk")
    force: Complexes = disk.force(weights)
    return BandModes(squared, shapes, losses, shapes.T @ force / shape.mass, weights)


def band_shapes(modes: BandModes, low: float, high: float, weights: Complexes, loads: Reals | None = None) -> Numbers:
    """Return the basis W for frequencies from `low` to `high` in Hz, over the shapes of the reduced disk.

    `weights`: of TERMS amid the band, shape (13,). `loads`: other forces whose response it has, over the shapes of the
    reduced disk and the weight of the mass matrix, shape (nu, K). Real for rough modes.
    """
    bottom, top = (2 * np.pi * low) ** 2, (2 * np.pi * high) ** 2
    ends = np.searchsorted(modes.squared, [_BELOW**2 * bottom, _ABOVE**2 * top])
    inside = slice(int(ends[0]), int(ends[1]))
    own: Numbers = modes.squared
    force: Numbers = modes.force.real
    turn, diagonal = 0j, np.zeros(modes.squared.size)
    if modes.losses is not None:
        turn, diagonal = 1j + _dispersed(modes.weights, weights), np.diag(modes.losses)
        own, force = modes.squared + turn * diagonal, modes.force

    def answer(force: Numbers, squared: Reals) -> Numbers:
        """Return the response of the modes outside, by two Jacobi steps: losses couple them by a hundredth."""
        inverse = 1 / (own[:, None] - squared)
        inverse[inside] = 0.0
        first = force * inverse
        if modes.losses is None:
            return first
        return first - turn * (real_times(modes.losses, first) - diagonal[:, None] * first) * inverse

    static: list[Numbers] = []
    places = np.array([bottom, (bottom + top) / 2, top])

    def answered(forces: Numbers, times: int) -> None:
        column, squared = np.repeat(forces, places.size, axis=1), np.tile(places, forces.shape[1])
        for _ in range(times):
            column = answer(column, squared)
            column = column / np.maximum(np.linalg.norm(column, axis=0), _TINY)
            static.append(column)

    if np.any(force):  # no voltage drives antisymmetric motion
        answered(force[:, None], _STATIC)
    if loads is not None:
        answered(modes.shapes.T @ loads, _STATIC_LOADS)
    still = orth(np.hstack(static), _DEPENDENT)
    near = modes.squared[inside]
    coordinates = np.zeros((own.size, near.size + still.shape[1]), still.dtype)
    if modes.losses is not None:
        coordinates[:, : near.size] = -answer(turn * modes.losses[:, inside], np.clip(near, bottom, top))
    coordinates[inside, : near.size] = np.eye(near.size)
    coordinates[:, near.size :] = still
    return real_times(modes.shapes, coordinates)


def _dispersed(there: Complexes, here: Complexes) -> float:
    """Return the change of constants from `there`, in units of their imaginary parts.

    The real part of a causal constant rises by 2/pi of its imaginary part over a unit of ln f (Kramers and Kronig).
    """
    size = np.abs(there)
    imaginary, moved = there.imag / size, (here - there).real / size
    norm = float(imaginary @ imaginary)
    return float(imaginary @ moved) / norm if norm > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Band:
    """A reduced disk projected once more, for one set of constants and one band."""

    frequency: Frequencies
    weights: Complexes
    """Weights of TERMS at each frequency, shape (N, 13)."""
    stiffness: Numbers
    """Shape (7, m, m)."""
    coupling: Numbers
    """Shape (4, m, np)."""
    drive: Numbers
    """Shape (4, m)."""
    mass: Numbers
    """Shape (m, m)."""
    faces: FaceWeights | None
    """What is on the faces."""
    shapes: Numbers
    """Shape (nu, m)."""
    disk: ReducedDisk

    @classmethod
    def of(
        cls,
        disk: ReducedDisk,
        shapes: Numbers,
        shape: Shape,
        frequency: Frequencies,
        weights: Complexes,
        faces: FaceWeights | None = None,
    ) -> "Band":
        """Project the disk on `shapes`; weights of TERMS at each frequency, shape (N, 13)."""
        return cls(
            frequency,
            weights,
            np.array([shapes.T @ real_times(K, shapes) for K in disk.stiffness]),
            np.array([real_times(G.T, shapes).T for G in disk.coupling]),
            disk.drive @ shapes,
            shape.mass * (shapes.T @ shapes),
            faces,
            shapes,
            disk,
        )

    def solve(self) -> tuple[Complexes, Complexes]:
        """Return the displacement for one volt, shape (N, m), and the form in J/V2, shape (N,).

        u H u + 2 u b, and what the potential beyond the electrodes adds where there is no displacement.
        """
        y, form, _ = self.solve_with(np.zeros((self.mass.shape[0], 0)))
        return y, form

    def solve_with(self, loads: Numbers) -> tuple[Complexes, Complexes, Complexes]:
        """Return the same, and the displacement by each of `loads`, over the shapes, (m, K): shape (K, N, m)."""
        at, nodes = self._at, self._node_weights
        force = self.weights[:, PIEZO] @ self.drive + at @ np.array([self._beyond(w) for w in nodes])
        if self._series is not None:
            volt = nodes[:, [EPS33]] * self.disk.volt_charge * (self._of_nodes @ self._series)
            force = force + at @ np.einsum("akm,ak->am", self.charges, volt)
        count = self.frequency.size
        every = np.concatenate([force, *(np.broadcast_to(-one, force.shape) for one in loads.T)])
        y, form = self.answer(every)
        return y[:count], form[:count] + self._still(), y[count:].reshape(loads.shape[1], count, y.shape[1])

    def answer(self, force: Numbers) -> tuple[Complexes, Complexes]:
        """Return the displacement y by the opposite of forces and y H y + 2 y force; shapes (k N, m) and (k N,).

        `force`: k times at each frequency, shape (k N, m).
        """
        squared, times = (2 * np.pi * self.frequency) ** 2, len(force) // self.frequency.size
        at, squared = np.tile(self._at, (times, 1)), np.tile(squared, times)
        made = None if self._poles is None else self._poles.answer(at, force, squared)
        return made or _by_each(*self._system, at, force, squared)

    @cached_property
    def _poles(self) -> "_Poles | None":
        return _Poles.of(*self._system) if len(self._system[0]) == _NODES.size else None

    @cached_property
    def _system(self) -> tuple[Complexes, Numbers]:
        """Stiffness at each node, shape (3, m, m), and mass, with all that is on the faces."""
        matrices, mass = np.array([self._condensed(w) for w in self._node_weights]), self.mass
        if self.faces is not None:
            matrices = matrices + np.tensordot(self._of_nodes @ self.faces.stiffness, self.on_face, 1)
            mass = mass + np.tensordot(self.faces.inertia, self.on_face, 1)
        if self._series is not None:
            series = (self._of_nodes @ self._series)[:, None]
            matrices = matrices + (self.charges.transpose(0, 2, 1) * series) @ self.charges
        return matrices, mass

    @property
    def _at(self) -> Reals:
        """Weight of each node at each frequency, shape (N, 3)."""
        return self._nodes[0]

    @property
    def _of_nodes(self) -> Reals:
        """Weight of each frequency at each node, shape (3, N)."""
        return self._nodes[1]

    @property
    def _node_weights(self) -> Complexes:
        """Weights of TERMS at each node, shape (3, 13)."""
        return self._of_nodes @ self.weights

    @cached_property
    def _nodes(self) -> tuple[Reals, Reals]:
        """`_at` and `_of_nodes`.

        Constants are smooth over an octave, so the parabola through all of them serves. One or two frequencies are
        their own nodes.
        """
        if self.frequency.size < _NODES.size:
            return np.eye(self.frequency.size), np.eye(self.frequency.size)
        log_f: Reals = np.log(self.frequency)
        low, high = float(log_f[0]), float(log_f[-1])
        at = _lagrange((log_f - (low + high) / 2) * (2 / (high - low)))
        return at, np.asarray(np.linalg.pinv(at), np.float64)

    def _beyond(self, weights: Complexes) -> Complexes:
        """Return the force of the potential beyond the electrodes, shape (m,)."""
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        return coupling @ (weights[EPS33] * self.disk.lift / self.disk.permittivity(weights))

    def _still(self) -> Complexes:
        charge = self.weights[:, [EPS33]] * self.disk.lift
        still = np.einsum("np,np->n", charge, charge / self.disk.permittivity(self.weights))
        if self._series is None:
            return still
        return still + self.weights[:, EPS33] ** 2 * (self._series @ self.disk.volt_charge**2)

    def _condensed(self, weights: Complexes) -> Complexes:
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        stiffness = np.tensordot(weights[ELASTIC], self.stiffness, 1)
        return stiffness + (coupling / self.disk.permittivity(weights)) @ coupling.T

    @property
    def _series(self) -> Complexes | None:
        """`FaceWeights.series`; None without dead layer."""
        return self.faces.series if self.faces is not None and self.faces.is_dead else None

    @cached_property
    def traces(self) -> FaceTraces:
        """Motion of the face of each shape."""
        return self.disk.traces.mixed(self.shapes)

    @cached_property
    def on_face(self) -> Numbers:
        """`face_forms` of the shapes, shape (11, m, m)."""
        return face_forms(self.traces, self.traces)

    @cached_property
    def _charge(self) -> Numbers:
        """Charge of the shapes on the electrode for each of the piezoelectric terms, shape (4, K, m)."""
        return np.array([real_times(one, self.shapes) for one in self.disk.charge])

    @cached_property
    def charges(self) -> Complexes:
        """Charge of the shapes on the electrode with the potential eliminated, at each node, shape (3, K, m)."""
        made = list[Complexes]()
        for weights in self._node_weights:
            coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
            spread = np.tensordot(weights[EPS11:], self.disk.spread, 1)
            by_potential = spread @ (coupling / self.disk.permittivity(weights)).T
            made.append(np.asarray(np.tensordot(weights[PIEZO], self._charge, 1) + by_potential, np.complex128))
        return np.array(made)

    def charge(self, y: Complexes) -> Complexes:
        """Return the charge on the functions along the electrode of a motion and one volt, shape (N, K)."""
        by_motion = sum(self._at[:, [a]] * (y @ one.T) for a, one in enumerate(self.charges))
        return by_motion + self.weights[:, [EPS33]] * self.disk.volt_charge

    def pulled(self, across: Complexes) -> Complexes:
        """Return the force of potentials along the electrode, over its functions, (N, K): shape (N, m)."""
        made = np.zeros((across.shape[0], self.mass.shape[0]), np.complex128)
        for at, one in zip(self._at.T, self.charges, strict=True):
            made += at[:, None] * (across @ one)
        return made

    def slopes(self, y: Complexes, across: Complexes | None = None) -> tuple[Complexes, Complexes]:
        """Return d(X H X)/d weight of each of TERMS, shape (N, 13), and by that of the disk's mass, (N,); volt apart.

        X is the stationary solution, so its own change does not count: each is X (term) X. `across`: potential across a
        dead layer, over the functions along the electrode, (N, K); its charge has each term as a part, too.
        """
        made = np.zeros((y.shape[0], self.weights.shape[1]), np.complex128)
        for k, K in zip(ELASTIC.tolist(), self.stiffness, strict=True):
            made[:, k] = np.einsum("ni,ni->n", y, y @ K)
        fields = [y @ G for G in self.coupling]
        charge = sum(self.weights[:, [k]] * field for k, field in zip(PIEZO.tolist(), fields, strict=True))
        potential = charge + self.weights[:, [EPS33]] * self.disk.lift
        spread: Complexes | None = None if across is None else across @ self.disk.spread
        if spread is not None:
            potential = potential + self.weights[:, [EPS11]] * spread[0] + self.weights[:, [EPS33]] * spread[1]
        potential = potential / self.disk.permittivity(self.weights)
        for k, field, b in zip(PIEZO.tolist(), fields, self.drive, strict=True):
            made[:, k] = 2 * (np.einsum("ni,ni->n", field, potential) + y @ b)
        made[:, EPS11] = -np.einsum("ni,i,ni->n", potential, self.disk.kappa, potential)
        made[:, EPS33] = np.einsum("ni,ni->n", potential, 2 * self.disk.lift - potential)
        if across is not None and spread is not None:
            for k, own in zip(PIEZO.tolist(), self._charge, strict=True):
                made[:, k] += 2 * np.einsum("nk,nk->n", across, y @ own.T)
            made[:, EPS11] += 2 * np.einsum("np,np->n", spread[0], potential)
            made[:, EPS33] += 2 * (np.einsum("np,np->n", spread[1], potential) + across @ self.disk.volt_charge)
        return made, np.einsum("ni,ni->n", y, y @ self.mass)


def _lagrange(x: Reals) -> Reals:
    """Return the three Lagrange polynomials on _NODES at x, shape (N, 3)."""
    made = np.ones((x.size, 3))
    for k in range(3):
        for i in range(3):
            if i != k:
                made[:, k] *= (x - _NODES[i]) / (_NODES[k] - _NODES[i])
    return made


@dataclass(frozen=True, eq=False)
class _Poles:
    """Poles of a projected disk amid its band, and what changes between them over the band."""

    shapes: Complexes
    """As columns over the shapes of the band, orthonormal by mass, shape (m, m)."""
    diagonal: Complexes
    """Stiffness of each pole at each node, shape (3, m)."""
    coupled: Complexes
    """Stiffness between poles at the lowest and at the highest node, without `diagonal`, shape (2, m, m)."""

    @classmethod
    def of(cls, matrices: Complexes, mass: Numbers) -> Self | None:
        """Return the poles for the stiffness at each node, shape (3, m, m); None where they nearly coincide."""
        pencil = np.asarray(np.linalg.solve(mass.astype(np.complex128), matrices[1]), np.complex128)
        poles, vectors = np.linalg.eig(pencil)
        norm = np.einsum("ik,ik->k", vectors, mass @ vectors)
        if np.any(np.abs(norm) < 1e-6 * np.abs(norm).max()):
            return None
        X = vectors / np.sqrt(norm)
        moved = np.array([X.T @ M @ X for M in matrices])
        diagonal = np.einsum("mii->mi", moved).copy()
        if np.abs(moved[1] - np.diag(diagonal[1])).max() > 1e-6 * np.abs(poles).max():
            return None
        for one in moved:
            np.fill_diagonal(one, 0.0)
        return cls(X, diagonal, moved[::2])

    def answer(self, at: Reals, force: Complexes, squared: Reals) -> tuple[Complexes, Complexes] | None:
        """Return y = -(A(f) - squared mass)^-1 force, shape (N, m), and y (A - squared mass) y + 2 y force, (N,).

        `at`: weight of each node, shape (N, 3). None where what couples the poles is too large for an iteration.
        """
        own = at @ self.diagonal - squared[:, None]
        drive = -(force @ self.shapes)
        y = drive / own
        for _ in range(_ROUNDS):
            coupled = at[:, [0]] * (y @ self.coupled[0]) + at[:, [2]] * (y @ self.coupled[1])
            after = (drive - coupled) / own
            change = np.abs(after - y).max(axis=1) / np.maximum(np.abs(after).max(axis=1), _TINY)
            if change.max() < _TOLERANCE:
                # stationary: of this y the form is right to the square of the change
                return after @ self.shapes.T, np.einsum("ni,ni->n", y, own * y + coupled - 2 * drive)
            y = after
        return None


def _by_each(
    matrices: Complexes, mass: Complexes, at: Reals, force: Complexes, squared: Reals
) -> tuple[Complexes, Complexes]:
    """Return the same by solving each frequency separately."""
    made: list[Complexes] = [
        -np.linalg.solve(np.tensordot(a, matrices, 1) - s * mass, f)
        for a, s, f in zip(at, squared.tolist(), force, strict=True)
    ]
    y = np.array(made)
    return y, np.einsum("ni,ni->n", y, force)
