"""Bootstrap: repeat the fit on recordings that might have been measured instead.

B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap (1993). If the model describes a recording, new noise is
drawn; otherwise its own residuals are drawn in blocks, which keeps the correlation of neighbours (H. R. Kuensch, Ann.
Statist. 17 (1989) 1217). Priors are measurements too, and their means are drawn as well.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ..engine.descent import Descent, descend
from ..engine.objective import Objective
from ..engine.recording import Posterior, Prior, Recording, log_ratio
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


def bootstrap(descent: Descent, draws: int = DRAWS, seed: int = SEED) -> Draws:
    """Repeat a fit `draws` times; the same `seed` gives the same draws."""
    rng = np.random.default_rng(seed)
    objective, x = descent.objective, descent.x
    values, _ = objective.coordinates.forward(x)
    fits = [
        model.impedance(r.sweep.frequency) for r, model in zip(objective.recordings, objective.models(x), strict=True)
    ]
    values_of_draws: list[Mapping[str, float]] = []
    for _ in range(draws):
        recordings = [_redrawn(r, Z, rng) for r, Z in zip(objective.recordings, fits, strict=True)]
        known: list[Prior | Posterior] = [
            replace(p, mean=rng.normal(p.predicted(values), p.u)) for p in objective.priors
        ]
        known += [_shifted(posterior, objective, x, rng) for posterior in objective.posteriors]
        again = descend(Objective(recordings, objective.coordinates, known), x, _TOLERANCE)
        if again.converged:
            values_of_draws.append(objective.coordinates.forward(again.x)[0])
    return Draws(tuple(values_of_draws), draws - len(values_of_draws))


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
