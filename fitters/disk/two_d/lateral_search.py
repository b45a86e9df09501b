"""Search for the constants that the one-dimensional answer does not know: those of motion along the disk.

A wrong order of the radial overtones looks like the right one: there are hundreds of minima, each some per cent wide,
and a band around the thickness resonance shows overtones of order twenty to fifty. Random starts from the prior and
random steps from the best minima so far are ranked, and the best are followed, until one describes the recordings.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....models.base.arrays import Reals
from ...engine.descent import descend
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior, Recording
from .misfit_as_noise import left_of
from .valley_search import followed

_WIDE = ((0.3, 16, 8), (0.1, 8, 10), (0.03, 4, 12))
_NARROW = ((0.1, 16, 6), (0.05, 8, 8), (0.02, 4, 12))
# Successive misfits of ln Z that count as noise, the number of places followed, and the steps from each. Starts are
# compared at the first misfit. Few sharp modes (D/t 10) need the wide search, many overlapping ones (D/t 30) the other.
_LAST, _FINE, _MOST = 0.004, 1e-3, 15
# Misfit that counts as noise, tolerance and steps of the last descent, with the exact models.
_NEAR, _KEPT = 0.35, 4
# Random steps from the best minima, in the standard deviation of what is drawn, and the number of these minima.
_DESCRIBED = 2.0
# Misfit over that expected of the noise up to which a minimum ends the search.


_SHARES = 16
# Parts of a ranking, which processes compute one after the other.


@dataclass(frozen=True)
class Effort:
    """How long a search goes on."""

    rounds: int
    draws: int
    """Random starts in each round."""


def searched(
    rough: Sequence[Recording],
    exact: Sequence[Sequence[Recording]],
    coordinates: Coordinates,
    priors: Sequence[Prior | Posterior],
    given: Sequence[Reals],
    drawn: Callable[[int], Sequence[Reals]],
    effort: Effort,
    enough: float = 0.0,
    jobs: int = 1,
    wide: Sequence[Recording] = (),
) -> tuple[Reals, int, int]:
    """Return the best minimum found, the index of its models in `exact`, and the number of evaluations.

    `rough`: recordings with quick models. `wide`: the same with broadened resonances, if these are to be used as long
    as misfits are large. `exact`: recordings with models that say whether a minimum describes them, which ends the
    search; there may be several kinds of these. `given`: starts that are followed first; `drawn(n)` returns n random
    ones for later rounds. `enough`: rms of ln Z that ends the search as well. `jobs`: number of processes.
    """
    rng = np.random.default_rng(0)
    expected = math.sqrt(sum(float(np.sum(2 * one.noise**2)) for one in exact[0]))
    points = sum(one.sweep.frequency.size for one in exact[0])
    wanted = max(_DESCRIBED * expected, enough * math.sqrt(points))
    starts, minima, evaluations = list(given), list[tuple[float, int, Reals]](), 0
    for k in range(1 + effort.rounds):
        if k:
            starts = list(drawn(effort.draws))
            spread = _NEAR * np.std(np.array(starts), axis=0)
            for *_, x in minima[:_KEPT]:
                starts += [x + spread * rng.normal(size=x.size) for _ in range(effort.draws // _KEPT)]
        search = _NARROW if k % 2 else _WIDE
        ranking = Objective([replace(one, misfit=search[0][0]) for one in wide or rough], coordinates, priors)
        costs = on_cores([partial(_cost, ranking, starts[k::_SHARES]) for k in range(_SHARES)], jobs)
        order = np.argsort([costs[k % _SHARES][k // _SHARES] for k in range(len(starts))])
        best: list[Reals] = [starts[k] for k in order.tolist()]
        x, more = followed(rough, coordinates, priors, best, search, jobs, wide)
        evaluations += len(starts) + more
        for kind, judging in enumerate(exact):
            last = Objective([replace(one, misfit=_LAST) for one in judging], coordinates, priors)
            end = descend(last, x, _FINE, _MOST)
            evaluations += end.evaluations
            minima.append((left_of(judging, coordinates, end.x), kind, end.x))
        minima.sort(key=lambda one: one[:2])
        if minima[0][0] < wanted:
            break
    _, kind, x = minima[0]
    return x, kind, evaluations


def _cost(ranking: Objective, starts: Sequence[Reals]) -> list[float]:
    return [ranking.cost(x) for x in starts]
