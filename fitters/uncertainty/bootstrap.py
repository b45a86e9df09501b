"""Bootstrap: the fit repeated on recordings that might have been measured instead.

B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap (1993). Where the model describes a recording, its noise is
drawn anew; elsewhere its own residuals are drawn in blocks, with what they share with their neighbours (H. R. Kuensch,
Ann. Statist. 17 (1989) 1217). What was known before is a measurement too, and is drawn anew as well.
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
# Length of a block in lengths of correlation.
_P68, _P95 = (15.865, 84.135), (2.5, 97.5)


@dataclass(frozen=True, eq=False)
class Draws:
    """What the repeated fits found."""

    values: tuple[Mapping[str, float], ...]
    """Model parameters of each, SI."""
    failed: int
    """Fits that did not converge; they are left out."""


def spread_of(numbers: Iterable[float]) -> tuple[float, Interval]:
    """Return standard deviation and percentile intervals."""
    found = np.array(list(numbers))
    ends = [(float(np.percentile(found, low)), float(np.percentile(found, high))) for low, high in (_P68, _P95)]
    return float(np.std(found, ddof=1)), Interval(*ends)


def bootstrap(descent: Descent, draws: int = DRAWS, seed: int = SEED) -> Draws:
    """Repeat a fit `draws` times; the same `seed` draws the same."""
    rng = np.random.default_rng(seed)
    objective, x = descent.objective, descent.x
    values, _ = objective.coordinates.forward(x)
    fits = [
        model.impedance(r.sweep.frequency) for r, model in zip(objective.recordings, objective.models(x), strict=True)
    ]
    found: list[Mapping[str, float]] = []
    for _ in range(draws):
        recordings = [_redrawn(r, Z, rng) for r, Z in zip(objective.recordings, fits, strict=True)]
        known: list[Prior | Posterior] = [
            replace(p, mean=rng.normal(values[p.parameter], p.u)) for p in objective.priors
        ]
        known += [_shifted(posterior, objective, x, rng) for posterior in objective.posteriors]
        again = descend(Objective(recordings, objective.coordinates, known), x, _TOLERANCE)
        if again.converged:
            found.append(objective.coordinates.forward(again.x)[0])
    return Draws(tuple(found), draws - len(found))


def _redrawn(recording: Recording, fitted: Complexes, rng: np.random.Generator) -> Recording:
    """Return a recording that the fitted model might have given as well."""
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
    """Return a posterior that was measured another time: its mean about what the fit found."""
    now, (y, _) = posterior.mean.copy(), objective.straight(x)
    for k, name in enumerate(posterior.names):
        if name in objective.coordinates.free:
            now[k] = y[objective.coordinates.free.index(name)]
    drawn = np.linalg.lstsq(posterior.root, rng.standard_normal(len(posterior.root)), rcond=1e-12)[0]
    return replace(posterior, mean=now + drawn)
