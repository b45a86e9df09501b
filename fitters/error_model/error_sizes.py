"""Sizes of the parts of the error, chosen by the recording: maximum marginal likelihood on grids that include zero."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import log
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtrs

from ...models.base.arrays import Complexes, Reals
from . import prior_scales as scales
from .error_columns import ErrorColumns
from .point_covariance import Kernel, RealColumns, Rough, WhitenedColumns, in_noise

GRIDS: Mapping[str, tuple[float, ...]] = {
    "tau": scales.TAUS,
    "rho": scales.RHOS,
    "slow": scales.SHARES,
    "fast": scales.QUICK,
    "fixture": scales.THERE,
    "held": scales.THERE,
    "losses": scales.ON,
    "uneven": scales.THERE,
    "shape": scales.BENT,
    "bend": scales.BENDS,
    "colour": scales.COLOURS,
}
_ROUNDS = 3
_RIDGES = (1e-12, 1e-10, 1e-8, 1e-6)
"""Added to the diagonal of a normalised matrix that has no Cholesky factor because of rounding."""
_DEAR = ("rho", "bend", "colour")
"""Parts without columns, which need new products of all columns."""


@dataclass(frozen=True)
class ErrorSizes:
    """Size of each part of the error; all zero means an exact model and white noise."""

    tau: float = 0.0
    rho: float = 0.0
    slow: float = 0.0
    fast: float = 0.0
    fixture: float = 0.0
    held: float = 0.0
    losses: float = 0.0
    uneven: float = 0.0
    shape: float = 0.0
    bend: float = 0.0
    colour: float = 0.0

    def at(self, name: str, value: float) -> "ErrorSizes":
        """Return the same with another size of one part."""
        return self if getattr(self, name) == value else _at(self, name, value)

    def at_most(self, other: "ErrorSizes") -> Self:
        """Return the same with no error larger than in `other`; the colour of the noise is unchanged."""
        sizes = {name: min(getattr(self, name), getattr(other, name)) for name in GRIDS if name != "colour"}
        return replace(self, **sizes)

    @property
    def log_prior(self) -> float:
        """Logarithm of the prior probability on the grids."""
        return _log_prior(self)

    def none(self, name: str) -> float:
        """Return the prior probability that a part is absent, given the others.

        An error-free fixture, an exact data sheet and parallel faces belong to an error-free instrument; and no real
        device was measured with an error-free instrument: if the model itself has errors, so has the instrument.
        """
        if name in scales.SIMULATED and not (self.slow > 0 or self.fast > 0):
            return scales.SIMULATED[name]
        if name == "slow" and any((self.tau, self.rho, self.losses, self.shape, self.bend)):
            return scales.FLAWLESS
        return scales.NONE[name]

    @property
    def exact(self) -> bool:
        """Whether there are no errors but white noise."""
        return not any(getattr(self, name) for name in GRIDS)

    @property
    def rough(self) -> Rough:
        """Sizes of the rough errors."""
        return self.rho, self.bend

    @property
    def smooth(self) -> "ErrorSizes":
        """The same without rough errors."""
        return self.at("rho", 0.0).at("bend", 0.0)

    def of_columns(self) -> dict[str, float]:
        """Return the scale of each part that has columns."""
        sizes = {name: getattr(self, name) for name in GRIDS if name not in _DEAR}
        return {**sizes, "line": 1.0, "switch": 1.0, "formula": 1.0}


# The same sizes are tried beside every effect.
@lru_cache(maxsize=16384)
def _at(sizes: ErrorSizes, name: str, value: float) -> ErrorSizes:
    return replace(sizes, **{name: value})


@lru_cache(maxsize=4096)
def _log_prior(sizes: ErrorSizes) -> float:
    total = 0.0
    for name, grid in GRIDS.items():
        none = sizes.none(name)
        share = 1 / (len(grid) - 1) if name != "slow" else scales.LIKELY[sizes.slow]
        total += log(none) if getattr(sizes, name) == 0 else log((1 - none) * share)
    return total


USUAL = ErrorSizes(tau=3e-5, rho=3e-4, slow=1.0, fixture=1.0, losses=1.0, uneven=1.0)
"""Errors of a good device and a good instrument."""


@dataclass(frozen=True, eq=False)
class Beforehand:
    """Normal equations of the priors."""

    P: Reals
    g: Reals
    q: float


@dataclass(frozen=True, eq=False)
class Value:
    """Marginal likelihood at one point, with its quadratic expansion."""

    log_evidence: float
    """ln of the integral over constants, sizes of effects and errors."""
    here: float
    """Minus twice ln of the joint density at the point itself, apart from constants."""
    H: Reals
    """Information matrix of the coordinates, shape (M, M)."""
    step: Reals
    """Newton step to the minimum, shape (M,)."""


@dataclass(eq=False)
class Gram:
    """Inner products of columns, derivatives and residual by colour and roughness, and marginal likelihoods; cached."""

    columns: ErrorColumns
    J: Sequence[Complexes]
    r: Sequence[Complexes]
    before: Beforehand
    _known: dict[tuple[float, Rough], tuple[Reals, float]] = field(
        default_factory=dict[tuple[float, Rough], tuple[Reals, float]]
    )
    _values: dict[ErrorSizes, Value] = field(default_factory=dict[ErrorSizes, Value])

    def value(self, sizes: ErrorSizes) -> Value:
        """Return the marginal likelihood with errors of these sizes. Raises LinAlgError."""
        if sizes not in self._values:
            self._values[sizes] = self._valued(sizes)
        return self._values[sizes]

    def most(self, sizes: ErrorSizes) -> float:
        """Return the ln evidence with errors of these sizes if priors took nothing from it. Raises LinAlgError."""
        return self.value(sizes).log_evidence + 0.5 * self.before.q

    def _valued(self, sizes: ErrorSizes) -> Value:
        G, log_det = self._gram(sizes.colour, sizes.rough)
        on, d, L, log_S = self._present(sizes)
        C = len(self.columns.parts)
        return valued(G[C:, C:], whitened_by(L, d[:, None] * G[on, C:]), log_S + log_det, self.before, sizes)

    def _present(self, sizes: ErrorSizes) -> tuple[NDArray[np.intp], Reals, Reals, float]:
        """Return indices and scales of the columns that are there, and what `factored` returns for them."""
        G, _ = self._gram(sizes.colour, sizes.rough)
        on, d = self.columns.present(sizes.of_columns())
        return on, d, *factored(G[np.ix_(on, on)], d)

    def exact(self, sizes: ErrorSizes) -> bool:
        """Return whether errors of these sizes are none but white noise, so that the likelihood is no approximation."""
        return sizes.exact and "formula" not in self.columns.parts

    def possible(self, sizes: ErrorSizes) -> ErrorSizes:
        """Return the same with no more colour of the noise than the recordings allow."""
        return sizes.at("colour", min(sizes.colour, self._most_colour))

    def coefficients(self, sizes: ErrorSizes) -> Reals:
        """Return the most probable coefficient of each column, shape (C,), at the point itself. Raises LinAlgError."""
        G, _ = self._gram(sizes.colour, sizes.rough)
        on, d, L, _ = self._present(sizes)
        return coefficients_of(len(self.columns.parts), on, d, L, whitened_by(L, d[:, None] * G[on, -1:])[:, 0])

    def told(self, sizes: ErrorSizes) -> Reals:
        """Return which part of each column's prior variance the recordings take away, shape (C,). Raises LinAlgError.

        It is the expected square of its most probable coefficient, in standard deviations: none of what they do not
        show, or what constants may be as well.
        """
        G, _ = self._gram(sizes.colour, sizes.rough)
        on, d, L, _ = self._present(sizes)
        C = len(self.columns.parts)
        made = np.zeros(C)
        if on.size:
            H = self.value(sizes).H
            unit = np.sqrt(np.maximum(H.diagonal(), 1e-300))
            alone = whitened_by(L, np.eye(on.size))
            moved = alone.T @ whitened_by(L, d[:, None] * G[on, C:-1])
            by_constants = whitened_by(_cholesky(H / unit / unit[:, None]), (moved / unit).T)
            made[on] = np.clip(1 - np.sum(alone**2, axis=0) - np.sum(by_constants**2, axis=0), 0.0, 1.0)
        return made

    def _gram(self, colour: float, rough: Rough) -> tuple[Reals, float]:
        if (colour, rough) not in self._known:
            kernel = Kernel(self.columns.points, colour, rough)
            self._known[colour, rough] = kernel.whitened(self._in_noise).squared(), kernel.log_det
        return self._known[colour, rough]

    @cached_property
    def _most_colour(self) -> float:
        most = min((own.colour_limit for own in self.columns.points), default=1.0)
        return max(one for one in scales.COLOURS if one <= most)

    @cached_property
    def _in_noise(self) -> RealColumns:
        blocks = [
            np.concatenate([c, j, r[:, None]], axis=1)
            for c, j, r in zip(self.columns.blocks, self.J, self.r, strict=True)
        ]
        return in_noise(self.columns.points, blocks)


def factored(G: Reals, d: Reals) -> tuple[Reals, float]:
    """Return the Cholesky factor of 1 + d G d, and ln of its determinant. Raises LinAlgError."""
    diagonal = 1 + d * G.diagonal() * d
    if not (diagonal > 0).all():
        raise np.linalg.LinAlgError("no covariance")
    unit = np.sqrt(diagonal)
    part = d / unit
    S = part[:, None] * G * part
    np.fill_diagonal(S, 1.0)
    scaled = unit[:, None] * _cholesky(S)
    return scaled, 2 * float(np.log(scaled.diagonal()).sum())


def _cholesky(S: Reals) -> Reals:
    """Return the lower Cholesky factor of a matrix of unit diagonal, column by column. Raises LinAlgError."""
    for ridge in _RIDGES:
        regular = S.copy()
        regular.flat[:: len(S) + 1] += ridge  # the diagonal
        L, failed = dpotrf(regular.T, lower=1, overwrite_a=1)  # zeros above the diagonal
        if not failed:
            return L
    raise np.linalg.LinAlgError("no covariance")


def whitened_by(L: Reals, GX: Reals) -> Reals:
    """Return products with columns of errors, whitened by the factor `L` from `factored`."""
    return np.asarray(dtrtrs(L, np.asfortranarray(GX), lower=1)[0] if L.size else np.zeros((0, GX.shape[1])))


def coefficients_of(count: int, on: NDArray[np.intp], d: Reals, L: Reals, beside: Reals) -> Reals:
    """Return the most probable coefficients of all columns, shape (count,); 0 for those that are not present.

    `on` and `d`: indices and scales of those that are; `beside`: their products with the residuals from `whitened_by`.
    """
    made = np.zeros(count)
    if on.size:
        made[on] = -d * solve_triangular(L, beside, lower=True, trans=1, check_finite=False)
    return made


def valued(X: Reals, B: Reals, log_K: float, before: Beforehand, sizes: ErrorSizes) -> Value:
    """Return the marginal likelihood from products of derivatives and residual, `X`, and `B` from `whitened_by`.

    `log_K` is ln of the determinant of the whole covariance.
    """
    left = X - B.T @ B
    H = left[:-1, :-1] + before.P
    g, q = left[:-1, -1] + before.g, float(left[-1, -1]) + before.q
    unit = np.sqrt(np.maximum(H.diagonal(), 1e-300))
    factor = _cholesky(H / unit / unit[:, None])
    step = -dpotrs(factor, g / unit, lower=1)[0] / unit
    log_H = 2 * float((np.log(factor.diagonal()) + np.log(unit)).sum())
    here = q + log_K
    return Value(-0.5 * (here + float(g @ step) + log_H) + sizes.log_prior, here, H, step)


@dataclass(frozen=True, eq=False)
class Held:
    """Columns of fixed sizes, beside which derivatives and residuals may be those of other points."""

    sizes: ErrorSizes
    kernel: Kernel
    white: WhitenedColumns
    on: NDArray[np.intp]
    """Indices of the columns that are present."""
    d: Reals
    L: Reals
    """Cholesky factor of the information of the coefficients, in standard deviations."""
    log_S: float
    columns: ErrorColumns

    @classmethod
    def of(cls, columns: ErrorColumns, sizes: ErrorSizes) -> Self:
        """Return the columns that are present at these sizes."""
        on, d = columns.present(sizes.of_columns())
        kernel = Kernel(columns.points, sizes.colour, sizes.rough)
        white = kernel.white(columns.only(on).blocks)
        L, log_S = factored(white.squared(), d)
        return cls(sizes, kernel, white, on, d, L, log_S, columns)

    def present(self, a: Reals) -> Reals:
        """Return coefficients of all columns, shape (C,), without those of columns that are not present."""
        made = np.zeros(len(self.columns.parts))
        made[self.on] = a[self.on]
        return made

    def products(self, seen: WhitenedColumns) -> Reals:
        """Return products of the columns, in standard deviations, with others."""
        return self.d[:, None] * self.white.times(seen)

    def most_probable(self, r: Sequence[Complexes]) -> Reals:
        """Return the most probable coefficient of each column, shape (C,), for residuals of the uncorrected model."""
        seen = self.kernel.white([own[:, None] for own in r])
        beside = whitened_by(self.L, self.products(seen))[:, 0]
        return coefficients_of(len(self.columns.parts), self.on, self.d, self.L, beside)


def rough_guess(made: Gram) -> ErrorSizes:
    """Return sizes that explain the whole residual as rough model error: a start far from any explanation."""
    excess, felt = 0.0, 0.0
    for points, r in zip(made.columns.points, made.r, strict=True):
        kept = np.isfinite(points.noise)
        excess += float(np.sum(np.abs(r[kept]) ** 2 / 2 - points.noise[kept] ** 2))
        felt += float(np.sum(points.felt[kept] ** 2))
    size = np.sqrt(max(excess, 0.0) / max(felt, 1e-300))
    return ErrorSizes(rho=min(scales.RHOS, key=lambda one: abs(one - size)))


def exchanged(sizes: ErrorSizes) -> tuple[ErrorSizes, ...]:
    """Return the same with errors in place of others that describe much the same.

    Noise of each colour and rough errors: deviations that neighbouring points have in common. Errors of values that
    are held and smooth errors of all constants. Beside one of them the other gains nothing: no change of one size at a
    time leads from the worse of the two to the better one.
    """
    made: list[ErrorSizes] = []
    if sizes.rho or sizes.bend:
        made += [replace(sizes, rho=0.0, bend=0.0, colour=one) for one in scales.COLOURS[1:]]
    elif sizes.colour:
        made.append(replace(sizes, rho=scales.RHOS[1], colour=0.0))
    if sizes.tau:
        made.append(replace(sizes, held=scales.THERE[-1], tau=0.0))
    return tuple(made)


def of_the_instrument(colour: float) -> tuple[ErrorSizes, ...]:
    """Return errors of instrument and fixture alone, and of held values, beside noise of this colour.

    Each of them alone may gain nothing where a smooth error of the constants imitates them all. A simulated analyzer
    may have no error of its own in a fixture that leaves a residue.
    """
    together = (ErrorSizes(slow=share, fixture=1.0, held=1.0, colour=colour) for share in scales.SHARES[1:])
    return *together, ErrorSizes(fixture=1.0, colour=colour)


def chosen(
    made: Gram, starts: Sequence[ErrorSizes], order: Sequence[str], *, all_starts: bool = True
) -> tuple[ErrorSizes, Value]:
    """Maximise the marginal likelihood over the sizes, one part after the other.

    From all starts, or only from the one with the largest marginal likelihood. Sizes whose covariance is not positive
    definite because of rounding are skipped. Raises LinAlgError if all starts are.
    """
    begun = evaluated(made, starts)
    if not begun:
        raise np.linalg.LinAlgError("no covariance")
    if not all_starts:
        begun = [_largest(begun)]
    now, value = _largest([_around(made, sizes, value, order, again=False) for sizes, value in begun])
    for _ in range(_ROUNDS):
        before = now
        now, value = _around(made, now, value, order, again=True)
        if now == before:
            break
    return now, value


def evaluated(made: Gram, trials: Sequence[ErrorSizes]) -> list[tuple[ErrorSizes, Value]]:
    """Return the marginal likelihood of those of these sizes for which it can be computed."""
    values: list[tuple[ErrorSizes, Value]] = []
    for sizes in dict.fromkeys(map(made.possible, trials)):
        try:
            values.append((sizes, made.value(sizes)))
        except np.linalg.LinAlgError:
            continue
    return values


def _largest(values: Sequence[tuple[ErrorSizes, Value]]) -> tuple[ErrorSizes, Value]:
    return max(values, key=lambda pair: pair[1].log_evidence)


def _around(
    made: Gram, now: ErrorSizes, value: Value, order: Sequence[str], *, again: bool
) -> tuple[ErrorSizes, Value]:
    for name in order:
        now, value = _along(made, now, value, name, again=again)
    return now, value


def _along(made: Gram, now: ErrorSizes, value: Value, name: str, *, again: bool) -> tuple[ErrorSizes, Value]:
    """Return the best along one grid; only its neighbours for parts that need new products of all columns."""
    if name == "shape" and "shape" not in made.columns.parts:
        return now, value
    if name == "bend" and not any(np.any(own.bent) for own in made.columns.points):
        return now, value
    grid, at = GRIDS[name], GRIDS[name].index(getattr(now, name))
    near = name in _DEAR or again
    trials = [now.at(name, size) for k, size in enumerate(grid) if k != at and (not near or abs(k - at) == 1)]
    return _largest([(now, value), *evaluated(made, trials)])
