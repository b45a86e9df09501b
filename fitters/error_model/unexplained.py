"""What of a recording neither the constants nor errors of the instrument explain."""

from collections.abc import Collection

import numpy as np

from ...models.base.arrays import Complexes, Reals
from .marginal_fit import MarginalFit
from .point_covariance import under_colour
from .uncertainty_sources import taken_up


def beyond_constants(found: MarginalFit, changes: list[list[Complexes]], others: Collection[str] = ()) -> Reals:
    """Return changes of ln Z of each recording after projecting out the constants, as columns of shape (2N, K).

    `others`: free coordinates that are no constants but parameters of effects.
    """
    free = found.marginal.objective.coordinates.free
    slopes = np.concatenate(found.gram.J)[:, [k for k, name in enumerate(free) if name not in others]]
    rows = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(rows, axis=0)
    Q, _ = np.linalg.qr(rows[:, size > 0] / size[size > 0])
    whole = np.stack([np.concatenate(change) for change in changes], axis=1)
    both = np.concatenate([whole.real, whole.imag])
    return both - Q @ (Q.T @ both)


def unexplained_at(found: MarginalFit, others: Collection[str] = ()) -> Reals:
    """Return the squared model error |ln Z|^2 at each point, after projecting out the constants; shape (N,).

    What every device has does not count. The rough part contains the noise, whose variance is subtracted: sums over
    many points are meaningful, single values may be negative. `others`: as for `beyond_constants`.
    """
    taken = taken_up(found)
    both = beyond_constants(found, [list(taken.model), list(taken.left)], others)
    noise = np.concatenate([own.noise for own in found.gram.columns.points]) / under_colour(found.sizes.colour)
    model, rough = (both**2).reshape(2, -1, 2).sum(axis=0).T
    return np.asarray(np.where(np.isfinite(noise), model + rough - 2 * noise**2, model), np.float64)


def rms_of(squares: Reals) -> float:
    """Return the rms of what `unexplained_at` returns; 0 where the noise subtracted is more than all of it."""
    return float(np.sqrt(max(0.0, float(np.mean(squares)))))
