"""Covariance of errors that vary from point to point: coloured noise, and the rough part of the model error.

Both are exponential in the distance of two points, so their precision matrices are tridiagonal and all operations are
linear in the number of points (Rybicki and Press, Phys. Rev. Lett. 74 (1995) 1060).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from math import comb
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpttrf, dpttrs

from ...models.base.arrays import Complexes, Reals
from .prior_scales import ROUGH_LENGTH
from .rough_filter import RoughFilter

Rough = tuple[float, float]
"""Sizes of the rough errors of the model and of the effects' formulas."""

_LEAST = 1e-3
"""Smallest rough error at a point that is computed with, relative to the noise there: a millionth of its variance."""
_SAME = 1e-9
"""Difference of ln f below which two frequencies are the same."""
_OWN = 0.01
"""Share of the rough error's variance that is another one in each repeat: a device drifts, and so does an analyzer."""
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
    device: str = ""
    """What was recorded, and how: its rough error is the same in every recording at the same frequencies.

    Empty if unknown.
    """

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Whether each point counts, shape (N,)."""
        return np.isfinite(self.noise)

    @cached_property
    def weight(self) -> Reals:
        """1/noise of the points that count."""
        return 1 / self.noise[self.kept]

    @cached_property
    def all_kept(self) -> bool:
        """Whether all points count."""
        return bool(np.all(self.kept))

    def repeats(self, other: "PointErrors") -> bool:
        """Return whether two recordings are of the same device at the same frequencies, so that only noise differs."""
        if self.device == "" or self.device != other.device or self.log_f.shape != other.log_f.shape:
            return False
        return np.array_equal(self.kept, other.kept) and np.allclose(self.log_f, other.log_f, rtol=0, atol=_SAME)


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
        Y = X if own.all_kept else X[own.kept]
        both = np.empty((Y.shape[1], 2, Y.shape[0]))
        np.multiply(Y.real.T, own.weight, out=both[:, 0])
        np.multiply(Y.imag.T, own.weight, out=both[:, 1])
        made.append(both)
    return made


@dataclass(frozen=True, eq=False)
class WhitenedColumns:
    """Columns whitened by the whole covariance K: X^T K^-1 Y is the sum of `left` of X times `right` of Y."""

    left: Sequence[Reals]
    """For each recording, shape (P, 2N)."""
    right: Sequence[Reals]
    """The same array unless there are both coloured noise and rough errors."""

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
    """The covariance K of all recordings, factorised.

    The rough error of a device is in all repeats of a sweep, less a small share of its own in each: their points are
    turned, in units of their noise, so that what they have in common is in the first of them alone.
    """

    def __init__(self, points: Sequence[PointErrors], colour: float, rough: Rough) -> None:
        self._points = points
        under = under_colour(colour)
        sizes = [_rough_of(own, rough) for own in points]
        self._turns = [_Turn.of(group, sizes) for group in _repeated(points)] if any(rough) else []
        for turn in self._turns:
            for k, size in zip(turn.members, turn.sizes, strict=True):
                sizes[k] = size
        self._ones = [
            _One(own.log_f[own.kept], under * size, colour, under) for own, size in zip(points, sizes, strict=True)
        ]
        of_noise = sum(float(np.sum(np.log(own.noise[own.kept] / under))) for own in points)
        self.log_det = 4 * of_noise + 2 * sum(one.log_det for one in self._ones)  # of Re and Im

    def white(self, blocks: Sequence[Complexes]) -> WhitenedColumns:
        """Return columns in units of K; `blocks` are those of each recording, complex, shape (N, P)."""
        return self.whitened(in_noise(self._points, blocks))

    def whitened(self, columns: RealColumns) -> WhitenedColumns:
        """Return columns in units of K from columns in units of white noise."""
        turned = list(columns)
        for turn in self._turns:
            for k, X in zip(turn.members, turn.turned([columns[k] for k in turn.members]), strict=True):
                turned[k] = X
        sides = [one.sides(X) for one, X in zip(self._ones, turned, strict=True)]
        return WhitenedColumns([_flat(left) for left, _ in sides], [_flat(right) for _, right in sides])


def _rough_of(own: PointErrors, rough: Rough) -> Reals:
    """Return the rough error of a recording in units of its white noise, at the points that count."""
    return (np.hypot(rough[0] * own.felt, rough[1] * own.bent) / own.noise)[own.kept]


def _repeated(points: Sequence[PointErrors]) -> list[tuple[int, ...]]:
    """Return the numbers of the recordings that repeat one another, for each sweep that has repeats."""
    groups: list[list[int]] = []
    for k, own in enumerate(points):
        known = next((group for group in groups if own.repeats(points[group[0]])), None)
        if known is None:
            groups.append([k])
        else:
            known.append(k)
    return [tuple(group) for group in groups if len(group) > 1]


@dataclass(frozen=True, eq=False)
class _Turn:
    """The rotation of repeated points that moves what they have in common to the first of them (Householder).

    It is one for all frequencies where the ratio of the repeats' noise is: then coloured noise stays as it is.
    """

    members: tuple[int, ...]
    """Numbers of the recordings."""
    common: Reals
    """Share of what they have in common in each of them, a unit vector at each point, shape (K, N)."""
    sizes: Reals
    """Rough error of the turned points, shape (K, N)."""

    @classmethod
    def of(cls, members: tuple[int, ...], sizes: Sequence[Reals]) -> Self:
        """Return the rotation for these sizes of the rough error, in units of noise."""
        own = np.stack([sizes[k] for k in members])
        whole = np.sqrt(np.sum(own**2, axis=0))
        alike = np.full(own.shape, 1 / np.sqrt(len(own)))
        turned = np.outer(np.full(len(own), np.sqrt(_OWN / len(own))), whole)
        turned[0] = np.sqrt(1 - _OWN + _OWN / len(own)) * whole
        return cls(members, np.divide(own, whole, out=alike, where=whole > 0), turned)

    def turned(self, columns: RealColumns) -> RealColumns:
        """Return the columns of its recordings after the rotation, each of shape (P, 2, N)."""
        shared = sum((e * X for e, X in zip(self.common, columns, strict=True)), np.zeros_like(columns[0]))
        moved = (shared + columns[0]) / (1 + self.common[0])
        others = [X - e * moved for e, X in zip(self.common[1:], columns[1:], strict=True)]
        return [-shared, *others]


class _One:
    """The covariance K of one recording, in units of its white noise."""

    def __init__(self, log_f: Reals, size: Reals, colour: float, under: float) -> None:
        """`size`: rough error in units of the noise, which is larger than white noise of the same differences."""
        n = log_f.size
        self._under, self._colour = under, colour
        self._white: Callable[[Reals], Reals] | None = None
        self.log_det = (n - 1) * float(np.log(1 - colour**2))
        if not np.any(size):
            self._white = partial(_whitened, colour=colour)
            return
        step = np.exp(-np.abs(np.diff(log_f)) / ROUGH_LENGTH)
        between = np.maximum(1 - step**2, 1e-12)
        self._amplitude = np.maximum(size, _LEAST)
        if colour == 0:
            rough = RoughFilter.of(self._amplitude, step, between)
            self._white = rough.whitened
            self.log_det += rough.log_det
            return
        scale = 1 / (1 - colour**2)
        middle = np.full(n, (1 + colour**2) * scale)
        middle[[0, -1]] = scale
        beside_of_T = -step / between
        middle_of_T = np.ones(n)
        middle_of_T[:-1] += step**2 / between
        middle_of_T[1:] += step**2 / between
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

        They are the same unless there are rough errors beside coloured noise: K = R + A T^-1 A, R the coloured noise, A
        the rough error's amplitudes, T its precision at unit amplitude. Its inverse is A^-1 T M^-1 A R^-1 with
        M = T + A R^-1 A: a product, where the usual difference of R^-1 and a correction would lose all digits if the
        rough error is much larger than the noise.
        """
        scaled = X if self._under == 1 else self._under * X
        if self._white is not None:
            white = self._white(scaled)
            return white, white
        left = self._within * scaled
        left[..., 1:] += self._after * scaled[..., :-1]
        left[..., :-1] += self._before * scaled[..., 1:]
        right = _by_precision(scaled, self._colour)
        right *= self._amplitude
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


def _by_precision(X: Reals, colour: float) -> Reals:
    """Return a new array R^-1 X along the last axis, R as above: its inverse is tridiagonal."""
    if colour == 0 or X.shape[-1] == 1:
        return X.copy()
    scale = 1 / (1 - colour**2)
    Y = ((1 + colour**2) * scale) * X
    Y[..., [0, -1]] = scale * X[..., [0, -1]]
    neighbours = (colour * scale) * X
    Y[..., 1:] -= neighbours[..., :-1]
    Y[..., :-1] -= neighbours[..., 1:]
    return Y
