"""The reduced disk: small dense matrices, one per term of H, valid for every ceramic and every size nearby."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from scipy.linalg import eigh

from ..base.arrays import Complexes, Reals
from ..base.errors import PzctlError
from .coat import face_forms
from .full import FullDisk, Shape
from .line_elements import Numbers
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
    face: Reals
    """`face_forms` of the displacement shapes, shape (3, nu, nu)."""

    @classmethod
    def of(cls, disk: FullDisk, u: Reals, p: Reals) -> Self:
        """Project the disk on displacements `u`, orthonormal by mass, and potentials `p`."""
        n, terms = disk.size, disk.matrices.terms
        inner = [term[:n, :n] for term in terms]
        kappa, turn = symmetric_modes(-(p.T @ (inner[EPS11] @ p)), -(p.T @ (inner[EPS33] @ p)))
        p = np.asarray(p @ turn)
        return cls(
            np.array([u.T @ (inner[k] @ u) for k in ELASTIC.tolist()]),
            np.array([u.T @ (inner[k] @ p) for k in PIEZO.tolist()]),
            np.array([u.T @ terms[k][:n, [n]].toarray().ravel() for k in PIEZO.tolist()]),
            p.T @ terms[EPS33][:n, [n]].toarray().ravel(),
            np.asarray(kappa),
            u,
            p,
            face_forms(disk.face, u),
        )

    def arrays(self) -> dict[str, Reals]:
        """Return all arrays by name, for storage."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Reals]) -> Self:
        """Return the reduced disk of stored `arrays`."""
        return cls(**{field.name: arrays[field.name] for field in fields(cls)})

    def permittivity(self, weights: Numbers) -> Numbers:
        """Return the diagonal of the permittivity matrix for weights of TERMS, shape (..., 13), shape (..., np)."""
        return weights[..., EPS11, None] * self.kappa + weights[..., EPS33, None]

    def condensed(self, weights: Numbers) -> Numbers:
        """Return the stiffness with the potential eliminated, over J/m2-like units of the mass matrix, (nu, nu)."""
        stiffness = np.tensordot(weights[ELASTIC], self.stiffness, 1)
        coupling = np.tensordot(weights[PIEZO], self.coupling, 1)
        return stiffness + (coupling / self.permittivity(weights)) @ coupling.T

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


def symmetric_modes(a: Reals, b: Reals) -> tuple[Reals, Reals]:
    """Return the eigenvalues, rising, and vectors of the real symmetric pencil a - lambda b, orthonormal by b."""
    made: Any = eigh(a, b)
    return made
