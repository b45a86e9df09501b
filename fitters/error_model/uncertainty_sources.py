"""Uncertainties by source: contributions of noise, instrument, model error and dimensions, which add in quadrature.

The estimate is linear in the data: x = A y, A = H^-1 J^T K^-1 with K the covariance of everything except constants. Its
covariance H^-1 is therefore A K A^T plus the contribution of the priors, and K is a sum over sources.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from ...models.base.arrays import Complexes, Reals
from .error_columns import ErrorColumns
from .error_sizes import GRIDS, ErrorSizes, Value, chosen
from .marginal_fit import MarginalFit
from .point_covariance import Kernel
from .prior_scales import IMAGINARY

SOURCES = ("noise", "instrument", "model", "dimensions")
_INSTRUMENT = ("slow", "fast", "fixture")
_BESIDE_THE_INSTRUMENT = ("tau", "losses", "fixture", "held")
"""Sizes that are re-estimated for each size of the slow instrument error."""
_ONE_IN_TWENTY = 0.05
_NEGLIGIBLE = 1e-3
"""Posterior probability below which sizes do not affect an uncertainty."""


@dataclass(frozen=True, eq=False)
class CovarianceBySource:
    """Covariance of the free coordinates of a fit, by source; each of shape (M, M)."""

    by: Mapping[str, Reals]

    @property
    def whole(self) -> Reals:
        """The sum, shape (M, M)."""
        return sum(self.by.values(), np.zeros_like(self.by["noise"]))

    def of(self, chain: Reals) -> dict[str, Reals]:
        """Return the standard uncertainty of parameters by source, with d parameter / d x = `chain`, shape (P, M)."""
        return {name: np.sqrt(np.maximum(np.einsum("pm,mn,pn->p", chain, C, chain), 0)) for name, C in self.by.items()}


def spread_of(found: MarginalFit) -> CovarianceBySource:
    """Return the covariance at a minimum by source.

    Recordings often do not determine how much of a smooth error is the instrument's, but constants depend on it. The
    result is therefore that of the mixture over sizes of the instrument's error, weighted by their posterior
    probability.
    """
    instead = [chosen(found.gram, (found.sizes.at("slow", size),), _BESIDE_THE_INSTRUMENT) for size in GRIDS["slow"]]
    log_p = np.array([value.log_evidence for _, value in instead])
    weights = np.exp(log_p - np.max(log_p)) / np.sum(np.exp(log_p - np.max(log_p)))
    by = {name: np.zeros_like(found.value.H) for name in SOURCES}
    for (sizes, value), weight in zip(instead, weights.tolist(), strict=True):
        if weight < _NEGLIGIBLE:
            continue
        for name, part in _by_source(found, sizes, value).items():
            by[name] += weight * part
        away = value.step - found.value.step
        by["instrument"] += weight * np.outer(away, away)
    return CovarianceBySource(by)


def _by_source(found: MarginalFit, sizes: ErrorSizes, value: Value) -> dict[str, Reals]:
    """Return the covariance by source for errors of these sizes."""
    made = found.gram
    scale = made.columns.scaled(sizes.of_columns())
    on = np.flatnonzero(scale > 0)
    columns, d = made.columns.only(on), scale[on]
    kernel = Kernel(columns.points, sizes.colour, sizes.rough)
    c, j = kernel.white(columns.blocks), kernel.white(made.J)
    CC = d[:, None] * c.squared() * d
    CJ = d[:, None] * c.times(j)
    JJ = j.squared()
    H = value.H
    unit = np.sqrt(np.where(np.diag(H) > 0, np.diag(H), 1.0))
    inverse = np.linalg.pinv(H / unit / unit[:, None], rcond=1e-13, hermitian=True) / unit / unit[:, None]
    # A C: effect of a unit of each column on x; J^T K^-1 C = (J^T K0^-1 C) (1 + C^T K0^-1 C)^-1
    felt = inverse @ np.linalg.solve(np.eye(on.size) + CC, CJ).T if on.size else np.zeros((len(H), 0))
    instrument = np.array([part in _INSTRUMENT for part in columns.parts], dtype=bool)
    held = np.array([part == "held" for part in columns.parts], dtype=bool)
    model = ~(instrument | held)
    by = {
        "instrument": felt[:, instrument] @ felt[:, instrument].T,
        "model": felt[:, model] @ felt[:, model].T,
        "dimensions": inverse @ made.before.P @ inverse + felt[:, held] @ felt[:, held].T,
    }
    rest = inverse - sum(by.values(), np.zeros_like(inverse))
    rough = 0.0 if not any(sizes.rough) else _rough_share(found, sizes, JJ)
    by["noise"] = (1 - rough) * rest
    by["model"] = by["model"] + rough * rest
    return by


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
    """Imperfections that every device has: weak lines, losses that change over the band, uneven thickness, and values
    of the build that are off by no more than their tolerance."""
    left: tuple[Complexes, ...]
    """ln(Z_model/Z) minus all of these."""


def taken_up(found: MarginalFit) -> AttributedErrors:
    """Return the posterior mean of the errors of instrument and model."""
    sizes, made = found.sizes, found.gram
    scale = made.columns.scaled(sizes.of_columns())
    on = np.flatnonzero(scale > 0)
    columns, d = made.columns.only(on), scale[on]
    none = tuple(np.zeros_like(r) for r in made.r)
    if not on.size:
        return AttributedErrors(none, none, none, tuple(made.r))
    kernel = Kernel(columns.points, sizes.colour, sizes.rough)
    c, r = kernel.white(columns.blocks), kernel.white([own[:, None] for own in made.r])
    S = np.eye(on.size) + d[:, None] * c.squared() * d
    a = d * np.linalg.solve(S, d * c.times(r)[:, 0])
    plausible = {name: _plausible(*one) for name, one in found.deviations.items()}
    instrument = np.array([plausible[part] if part in _INSTRUMENT else 0.0 for part in columns.parts])
    held = np.array([plausible[part] if part == "held" else 0.0 for part in columns.parts])
    usual = _usual_share(columns, sizes) + held

    def share(part: Reals) -> tuple[Complexes, ...]:
        return tuple(b @ (part * a) for b in columns.blocks)

    left = tuple(own - b @ a for own, b in zip(made.r, columns.blocks, strict=True))
    return AttributedErrors(share(instrument), share(1 - instrument - usual), share(usual), left)


def _plausible(squares: float, count: int) -> float:
    """Return the part of an instrument's error that is within what it exceeds in one case of twenty.

    More is not its own: a wire of 9 nH is no residual of a compensated fixture.
    """
    limit = float(chdtri(count, _ONE_IN_TWENTY))
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
