"""High-order line elements: one-dimensional integrals from which all matrices of the disk are products."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from ..base.arrays import Reals

Matrix: TypeAlias = Any
"""A sparse real or complex matrix, scipy.sparse.csr_array: its type stubs do not follow products and slices."""

Numbers: TypeAlias = NDArray[Any]
"""Real or complex numbers; real in, real out."""


def real_times(left: Reals, right: Numbers) -> Numbers:
    """Return the product of a real matrix and a matrix by one real product."""
    if not np.iscomplexobj(right):
        return left @ right
    return (left @ np.ascontiguousarray(right).view(np.float64)).view(np.complex128)


@lru_cache(maxsize=8)
def _element(order: int) -> tuple[Reals, Reals, Reals, Reals, Reals]:
    """Return nodes, quadrature points and weights on (-1, 1), and the nodal functions and slopes there, (Q, order + 1).

    Lagrange functions on the Gauss-Lobatto nodes; order + 2 Gauss points integrate every product exactly, those with
    the weight r, too, and never lie on the axis.
    """
    inner: Any = Legendre.basis(order).deriv().roots()
    nodes: Reals = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    points, weights = (np.asarray(part, np.float64) for part in leggauss(order + 2))
    vandermonde = np.polynomial.legendre.legvander(nodes, order)
    slopes = np.array([Legendre.basis(k).deriv()(points) for k in range(order + 1)]).T
    values = np.linalg.solve(vandermonde.T, np.polynomial.legendre.legvander(points, order).T).T
    slopes = np.linalg.solve(vandermonde.T, slopes.T).T
    return nodes, points, weights, np.asarray(values, np.float64), np.asarray(slopes, np.float64)


@dataclass(frozen=True, eq=False)
class LineElements:
    """A line of elements of one order."""

    breaks: Reals
    """Ends of the elements, shape (E + 1,), rising."""
    order: int

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.order * (self.breaks.size - 1) + 1

    @property
    def nodes(self) -> Reals:
        """Positions of the nodes, shape (size,)."""
        own, *_ = _element(self.order)
        parts = [low + (high - low) * (own[:-1] + 1) / 2 for low, high in pairwise(self.breaks.tolist())]
        return np.concatenate([*parts, self.breaks[-1:]])

    def values(self, at: Reals) -> Matrix:
        """Return the nodal functions at positions from the first to the last break, shape (P, size)."""
        order, own = self.order, _element(self.order)[0]
        element = np.clip(np.searchsorted(self.breaks, at, "right") - 1, 0, self.breaks.size - 2)
        low, high = self.breaks[element], self.breaks[element + 1]
        vandermonde = np.polynomial.legendre.legvander(own, order)
        local = np.polynomial.legendre.legvander(2 * (at - low) / (high - low) - 1, order)
        entries = np.linalg.solve(vandermonde.T, local.T).T
        rows = np.repeat(np.arange(at.size), order + 1)
        columns = (element[:, None] * order + np.arange(order + 1)).ravel()
        return sp.csr_array(sp.coo_array((entries.ravel(), (rows, columns)), shape=(at.size, self.size)))

    def at_points(self) -> tuple[Reals, Reals, tuple[Reals, Reals, Reals]]:
        """Return Gauss points within the elements, their weights, and the nodal functions with two derivatives there.

        Shapes (P,), (P,), and (P, size) each. The second derivative knows nothing of kinks between elements.
        """
        own, points, weights, values, slopes = _element(self.order)
        bent = np.array([Legendre.basis(k).deriv(2)(points) for k in range(self.order + 1)])
        vandermonde = np.polynomial.legendre.legvander(own, self.order)
        curved = np.linalg.solve(vandermonde.T, bent).T
        halves = np.diff(self.breaks) / 2
        made = tuple(np.zeros((halves.size * points.size, self.size)) for _ in range(3))
        for k, half in enumerate(halves.tolist()):
            at = slice(k * points.size, (k + 1) * points.size), slice(k * self.order, (k + 1) * self.order + 1)
            for power, (whole, part) in enumerate(zip(made, (values, slopes, curved), strict=True)):
                whole[at] = part / half**power
        x = (self.breaks[:-1, None] + halves[:, None] * (points + 1)).ravel()
        return x, (halves[:, None] * weights).ravel(), (made[0], made[1], made[2])

    def integral(self, first: int, second: int, weight: Callable[[Reals], Reals] = np.ones_like) -> Matrix:
        """Return the integrals of weight N_i N_k, shape (size, size); `first`, `second`: 1 for the derivative, or 0.

        With a weight of 1/x the rows and columns of the node at 0 mean nothing.
        """
        _, points, weights, values, slopes = _element(self.order)
        entries: list[Reals] = []
        rows: list[Numbers] = []
        columns: list[Numbers] = []
        local = np.arange(self.order + 1)
        for k, (low, high) in enumerate(pairwise(self.breaks.tolist())):
            half = (high - low) / 2
            left, right = (slopes / half if order else values for order in (first, second))
            w = weights * half * weight(low + half * (points + 1))
            entries.append((left.T * w) @ right)
            at = k * self.order + local
            rows.append(np.repeat(at[:, None], at.size, 1))
            columns.append(np.repeat(at[None, :], at.size, 0))
        data = tuple(np.concatenate([part.ravel() for part in parts]) for parts in (entries, rows, columns))
        return sp.csr_array(sp.coo_array((data[0], (data[1], data[2])), shape=(self.size, self.size)))
