"""Bootstrap: repeat the fit on recordings that might have been measured instead.

B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap (1993). If the model describes a recording, new noise is
drawn; otherwise its own residuals are drawn in blocks, which keeps the correlation of neighbours (H. R. Kuensch, Ann.
Statist. 17 (1989) 1217). Priors are measurements too, and their means are drawn as well.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ..engine.covariance import curvature
from ..engine.descent import Descent, descend
from ..engine.objective import Objective
from ..engine.recording import Posterior, Prior, Recording, log_ratio
from ..error_model.marginal_estimate import MarginalEstimate
from ..interface import Interval

DRAWS = 200
SEED = 4294
_TOLERANCE = 1e-6
_SHORTEST = 10
_BLOCK = 4.0
# Length of a block in correlation lengths.
_P68, _P95 = (15.865, 84.135), (2.5, 97.5)


@dataclass(frozen=True, eq=False)
class Draws:
    """Results of the repeated fits."""

    values: tuple[Mapping[str, float], ...]
    """Model parameters of each fit, SI."""
    failed: int
    """Number of fits that did not converge; they are left out."""


def spread_of(numbers: Iterable[float]) -> tuple[float, Interval]:
    """Return standard deviation and percentile intervals."""
    sample = np.array(list(numbers))
    ends = [(float(np.percentile(sample, low)), float(np.percentile(sample, high))) for low, high in (_P68, _P95)]
    return float(np.std(sample, ddof=1)), Interval(*ends)


def bootstrap(descent: Descent, told: MarginalEstimate | None = None, draws: int = DRAWS, seed: int = SEED) -> Draws:
    """Repeat a fit `draws` times; the same `seed` gives the same draws.

    `told`: the answer that also counts errors of instrument and model. The draws are about its values, and what it
    knows of further variance is drawn as well.
    """
    rng = np.random.default_rng(seed)
    objective, x = descent.objective, descent.x
    values, _ = objective.coordinates.forward(x)
    fits = [
        model.impedance(r.sweep.frequency) for r, model in zip(objective.recordings, objective.models(x), strict=True)
    ]
    away, more = np.zeros(x.size), np.zeros((x.size, 0))
    if told is not None:
        half = curvature(objective, x).half
        away, more = told.x - x, _root_of_positive(told.of_x - half @ half.T)
    values_of_draws: list[Mapping[str, float]] = []
    for _ in range(draws):
        recordings = [_redrawn(r, Z, rng) for r, Z in zip(objective.recordings, fits, strict=True)]
        known: list[Prior | Posterior] = [
            replace(p, mean=rng.normal(p.predicted(values), p.u)) for p in objective.priors
        ]
        known += [_shifted(posterior, objective, x, rng) for posterior in objective.posteriors]
        again = descend(Objective(recordings, objective.coordinates, known), x, _TOLERANCE)
        if again.converged:
            there = again.x + away + more @ rng.standard_normal(more.shape[1])
            values_of_draws.append(objective.coordinates.forward(there)[0])
    return Draws(tuple(values_of_draws), draws - len(values_of_draws))


def _root_of_positive(C: Reals) -> Reals:
    """Return W with W W^T the part of a symmetric matrix that is a covariance, shape (M, M)."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(C)), 1e-300))
    eigenvalues, vectors = np.linalg.eigh(C / scale / scale[:, None])
    return scale[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, 0.0))


def _redrawn(recording: Recording, fitted: Complexes, rng: np.random.Generator) -> Recording:
    """Return a random recording that the fitted model could have given as well."""
    count = fitted.size
    if recording.misfit == 0:
        error = recording.sigma * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
    else:
        ratio = log_ratio(recording.sweep.impedance, fitted)
        length = int(np.clip(_BLOCK * recording.correlation, _SHORTEST, max(_SHORTEST, count // 4)))
        begins = rng.integers(0, count, -(-count // length))
        places = (begins[:, None] + np.arange(length)).ravel()[:count] % count
        error = ratio[places]
    return replace(recording, sweep=replace(recording.sweep, impedance=fitted * np.exp(error)))


def _shifted(posterior: Posterior, objective: Objective, x: Reals, rng: np.random.Generator) -> Posterior:
    """Return a posterior measured another time: its mean is drawn about the fitted value."""
    now, (y, _) = posterior.mean.copy(), objective.straight(x)
    for k, name in enumerate(posterior.names):
        if name in objective.coordinates.free:
            now[k] = y[objective.coordinates.free.index(name)]
    drawn = np.linalg.lstsq(posterior.root, rng.standard_normal(len(posterior.root)), rcond=1e-12)[0]
    return replace(posterior, mean=now + drawn)
