"""Uncertainties by source: noise, instrument, model, dimensions and values held by assumption; they add in quadrature.

The estimate is linear in the data: x = A y, A = H^-1 J^T K^-1 with K the covariance of everything except constants. Its
covariance H^-1 is therefore A K A^T plus the contribution of the priors, and K is a sum over sources.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import chdtri

from ...models.base.arrays import Complexes, Reals
from .error_columns import HELD, ErrorColumns
from .error_sizes import GRIDS, ErrorSizes, Value, evaluated
from .joint_descent import FURTHEST
from .marginal_fit import MarginalFit
from .point_covariance import Kernel
from .prior_scales import IMAGINARY, RARE

SOURCES = ("noise", "instrument", "model", "dimensions", "assumptions")
_INSTRUMENT = ("slow", "fast", "switch", "fixture")
_UNSURE = ("tau", "slow", "fixture", "held")
"""Sizes over which an uncertainty is averaged: smooth errors of the instrument and of the constants describe much the
same, but constants depend on which it is. Those of rough errors and of colour follow from the scatter of the points."""
_NEGLIGIBLE = 1e-3
"""Probability relative to the most probable sizes below which others do not affect an uncertainty."""


@dataclass(frozen=True, eq=False)
class CovarianceBySource:
    """Covariance of the free coordinates of a fit, by source; each of shape (M, M)."""

    by: Mapping[str, Reals]
    mean: Reals
    """Where the coordinates are on the average over all sizes of errors, relative to the minimum, shape (M,)."""
    held: tuple[str, ...]
    """Values of the build that may be off, though they are held."""
    beside: Reals
    """Covariance of the coordinates with what these are off by, in their tolerances, shape (M, held)."""
    of_held: Reals
    """Covariance of the latter, shape (held, held)."""

    @property
    def whole(self) -> Reals:
        """The sum, shape (M, M)."""
        return sum(self.by.values(), np.zeros_like(self.by["noise"]))

    @property
    def about_the_minimum(self) -> Reals:
        """Mean square of how far the coordinates are from the minimum, shape (M, M)."""
        return self.whole + np.outer(self.mean, self.mean)

    def of(self, chain: Reals) -> dict[str, Reals]:
        """Return the standard uncertainty of parameters by source, with d parameter / d x = `chain`, shape (P, M)."""
        return {name: np.sqrt(np.maximum(np.einsum("pm,mn,pn->p", chain, C, chain), 0)) for name, C in self.by.items()}


def spread_of(found: MarginalFit) -> CovarianceBySource:
    """Return the covariance at a minimum by source.

    Recordings often do not determine what kind of error they have. The result is therefore that of the mixture over
    the sizes of smooth errors, weighted by their posterior probability, about its mean.
    """
    likely = _likely(found)
    # a step to the minimum completes a descent that was near it; that of one which has not arrived promises anything
    promised = found.value.step if found.promised > 0 else np.zeros(len(found.x))
    mean = sum((weight * (value.step - promised) for _, value, weight in likely), np.zeros(len(found.x)))
    names = _held_in(found.gram.columns)
    by = {name: np.zeros_like(found.value.H) for name in SOURCES}
    beside, of_held = np.zeros((len(mean), len(names))), np.zeros((len(names),) * 2)
    for sizes, value, weight in likely:
        own, across, off = _by_source(found, sizes, value)
        for name, part in own.items():
            by[name] += weight * part
        away = value.step - promised - mean
        by["instrument"] += weight * np.outer(away, away)
        if off.size:
            beside, of_held = beside + weight * across, of_held + weight * off
    return CovarianceBySource(by, mean, names, beside, of_held)


def beside_held(found: MarginalFit) -> tuple[tuple[str, ...], Reals, Reals, Reals]:
    """Return the names of held values that may be off, and by how much they most probably are, in their tolerances.

    Also the covariance of the free coordinates with that, shape (M, held), and its own, shape (held, held); all empty
    if held values are exact in this fit.
    """
    if not found.sizes.held:
        return (), np.zeros(0), np.zeros((len(found.x), 0)), np.zeros((0, 0))
    columns = found.gram.columns
    own = [k for k, part in enumerate(columns.parts) if part == "held"]
    _, across, off = _by_source(found, found.sizes, found.value)
    return _held_in(columns), found.gram.coefficients(found.sizes)[own], across, off


def _likely(found: MarginalFit) -> list[tuple[ErrorSizes, Value, float]]:
    """Return the sizes of errors that the recordings leave open, with their posterior probabilities."""
    grids = (GRIDS[name] for name in _UNSURE)
    trials = [replace(found.sizes, **dict(zip(_UNSURE, one, strict=True))) for one in product(*grids)]
    instead = evaluated(found.gram, trials)
    log_p = np.array([value.log_evidence - _too_far(value) for _, value in instead])
    weights = np.exp(log_p - np.max(log_p))
    weights = np.where(weights > _NEGLIGIBLE, weights, 0.0) / np.sum(weights[weights > _NEGLIGIBLE])
    return [(*one, weight) for one, weight in zip(instead, weights.tolist(), strict=True) if weight > 0]


def _held_in(columns: ErrorColumns) -> tuple[str, ...]:
    """Return the names of the held values that may be off, in the order of their columns."""
    return tuple(
        one.name.removeprefix(HELD)
        for part, one in zip(columns.parts, columns.corrections, strict=True)
        if part == "held" and one is not None
    )


def _too_far(value: Value) -> float:
    """Return what a step promises of ln evidence, if it is longer than the model is nearly linear; else 0."""
    far = float(np.max(np.abs(value.step), initial=0.0)) > FURTHEST
    return 0.5 * float(value.step @ value.H @ value.step) if far else 0.0


def _by_source(found: MarginalFit, sizes: ErrorSizes, value: Value) -> tuple[dict[str, Reals], Reals, Reals]:
    """Return the covariance by source for errors of these sizes, that with held values, and that of the latter."""
    made = found.gram
    on, d = made.columns.present(sizes.of_columns())
    columns = made.columns.only(on)
    kernel = Kernel(columns.points, sizes.colour, sizes.rough)
    c, j = kernel.white(columns.blocks), kernel.white(made.J)
    S = np.eye(on.size) + d[:, None] * c.squared() * d
    CJ = d[:, None] * c.times(j)
    H = value.H
    unit = np.sqrt(np.where(np.diag(H) > 0, np.diag(H), 1.0))
    inverse = np.linalg.pinv(H / unit / unit[:, None], rcond=1e-13, hermitian=True) / unit / unit[:, None]
    # A C: effect of a unit of each column on x; J^T K^-1 C = (J^T K0^-1 C) (1 + C^T K0^-1 C)^-1
    felt = inverse @ np.linalg.solve(S, CJ).T if on.size else np.zeros((len(H), 0))
    instrument = np.array([part in _INSTRUMENT for part in columns.parts], dtype=bool)
    held = np.array([part == "held" for part in columns.parts], dtype=bool)
    model = ~(instrument | held)
    by = {
        "instrument": felt[:, instrument] @ felt[:, instrument].T,
        "model": felt[:, model] @ felt[:, model].T,
        "dimensions": inverse @ made.before.P @ inverse,
        "assumptions": felt[:, held] @ felt[:, held].T,
    }
    rest = inverse - sum(by.values(), np.zeros_like(inverse))
    rough = 0.0 if not any(sizes.rough) else _rough_share(found, sizes, j.squared())
    by["noise"] = (1 - rough) * rest
    by["model"] = by["model"] + rough * rest
    off = np.linalg.inv(S)[np.ix_(held, held)] + felt[:, held].T @ H @ felt[:, held]
    return by, -felt[:, held], off


def _rough_share(found: MarginalFit, sizes: ErrorSizes, JJ: Reals) -> float:
    """Return the part of the information lost to the rough error, compared with noise alone."""
    kernel = Kernel(found.gram.columns.points, sizes.colour, (0.0, 0.0))
    alone = np.diag(kernel.white(found.gram.J).squared())
    return float(np.clip(1 - np.median(np.diag(JJ) / np.maximum(alone, 1e-300)), 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class AttributedErrors:
    """Residuals attributed to the errors at a minimum, by recording, as ln Z, each of shape (N,)."""

    instrument: tuple[Complexes, ...]
    """Of a plausible size; what goes beyond it counts as an error of the model."""
    model: tuple[Complexes, ...]
    usual: tuple[Complexes, ...]
    """Imperfections that every device has: weak lines, losses that change over the band, uneven thickness."""
    held: tuple[Complexes, ...]
    """Of values that the build holds as exact, off by no more than their tolerance."""
    off: Mapping[str, float]
    """By how much the device's value of each differs, relative; the one that changes ln Z most first."""
    left: tuple[Complexes, ...]
    """ln(Z_model/Z) minus all of these."""


def taken_up(found: MarginalFit) -> AttributedErrors:
    """Return the posterior mean of the errors of instrument and model."""
    sizes, made = found.sizes, found.gram
    on, d = made.columns.present(sizes.of_columns())
    columns = made.columns.only(on)
    none = tuple(np.zeros_like(r) for r in made.r)
    if not on.size:
        return AttributedErrors(none, none, none, none, {}, tuple(made.r))
    kernel = Kernel(columns.points, sizes.colour, sizes.rough)
    c, r = kernel.white(columns.blocks), kernel.white([own[:, None] for own in made.r])
    S = np.eye(on.size) + d[:, None] * c.squared() * d
    a = d * np.linalg.solve(S, d * c.times(r)[:, 0])
    plausible = {name: _plausible(*one) for name, one in found.deviations.items()}
    instrument = np.array([plausible[part] if part in _INSTRUMENT else 0.0 for part in columns.parts])
    held = np.array([plausible[part] if part == "held" else 0.0 for part in columns.parts])
    usual = _usual_share(columns, sizes)

    def share(part: Reals) -> tuple[Complexes, ...]:
        return tuple(b @ (part * a) for b in columns.blocks)

    left = tuple(own - b @ a for own, b in zip(made.r, columns.blocks, strict=True))
    model = 1 - instrument - usual - held
    return AttributedErrors(share(instrument), share(model), share(usual), share(held), _off(columns, held * a), left)


def _off(columns: ErrorColumns, a: Reals) -> dict[str, float]:
    """Return by how much the device's value of what is held differs, relative, given the coefficients of the columns.

    These describe ln(Z_model/Z): what they make of the model, the device lacks.
    """
    moved: dict[str, tuple[float, float]] = {}
    for k, one in enumerate(columns.corrections):
        if one is not None and columns.parts[k] == "held":
            rms = float(np.sqrt(sum(np.sum(np.abs(b[:, k] * a[k]) ** 2) for b in columns.blocks)))
            moved[one.name.removeprefix(HELD)] = rms, float(np.expm1(-a[k] * one.relative[0][0].real))
    return {name: change for name, (_, change) in sorted(moved.items(), key=lambda item: -item[1][0])}


def _plausible(squares: float, count: float) -> float:
    """Return the part of an instrument's error that is within what it exceeds in one case of twenty.

    More is not its own: a wire of 9 nH is no residual of a compensated fixture.
    """
    limit = float(chdtri(count, RARE))
    return min(1.0, float(np.sqrt(limit / max(squares, limit))))


def _usual_share(columns: ErrorColumns, sizes: ErrorSizes) -> Reals:
    """Return the part of each column's prior variance that is an imperfection every device has, shape (C,).

    So are deviations from the formulas of the effects, since an effect explains what deviates as much as real ones do,
    and what an approximate model is known to neglect.
    """
    losses = (columns.losses * sizes.losses) ** 2
    of_imaginary = losses / np.maximum(losses + (IMAGINARY * sizes.tau) ** 2, 1e-300)
    known = {"line": 1.0, "losses": 1.0, "uneven": 1.0, "shape": 1.0, "formula": 1.0}
    return np.array(
        [of_imaginary[k] if part == "imaginary" else known.get(part, 0.0) for k, part in enumerate(columns.parts)]
    )


EXACT = ErrorSizes()
"""No errors except white noise."""
