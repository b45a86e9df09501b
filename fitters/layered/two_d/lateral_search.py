"""Search for the constants that the one-dimensional answer does not know: those of motion along the disk.

A wrong order of the radial overtones looks like the right one: there are hundreds of minima, each some per cent wide,
and a band around the thickness resonance shows overtones of order twenty to fifty. Random starts from the prior and
random steps from the best minima so far are ranked, and the best are followed, until one describes the recordings.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Reals
from ...disk.two_d.misfit_as_noise import left_of
from ...disk.two_d.valley_search import followed
from ...engine.objective import Objective
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior, Recording

_RANKED = 0.1
# Misfit of ln Z that counts as noise in the comparison of starts.
_SEARCH = ((0.1, 16, 6), (0.05, 8, 8), (0.02, 4, 12), (0.004, 2, 15))
# Successive misfits that count as noise, the number of places followed, and the steps from each.
_NEAR, _KEPT = 0.35, 4
# Random steps from the best minima, in the standard deviation of what is drawn, and the number of these minima.
_DESCRIBED = 2.0
# Misfit over that expected of noise and model up to which a minimum ends the search.


@dataclass(frozen=True)
class Effort:
    """How long a search goes on."""

    rounds: int
    draws: int
    """Random starts in each round."""


def searched(
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Prior | Posterior],
    given: Sequence[Reals],
    drawn: Callable[[int], Sequence[Reals]],
    effort: Effort,
    error: float,
) -> tuple[Reals, int]:
    """Return the best minimum found, and the number of evaluations.

    `given`: starts; `drawn(n)` returns n random ones. `error`: of the models, relative to Z; a minimum that describes
    the recordings to their noise and this error ends the search.
    """
    rng = np.random.default_rng(0)
    ranking = Objective([replace(one, misfit=_RANKED) for one in recordings], coordinates, priors)
    expected = math.sqrt(sum(float(np.sum(2 * one.noise**2 + error**2)) for one in recordings))
    starts, minima, evaluations = list(given), list[tuple[float, Reals]](), 0
    for _ in range(effort.rounds):
        fresh = list(drawn(effort.draws))
        starts += fresh
        spread = _NEAR * np.std(np.array(fresh), axis=0)
        for _, x in minima[:_KEPT]:
            starts += [x + spread * rng.normal(size=x.size) for _ in range(effort.draws // _KEPT)]
        costs = np.array([float(np.sum(ranking.residual(x) ** 2)) for x in starts])
        best: list[Reals] = [starts[k] for k in np.argsort(costs).tolist()]
        x, more = followed(recordings, coordinates, priors, best, _SEARCH, 1)
        evaluations += more + len(starts)
        minima.append((left_of(recordings, coordinates, x), x))
        minima.sort(key=lambda one: one[0])
        starts = []
        if minima[0][0] < _DESCRIBED * expected:
            break
    return minima[0][1], evaluations
