"""Covariance of errors that vary from point to point: coloured noise, and the rough part of the model error.

Both are exponential in the distance of two points, so their precision matrices are tridiagonal and all operations are
linear in the number of points (Rybicki and Press, Phys. Rev. Lett. 74 (1995) 1060).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np
from scipy.linalg.lapack import dpttrf, dpttrs

from ...models.base.arrays import Complexes, Reals
from .prior_scales import ROUGH_LENGTH

Rough = tuple[float, float]
"""Sizes of the rough errors of the model and of the effects' formulas."""

_LEAST = 1e-3
"""Smallest rough error at a point that is computed with, relative to the noise there: a millionth of its variance."""
_ORDER = 5
"""Order of the differences from which the noise was estimated."""


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Points of one recording: frequency, noise, and sensitivity to the rough error."""

    log_f: Reals
    noise: Reals
    """Standard deviation of Re and Im of ln Z if the noise were white, shape (N,); infinite for excluded points."""
    felt: Reals
    """Rough model error of unit size, shape (N,)."""
    bent: Reals
    """Rough error of the effects' formulas of unit size, shape (N,)."""
    colour_limit: float = 1.0
    """Largest correlation that the noise of neighbouring points can have."""


@cache
def under_colour(colour: float) -> float:
    """Return the factor, 0 to 1, by which differences underestimate noise of this correlation."""
    signs = np.array([(-1) ** k * comb(_ORDER, k) for k in range(_ORDER + 1)], dtype=np.float64)
    lags = np.abs(np.subtract.outer(np.arange(_ORDER + 1), np.arange(_ORDER + 1)))
    return float(np.sqrt(signs @ colour**lags @ signs / comb(2 * _ORDER, _ORDER)))


def spread_of_variance(points: float) -> float:
    """Return the relative standard deviation of a white noise's variance, estimated from differences of many points.

    Neighbouring differences share points: their correlations rho at all lags leave only 1 / (sum of rho^2) as many.
    """
    shared = comb(4 * _ORDER, 2 * _ORDER) / comb(2 * _ORDER, _ORDER) ** 2
    return float(np.sqrt(shared / max(points, 1.0)))


RealColumns = list[Reals]
"""Columns in units of white noise, for each recording, shape (P, 2, N): Re and Im of the points that count."""


def in_noise(points: Sequence[PointErrors], blocks: Sequence[Complexes]) -> RealColumns:
    """Return columns, complex of shape (N, P) for each recording, in units of its noise."""
    made: RealColumns = []
    for own, X in zip(points, blocks, strict=True):
        kept = np.isfinite(own.noise)
        Y = X if np.all(kept) else X[kept]
        weight = 1 / own.noise[kept]
        both = np.empty((Y.shape[1], 2, Y.shape[0]))
        np.multiply(Y.real.T, weight, out=both[:, 0])
        np.multiply(Y.imag.T, weight, out=both[:, 1])
        made.append(both)
    return made


@dataclass(frozen=True, eq=False)
class WhitenedColumns:
    """Columns whitened by the whole covariance K: X^T K^-1 Y is the sum of `left` of X times `right` of Y."""

    left: Sequence[Reals]
    """For each recording, shape (P, 2N)."""
    right: Sequence[Reals]
    """The same array where there is only coloured noise."""

    def squared(self) -> Reals:
        """Return X^T K^-1 X, shape (P, P)."""
        return self.times(self)

    def lengths(self) -> Reals:
        """Return the diagonal of X^T K^-1 X, shape (P,)."""
        return self.products(self.left, self.right)

    def times(self, other: "WhitenedColumns") -> Reals:
        """Return X^T K^-1 Y, shape (P, Q)."""
        count = len(self.left[0]), len(other.left[0])
        return sum((own @ its.T for own, its in zip(self.left, other.right, strict=True)), np.zeros(count))

    def pairs(self) -> Reals:
        """Return, for each pair of neighbouring columns, both squared lengths and the product, shape (P/2, 3)."""
        return np.stack(
            [
                self.products([X[i::2] for X in self.left], [Y[j::2] for Y in self.right])
                for i, j in ((0, 0), (1, 1), (0, 1))
            ],
            axis=1,
        )

    @staticmethod
    def products(left: Sequence[Reals], right: Sequence[Reals]) -> Reals:
        """Return the sum of products of each row with the one of the same number, shape (P,)."""
        rows = (np.einsum("pn,pn->p", X, Y) for X, Y in zip(left, right, strict=True))
        return sum(rows, np.zeros(len(left[0])))


class Kernel:
    """The covariance K of all recordings, factorised."""

    def __init__(self, points: Sequence[PointErrors], colour: float, rough: Rough) -> None:
        self._points = points
        self._ones = [_One(own, colour, rough) for own in points]
        self.log_det = 2 * sum(one.log_det for one in self._ones)

    def white(self, blocks: Sequence[Complexes]) -> WhitenedColumns:
        """Return columns in units of K; `blocks` are those of each recording, complex, shape (N, P)."""
        return self.whitened(in_noise(self._points, blocks))

    def whitened(self, columns: RealColumns) -> WhitenedColumns:
        """Return columns in units of K from columns in units of white noise."""
        sides = [one.sides(X) for one, X in zip(self._ones, columns, strict=True)]
        return WhitenedColumns([_flat(left) for left, _ in sides], [_flat(right) for _, right in sides])


class _One:
    """The covariance K of one recording."""

    def __init__(self, own: PointErrors, colour: float, rough: Rough) -> None:
        kept = np.isfinite(own.noise)
        size = np.hypot(rough[0] * own.felt, rough[1] * own.bent)[kept]
        log_f, noise = own.log_f[kept], own.noise[kept]
        n = noise.size
        self._under, self._colour = under_colour(colour), colour
        weight = self._under / noise
        self.log_det = -2 * float(np.sum(np.log(weight))) + (n - 1) * float(np.log(1 - colour**2))
        self.is_rough = bool(np.any(size))
        if not self.is_rough:
            return
        scale = 1 / (1 - colour**2)
        middle = np.full(n, (1 + colour**2) * scale)
        middle[[0, -1]] = scale
        step = np.exp(-np.abs(np.diff(log_f)) / ROUGH_LENGTH)
        between = np.maximum(1 - step**2, 1e-12)
        beside_of_T = -step / between
        middle_of_T = np.ones(n)
        middle_of_T[:-1] += step**2 / between
        middle_of_T[1:] += step**2 / between
        self._amplitude = np.maximum(size * weight, _LEAST)
        diagonal = middle_of_T + self._amplitude**2 * middle
        beside = beside_of_T - colour * scale * self._amplitude[1:] * self._amplitude[:-1]
        d, e, failed = dpttrf(diagonal, beside)
        if failed:
            raise np.linalg.LinAlgError("rough error")
        self._factor = d, e
        self._within, self._after, self._before = (  # T A^-1
            middle_of_T / self._amplitude,
            beside_of_T / self._amplitude[:-1],
            beside_of_T / self._amplitude[1:],
        )
        self.log_det += float(np.sum(np.log(d))) + float(np.sum(np.log(between)))

    def sides(self, X: Reals) -> tuple[Reals, Reals]:
        """Return the factors of X^T K^-1 X from columns in units of white noise, each (P, 2, N).

        K = R + A T^-1 A, R the coloured noise, A the rough error's amplitudes, T its precision at unit amplitude. Its
        inverse is A^-1 T M^-1 A R^-1 with M = T + A R^-1 A: a product, where the usual difference of R^-1 and a
        correction would lose all digits if the rough error is much larger than the noise.
        """
        scaled = X if self._under == 1 else self._under * X
        white = _whitened(scaled, self._colour)
        if not self.is_rough:
            return white, white
        left = self._within * scaled
        left[..., 1:] += self._after * scaled[..., :-1]
        left[..., :-1] += self._before * scaled[..., 1:]
        right = self._amplitude * _back(white, self._colour)
        if right.size:
            solved, _ = dpttrs(*self._factor, right.reshape(-1, right.shape[-1]).T, overwrite_b=1)
            right = np.asarray(solved.T, np.float64).reshape(right.shape)
        return left, right


def _flat(Y: Reals) -> Reals:
    """Return (P, 2, N) as (P, 2N)."""
    return Y.reshape(len(Y), 2 * Y.shape[2])


def _whitened(X: Reals, colour: float) -> Reals:
    """Return L^-1 X along the last axis, L L^T = R, R_ij = colour^|i-j|."""
    if colour == 0:
        return X
    Y = X.copy()
    Y[..., 1:] -= colour * X[..., :-1]
    Y[..., 1:] /= np.sqrt(1 - colour**2)
    return Y


def _back(Y: Reals, colour: float) -> Reals:
    """Return L^-T Y along the last axis."""
    if colour == 0:
        return Y
    inner = 1 / np.sqrt(1 - colour**2)
    X = Y.copy()
    X[..., 1:] *= inner
    X[..., :-1] -= colour * inner * Y[..., 1:]
    return X
