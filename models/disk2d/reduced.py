"""The reduced disk: small dense matrices, one per term of H, valid for every ceramic and every size nearby."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.linalg import eigh

from ..base.arrays import Complexes, Reals
from ..base.errors import PzctlError
from .coat import FaceTraces, face_forms
from .footprint import traces
from .full import FullDisk, Shape
from .line_elements import LineElements, Numbers
from .matrices import TERMS

ELASTIC = np.array([k for k, term in enumerate(TERMS) if term.constant.startswith("c")])
"""Indices of the seven elastic TERMS."""
PIEZO = np.array([k for k, term in enumerate(TERMS) if term.constant.startswith("e") and term.constant[1] != "p"])
"""Indices of the four piezoelectric TERMS."""
EPS11, EPS33 = len(TERMS) - 2, len(TERMS) - 1


class DiskError(PzctlError):
    """A disk beyond the range of the two-dimensional model."""


@dataclass(frozen=True, eq=False)
class ReducedDisk:
    """Galerkin projection of a disk on nu displacement and np potential shapes.

    The mass matrix is the unit matrix; the permittivities are diagonal, that of eps33S the unit matrix.
    """

    stiffness: Reals
    """Of the elastic terms, shape (7, nu, nu)."""
    coupling: Reals
    """Of the piezoelectric terms, shape (4, nu, np)."""
    drive: Reals
    """Force of the uniform field, for the piezoelectric terms, shape (4, nu)."""
    lift: Reals
    """Charge of the uniform field on the potential shapes, for eps33S, shape (np,): only beyond the electrodes."""
    kappa: Reals
    """Diagonal of the matrix of eps11S, shape (np,)."""
    u: Reals
    """Displacement shapes over the unknowns of the mesh, shape (n, nu)."""
    p: Reals
    """Potential shapes over the unknowns of the mesh, shape (n, np)."""
    line: LineElements
    """Elements along the face."""
    electrode: float
    """Radius of the electrodes over that of the disk."""
    axial: Reals
    """u_z of the displacement shapes at the nodes of the face, shape (nodes, nu)."""
    radial: Reals
    """u_r, shape (nodes, nu)."""
    charge: Reals
    """Of the piezoelectric terms: charge of the displacement shapes on the electrode, on functions along it that are
    orthonormal over its area and waves of their own, shape (4, K, nu). K is 0 for an electrode on a part of the face.
    """
    spread: Reals
    """Of eps11S and eps33S: the same of the potential shapes, shape (2, K, np)."""
    volt_charge: Reals
    """Of eps33S: the same of one volt, shape (K,)."""
    waves: Reals
    """Squared wavenumber of those functions times the squared radius, shape (K,)."""

    @classmethod
    def of(cls, disk: FullDisk, u: Reals, p: Reals) -> Self:
        """Project the disk on displacements `u`, orthonormal by mass, and potentials `p`."""
        n, terms = disk.size, disk.matrices.terms
        inner = [term[:n, :n] for term in terms]
        kappa, turn = symmetric_modes(-(p.T @ (inner[EPS11] @ p)), -(p.T @ (inner[EPS33] @ p)))
        p = np.asarray(p @ turn)
        axial, radial = traces(disk.face, u)
        charges, waves = _on_electrode(disk)
        return cls(
            np.array([u.T @ (inner[k] @ u) for k in ELASTIC.tolist()]),
            np.array([u.T @ (inner[k] @ p) for k in PIEZO.tolist()]),
            np.array([u.T @ terms[k][:n, [n]].toarray().ravel() for k in PIEZO.tolist()]),
            p.T @ terms[EPS33][:n, [n]].toarray().ravel(),
            np.asarray(kappa),
            u,
            p,
            disk.face.line,
            disk.face.electrode,
            axial,
            radial,
            np.array([one[:, :n] @ u for one in charges[: PIEZO.size]]),
            np.array([one[:, :n] @ p for one in charges[PIEZO.size :]]),
            charges[-1][:, n],
            waves,
        )

    @property
    def without_mesh(self) -> Self:
        """The same without its shapes over the mesh, which only an estimate of its error needs."""
        return replace(self, u=self.u[:0], p=self.p[:0])

    @cached_property
    def traces(self) -> FaceTraces:
        """Motion of the face of each displacement shape."""
        return FaceTraces.of(self.line, self.electrode, self.axial, self.radial)

    @cached_property
    def on_face(self) -> Reals:
        """`face_forms` of the displacement shapes, shape (11, nu, nu)."""
        return face_forms(self.traces, self.traces)

    def arrays(self) -> dict[str, Reals]:
        """Return all arrays by name, for storage."""
        made = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in ("line", "electrode")}
        numbers = np.array([float(self.line.order), self.electrode])
        return {**made, "line.breaks": self.line.breaks, "line.numbers": numbers}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Reals]) -> Self:
        """Return the reduced disk of stored `arrays`."""
        order, electrode = arrays["line.numbers"].tolist()
        own = {one.name: arrays[one.name] for one in fields(cls) if one.name not in ("line", "electrode")}
        return cls(**own, line=LineElements(arrays["line.breaks"], int(order)), electrode=electrode)

    def permittivity(self, weights: Numbers) -> Numbers:
        """Return the diagonal of the permittivity matrix for weights of TERMS, shape (..., 13), shape (..., np)."""
        return weights[..., EPS11, None] * self.kappa + weights[..., EPS33, None]

    def condensed(self, weights: Numbers) -> Numbers:
        """Return the stiffness with the potential eliminated, over J/m2-like units of the mass matrix, (nu, nu)."""
        stiffness = np.tensordot(weights[ELASTIC], self.stiffness, 1)
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        return stiffness + (coupling / self.permittivity(weights)) @ coupling.T

    def charge_of(self, weights: Numbers) -> Numbers:
        """Return the charge of the displacement shapes with the potential eliminated, shape (K, nu)."""
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        spread = np.tensordot(weights[EPS11:], self.spread, 1)
        return np.tensordot(weights[PIEZO], self.charge, 1) + spread @ (coupling / self.permittivity(weights)).T

    def losses(self, weights: Complexes) -> Reals:
        """Return the imaginary part of `condensed` to first order in the imaginary parts of the weights, (nu, nu)."""
        coupling, lossy = (np.tensordot(part, self.coupling, 1) for part in (weights[PIEZO].real, weights[PIEZO].imag))
        still, moved = self.permittivity(weights.real), self.permittivity(weights.imag)
        half = (coupling / still) @ (lossy - coupling * (moved / (2 * still))).T
        return np.tensordot(weights[ELASTIC].imag, self.stiffness, 1) + half + half.T

    def force(self, weights: Numbers) -> Numbers:
        """Return the force of one volt with the potential eliminated, shape (nu,)."""
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        return weights[PIEZO] @ self.drive + coupling @ (weights[EPS33] * self.lift / self.permittivity(weights))

    def solution(self, shape: Shape, weights: Complexes, frequency: float) -> Complexes:
        """Return the same as `FullDisk.solution`, from the reduced disk, shape (n + 1,)."""
        squared = (2 * np.pi * frequency) ** 2 * shape.mass
        force = self.force(weights)
        y = -np.linalg.solve(self.condensed(weights) - squared * np.eye(force.size), force)
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        charge = coupling.T @ y + weights[EPS33] * self.lift
        return np.concatenate([self.u @ y + self.p @ (charge / self.permittivity(weights)), [1.0]])


def _on_electrode(disk: FullDisk) -> tuple[list[Numbers], Reals]:
    """Return the `charges` of a mesh on functions along the electrode, shape (K, n + 1) each, and their `waves`."""
    face, charges = disk.face, disk.matrices.charges
    if face.electrode < 1:
        return [np.zeros((0, disk.size + 1)) for _ in charges], np.zeros(0)
    bent, area = (face.line.integral(order, order, lambda x: x).toarray() for order in (1, 0))
    waves, functions = symmetric_modes(bent, area)
    return [functions.T @ one.toarray() for one in charges], np.maximum(waves, 0.0)


def symmetric_modes(a: Reals, b: Reals) -> tuple[Reals, Reals]:
    """Return the eigenvalues, rising, and vectors of the real symmetric pencil a - lambda b, orthonormal by b."""
    made: Any = eigh(a, b)
    return made
