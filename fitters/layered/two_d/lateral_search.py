"""Search for the constants that the one-dimensional answer does not know: those of motion along the disk.

A wrong order of the radial overtones looks like the right one: there are hundreds of minima, each some per cent wide,
and a band around the thickness resonance shows overtones of order twenty to fifty. Random tensors of the prior and
random steps from the best minima so far are ranked, and the best are followed, until one describes the recording.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ...disk.two_d.misfit_as_noise import left_of
from ...disk.two_d.valley_search import followed
from ...engine.objective import Objective
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior, Recording

_RANKED = 0.1
# Misfit of ln Z that counts as noise in the comparison of starts.
_SEARCH = ((0.1, 20, 6), (0.05, 8, 8), (0.02, 4, 12))
# Successive misfits that count as noise, the number of places followed, and the steps from each.
_ENOUGH = 3e-3
# Rms of ln Z below which the search ends: wrong minima leave more than one per cent.
_NEAR, _KEPT = 0.35, 4
# Random steps from the best minima, in the standard deviation of the drawn tensors, and the number of these minima.


def searched(
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Prior | Posterior],
    given: Sequence[Reals],
    drawn: Callable[[int], Sequence[Reals]],
    rounds: int,
    count: int,
) -> tuple[Reals, int]:
    """Return the best minimum found, and the number of evaluations.

    `given`: starts; `drawn(n)` returns n random ones. `rounds` of `count` draws are made at most.
    """
    rng = np.random.default_rng(0)
    ceramic = np.array([".tensor." in name for name in coordinates.free])
    ranking = Objective([replace(one, misfit=_RANKED) for one in recordings], coordinates, priors)
    starts, minima, evaluations = list(given), list[tuple[float, Reals]](), 0
    for _ in range(rounds):
        fresh = [*drawn(count)]
        starts += fresh
        spread = np.std(np.array(fresh), axis=0) * ceramic * _NEAR
        for _, x in minima[:_KEPT]:
            starts += [x + spread * rng.normal(size=x.size) for _ in range(count // _KEPT)]
        costs = [float(np.sum(ranking.residual(x) ** 2)) for x in starts]
        best = [starts[k] for k in np.argsort(costs).tolist()]
        x, more = followed(recordings, coordinates, priors, best, _SEARCH, 1)
        evaluations += more + len(starts)
        minima.append((left_of(recordings, coordinates, x), x))
        minima.sort(key=lambda one: one[0])
        starts = []
        if minima[0][0] < _ENOUGH * np.sqrt(sum(one.noise.size for one in recordings)):
            break
    return minima[0][1], evaluations
