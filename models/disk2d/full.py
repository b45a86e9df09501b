"""The disk solved on its whole mesh, one frequency at a time: what reduced models are made from and measured by."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ..arrays import Complexes, Frequencies, Reals
from .line import Line, Matrix, Numbers
from .matrices import CONSTANTS, OF_TERM, POWERS, Matrices, assemble

_ORDER_R, _ORDER_Z = 7, 8
_SIZES = {"c": 1e11, "e": 30.0, "eps": 9e-9}
_SCALE = np.array([_SIZES["eps" if name.startswith("eps") else name[0]] for name in CONSTANTS])


@dataclass(frozen=True)
class Shape:
    """Sizes and density of a round disk."""

    radius: float
    """m."""
    thickness: float
    """m."""
    density: float
    """kg/m3."""

    def weights(self, constants: Numbers) -> Numbers:
        """Return what each of TERMS is weighed by, shape (..., 13), for constants in SI units, shape (..., 10)."""
        return constants[..., OF_TERM] * self.lengths

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
    def of(cls, diameter_to_thickness: float, finer: int = 0) -> Self:
        """Return the mesh for this D/t; `finer` adds that many orders and elements per half thickness."""
        elements = max(1, ceil(diameter_to_thickness)) * (1 + finer)
        along_r = Line(np.linspace(0.0, 1.0, elements + 1), _ORDER_R + finer)
        return cls(assemble(along_r, Line(np.array([0.0, 1.0]), _ORDER_Z + 2 * finer)))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.matrices.size

    @cached_property
    def scale(self) -> Reals:
        """What each unknown is measured by, shape (n,): its own static stiffness for a typical ceramic of this mesh."""
        diagonal = sum(s * t.diagonal() for s, t in zip(_SCALE[OF_TERM], self.matrices.terms, strict=True))
        return 1 / np.sqrt(np.abs(np.asarray(diagonal)[: self.size]))

    def system(self, weights: Numbers, mass: float) -> Matrix:
        """Return H with these weights of its terms, the mass matrix weighed by `mass`, shape (n + 1, n + 1)."""
        whole = mass * self.matrices.mass
        for weight, term in zip(weights, self.matrices.terms, strict=True):
            whole = whole + weight * term
        return sp.csr_array(whole)

    def factor(self, system: Matrix) -> Callable[[Numbers], Numbers]:
        """Return the solver of H without the voltage, rows and columns scaled by `scale`."""
        n, scale = self.size, sp.diags_array(self.scale)
        factors: Any = splu(sp.csc_array(scale @ system[:n, :n] @ scale))
        return factors.solve

    def solution(self, shape: Shape, constants: Complexes, frequency: float) -> Complexes:
        """Return displacements (m) and potential (V) within for one volt, then the volt, shape (n + 1,)."""
        system = self.system(shape.weights(constants), -((2 * np.pi * frequency) ** 2) * shape.mass)
        n = self.size
        column = system[:n, [n]].toarray().ravel()
        x = -self.scale * self.factor(system)(self.scale * column)
        return np.append(x, 1.0)

    def capacitance(self, shape: Shape, constants: Complexes, frequency: Frequencies) -> Complexes:
        """Return Y/(jw) in F, shape (N,), at frequencies in Hz; constants in SI, shape (10,) or (N, 10).

        The whole disk is two halves of 2 pi each, and half C V^2 is minus the value of H at its stationary point.
        """
        each = np.broadcast_to(constants, (frequency.size, len(CONSTANTS)))
        made: list[complex] = []
        for f, c in zip(frequency.tolist(), each, strict=True):
            x = self.solution(shape, c, f)
            system = self.system(shape.weights(c), -((2 * np.pi * f) ** 2) * shape.mass)
            made.append(-4 * np.pi * complex(x @ (system @ x)))
        return np.array(made)
