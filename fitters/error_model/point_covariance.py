"""The covariance of what is different at every point: noise with its colour, and the rough part of the model's error.

Both are exponential in the distance of two points, so their precisions are tridiagonal and everything costs as much as
the columns it is applied to (Rybicki and Press, Phys. Rev. Lett. 74 (1995) 1060).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.linalg.lapack import dpttrf, dpttrs

from ...models.base.arrays import Complexes, Reals
from .prior_scales import ROUGH_LENGTH

Rough = tuple[float, float]
"""Sizes of the rough error of the model, and of the effects' formulas."""

_ORDER = 5
"""Order of the differences from which the noise of a recording was found."""


@dataclass(frozen=True, eq=False)
class PointErrors:
    """One recording's points: where they are, how noisy, and how much the rough error is felt there."""

    log_f: Reals
    noise: Reals
    """Standard deviation of Re and Im of ln Z as white noise would have it, shape (N,); infinite: takes no part."""
    felt: Reals
    """Rough error of the model of unit size, shape (N,)."""
    bent: Reals
    """Rough error of the effects' formulas of unit size, shape (N,)."""


def under_colour(colour: float) -> float:
    """Return by how much differences underrate noise of this correlation, 0 to 1."""
    signs = np.array([(-1) ** k * comb(_ORDER, k) for k in range(_ORDER + 1)], dtype=np.float64)
    lags = np.abs(np.subtract.outer(np.arange(_ORDER + 1), np.arange(_ORDER + 1)))
    return float(np.sqrt(signs @ colour**lags @ signs / comb(2 * _ORDER, _ORDER)))


def gram(
    points: Sequence[PointErrors], blocks: Sequence[Complexes], colour: float, rough: Rough
) -> tuple[Reals, float]:
    """Return X^T K^-1 X over Re and Im, shape (P, P), and ln |K| of both.

    `blocks`: X of each recording, complex, shape (N, P). K is the covariance of noise of this `colour` plus rough
    errors of these sizes.
    """
    kernel = Kernel(points, colour, rough)
    seen = kernel.white(blocks)
    return seen.squared(), kernel.log_det


@dataclass(frozen=True, eq=False)
class WhitenedColumns:
    """Columns in units of noise, Re and Im in turn: X^T K^-1 Y is `plain^T plain` less what the rough error takes."""

    plain: Reals
    rough: Reals | None
    """V of the rough error."""
    solved: Reals | None
    """M^-1 V, M its precision beside noise."""

    def squared(self) -> Reals:
        """Return X^T K^-1 X, shape (P, P)."""
        return self.times(self)

    def lengths(self) -> Reals:
        """Return the diagonal of X^T K^-1 X, shape (P,)."""
        whole = np.einsum("np,np->p", self.plain, self.plain)
        return whole if self.rough is None or self.solved is None else whole - np.sum(self.rough * self.solved, axis=0)

    def times(self, other: "WhitenedColumns") -> Reals:
        """Return X^T K^-1 Y, shape (P, Q)."""
        whole = self.plain.T @ other.plain
        return whole if self.rough is None or other.solved is None else whole - self.rough.T @ other.solved


class Kernel:
    """K of all recordings, ready to be applied."""

    def __init__(self, points: Sequence[PointErrors], colour: float, rough: Rough) -> None:
        self._ones = [_One(own, colour, rough) for own in points]
        self.log_det = 2 * sum(one.log_det for one in self._ones)

    def white(self, blocks: Sequence[Complexes]) -> WhitenedColumns:
        """Return columns in units of noise; `blocks` are those of each recording, complex, shape (N, P)."""
        parts = [one.white(X) for one, X in zip(self._ones, blocks, strict=True)]
        rough = [part.rough for part in parts if part.rough is not None]
        solved = [part.solved for part in parts if part.solved is not None]
        return WhitenedColumns(
            np.concatenate([part.plain for part in parts]),
            np.concatenate(rough) if rough else None,
            np.concatenate(solved) if solved else None,
        )


class _One:
    """K of one recording."""

    def __init__(self, own: PointErrors, colour: float, rough: Rough) -> None:
        self._kept = np.isfinite(own.noise)
        size = np.hypot(rough[0] * own.felt, rough[1] * own.bent)[self._kept]
        log_f, noise = own.log_f[self._kept], own.noise[self._kept]
        n = noise.size
        self._weight, self._colour = under_colour(colour) / noise, colour
        self.log_det = -2 * float(np.sum(np.log(self._weight))) + (n - 1) * float(np.log(1 - colour**2))
        self._factor: tuple[Reals, Reals] | None = None
        if not np.any(size):
            return
        scale = 1 / (1 - colour**2)
        middle = np.full(n, (1 + colour**2) * scale)
        middle[[0, -1]] = scale
        step = np.exp(-np.abs(np.diff(log_f)) / ROUGH_LENGTH)
        between = np.maximum(1 - step**2, 1e-12)
        T = np.ones(n)
        T[:-1] += step**2 / between
        T[1:] += step**2 / between
        self._amplitude = size * self._weight
        diagonal = T + self._amplitude**2 * middle
        beside = -step / between - colour * scale * self._amplitude[1:] * self._amplitude[:-1]
        d, e, failed = dpttrf(diagonal, beside)
        if failed:
            raise np.linalg.LinAlgError("rough error")
        self._factor = d, e
        self.log_det += float(np.sum(np.log(d))) + float(np.sum(np.log(between)))

    def white(self, X: Complexes) -> WhitenedColumns:
        kept = X if np.all(self._kept) else X[self._kept]
        n, p = kept.shape
        both = np.empty((n, 2 * p))
        np.multiply(kept.real, self._weight[:, None], out=both[:, :p])
        np.multiply(kept.imag, self._weight[:, None], out=both[:, p:])
        white = _whitened(both, self._colour)
        if self._factor is None:
            return WhitenedColumns(_stacked(white, p), None, None)
        V = self._amplitude[:, None] * _back(white, self._colour)
        solved, _ = dpttrs(*self._factor, V)
        return WhitenedColumns(_stacked(white, p), _stacked(V, p), _stacked(solved, p))


def _whitened(X: Reals, colour: float) -> Reals:
    """Return L^-1 X, L L^T = R, R_ij = colour^|i-j|."""
    if colour == 0:
        return X
    Y = X.copy()
    Y[1:] -= colour * X[:-1]
    Y[1:] /= np.sqrt(1 - colour**2)
    return Y


def _back(Y: Reals, colour: float) -> Reals:
    """Return L^-T Y."""
    if colour == 0:
        return Y
    inner = 1 / np.sqrt(1 - colour**2)
    X = Y.copy()
    X[1:] *= inner
    X[:-1] -= colour * inner * Y[1:]
    return X


def _stacked(A: Reals, p: int) -> Reals:
    """Return an array with Re in its first p columns and Im in the others, one below the other."""
    return np.concatenate([A[:, :p], A[:, p:]])
