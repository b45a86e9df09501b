"""The disk solved on its whole mesh, one frequency at a time: the origin and reference of reduced models."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from math import ceil
from operator import add
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ..base.arrays import Complexes, Frequencies, Reals
from .line_elements import LineElements, Matrix, Numbers, real_times
from .matrices import CONSTANTS, OF_TERM, POWERS, Face, Matrices, assemble

_ORDER_R, _ORDER_Z = 7, 8
_SIZES = {"c": 1e11, "e": 30.0, "eps": 9e-9}
_SCALE = np.array([_SIZES["eps" if name.startswith("eps") else name[0]] for name in CONSTANTS])
_GRADED, _SHORT = (0.1, 0.01), (6, 6)
# Ends of elements beside an electrode's edge in usual lengths, and orders along r and z: the field is singular there.
_LAYER = 1e10
# Pa, of the constants of a bonded layer.


@dataclass(frozen=True)
class Shape:
    """Sizes and density of a round disk."""

    radius: float
    """m."""
    thickness: float
    """m."""
    density: float
    """kg/m3."""

    def scaled(self, size: str, factor: float) -> "Shape":
        """Return the disk with one of its sizes multiplied by `factor`."""
        return replace(self, **{size: getattr(self, size) * factor})

    def weights(self, constants: Numbers) -> Numbers:
        """Return the weight of each of TERMS, shape (..., 13), for constants in SI units, shape (..., 10)."""
        return constants[..., self.of_term] * self.lengths

    @property
    def of_term(self) -> Numbers:
        """Index of each term's constant, shape (13,)."""
        return OF_TERM

    @property
    def lengths(self) -> Reals:
        """a^k b^(1 - k) of each of TERMS in m, shape (13,)."""
        return self.radius**POWERS * (self.thickness / 2) ** (1.0 - POWERS)

    @property
    def mass(self) -> float:
        """Weight of the mass matrix: density a^2 b, kg."""
        return self.density * self.radius**2 * self.thickness / 2


@dataclass(frozen=True, eq=False)
class FullDisk:
    """The mesh of a disk: quarter section, elements of order 7 along r, one of order 8 through half the thickness.

    An element along r is half a thickness long: to 1.5 times the thickness resonance the capacitance is then right to
    1e-6 of its value, for soft ceramics (`tests/benchmarks`).
    """

    matrices: Matrices

    @classmethod
    def of(
        cls, diameter_to_thickness: float, finer: int = 0, electrode: float = 1.0, antisymmetric: bool = False
    ) -> Self:
        """Return the mesh for this D/t; `finer` adds that many orders and elements per half thickness.

        `electrode`: radius of both electrodes over that of the disk; the mesh is graded towards their edge, so that it
        moves with it and its unknowns keep their meaning. `antisymmetric`: see `assemble`.
        """
        elements = max(1, ceil(diameter_to_thickness)) * (1 + finer)
        ends_r, ends_z = np.linspace(0.0, 1.0, elements + 1), np.array([0.0, 1.0])
        order_r, order_z = (_ORDER_R, _ORDER_Z) if electrode == 1 else _SHORT
        if electrode < 1:
            near = np.array(_GRADED)
            inner = np.append(ends_r[:-1], 1 - near / elements)
            ends_r = np.concatenate([np.sort(inner), [1.0]]) * electrode
            ends_r = np.concatenate([ends_r, electrode + (1 - electrode) * np.sort(np.append(2 * near, 1.0))])
            ends_z = np.sort(np.append(ends_z, 1 - near))
        along_r = LineElements(ends_r, order_r + finer)
        along_z = LineElements(ends_z, order_z + 2 * finer)
        return cls(assemble(along_r, along_z, electrode=electrode, antisymmetric=antisymmetric))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.matrices.size

    @property
    def face(self) -> Face:
        """The upper face. Raises ValueError for a section that has none."""
        if self.matrices.face is None:
            raise ValueError("this section has no face")
        return self.matrices.face

    @cached_property
    def scale(self) -> Reals:
        """Scale of each unknown, shape (n,): its static stiffness for a typical ceramic on this mesh."""
        sizes = np.append(_SCALE[OF_TERM], np.full(len(self.matrices.terms) - OF_TERM.size, _LAYER))
        diagonal = sum(s * t.diagonal() for s, t in zip(sizes, self.matrices.terms, strict=True))
        return 1 / np.sqrt(np.abs(np.asarray(diagonal)[: self.size]))

    @cached_property
    def scaled_mass(self) -> Matrix:
        """Mass matrix of the unknowns, rows and columns scaled by `scale`, shape (n, n)."""
        n, scale = self.size, sp.diags_array(self.scale)
        return sp.csr_array(scale @ self.matrices.mass[:n, :n] @ scale)

    @cached_property
    def _stored(self) -> tuple[Numbers, Numbers, Reals]:
        """Column indices and row starts of the entries of all terms and the mass together, and each one's, (E, 14)."""
        n = self.size + 1
        parts: list[Matrix] = [sp.coo_array(term) for term in (*self.matrices.terms, self.matrices.mass)]
        pattern: Matrix = reduce(add, (sp.csr_array(abs(part)) for part in parts))
        pattern.sort_indices()
        every: Numbers = np.repeat(np.arange(n, dtype=np.int64), np.diff(pattern.indptr)) * n + pattern.indices
        entries = np.empty((len(parts), every.size))
        for k, part in enumerate(parts):
            places: Numbers = part.row.astype(np.int64) * n + part.col
            entries[k] = np.bincount(np.searchsorted(every, places), part.data, every.size)
        return pattern.indices, pattern.indptr, entries.T

    @cached_property
    def _within(self) -> tuple[Numbers, Numbers, Numbers, Reals]:
        """Which of those entries are not of the voltage, their column indices and row starts, and their scale."""
        columns, starts, _ = self._stored
        rows = np.repeat(np.arange(self.size + 1), np.diff(starts))
        kept = np.flatnonzero((rows < self.size) & (columns < self.size))
        inner = np.searchsorted(rows[kept], np.arange(self.size + 1)).astype(np.int32)
        return kept, columns[kept], inner, self.scale[rows[kept]] * self.scale[columns[kept]]

    def system(self, weights: Numbers, mass: float) -> Matrix:
        """Return H with these weights of its terms and the mass matrix weighted by `mass`, shape (n + 1, n + 1)."""
        columns, starts, entries = self._stored
        weighed = real_times(entries, np.append(weights, mass)[:, None]).ravel()
        return sp.csr_array((weighed, columns, starts), shape=(self.size + 1, self.size + 1))

    def factor(self, system: Matrix) -> Callable[[Numbers], Numbers]:
        """Return the solver of a `system` without the voltage, rows and columns scaled by `scale`."""
        kept, columns, starts, scale = self._within
        # symmetric: its rows are its columns
        inner = sp.csc_array((system.data[kept] * scale, columns, starts), shape=(self.size, self.size))
        # an order for symmetric matrices, still with pivots: two to ten times as fast as the usual one
        factors: Any = splu(inner, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        return factors.solve

    def solution(self, shape: Shape, constants: Complexes, frequency: float) -> Complexes:
        """Return displacements (m) and inner potential (V) for one volt, followed by the volt, shape (n + 1,)."""
        return self._solved(self._system_at(shape, constants, frequency))

    def _system_at(self, shape: Shape, constants: Complexes, frequency: float) -> Matrix:
        return self.system(shape.weights(constants), -((2 * np.pi * frequency) ** 2) * shape.mass)

    def _solved(self, system: Matrix) -> Complexes:
        n = self.size
        column = system[:n, [n]].toarray().ravel()
        x = -self.scale * self.factor(system)(self.scale * column)
        return np.append(x, 1.0)

    def capacitance(self, shape: Shape, constants: Complexes, frequency: Frequencies) -> Complexes:
        """Return Y/(jw) in F, shape (N,), at frequencies in Hz; constants in SI, shape (10,) or (N, 10).

        The whole disk is two halves of 2 pi each, and half C V^2 is minus the value of H at its stationary point.
        """
        each = np.broadcast_to(constants, (frequency.size, constants.shape[-1]))
        made: list[complex] = []
        for f, c in zip(frequency.tolist(), each, strict=True):
            system = self._system_at(shape, c, f)
            x = self._solved(system)
            made.append(-4 * np.pi * complex(x @ (system @ x)))
        return np.array(made)
