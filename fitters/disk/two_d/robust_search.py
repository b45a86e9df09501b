"""Search for the right valley beside something that changes parts of the band beyond recognition.

A dot on a face has a satellite at every resonance of the disk: it changes a point in ten by its own size, and most by a
few per cent. By least squares the few decide, and wrong constants imitate them; by Cauchy's loss the many do.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ....models.disk2d.disk_model import Disk2D
from ...engine.descent import descend
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior, Recording, log_ratio
from ...interface import UNCOMPUTABLE
from ..bare_disk import BareDisk
from .broadened import broadened
from .tensor_start import matched
from .valley_search import ROUGH, SAME, Bottom, thinned

POINTS = 200
"""Of each sweep."""
_STAGES = ((1.0, 10, 9), (0.3, 8, 12), (0.1, 6, 15), (0.03, 4, 18))
_WIDE = 0.1
# Successive scales of the loss, the number of places that are followed, and the steps from each; scale from which
# resonances are broadened.
_PER_WEIGHT, _UNMOVED = 3, 1e-3
# Steps of a descent before its points are weighted anew, and the change from which that no longer matters.


def robustly_searched(
    disk: BareDisk,
    model: Disk2D,
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Prior | Posterior],
    jobs: int = 1,
) -> Bottom:
    """Return the deepest valley that the library's ceramics lead to; `jobs`: number of processes."""
    model = replace(model, rough=True)
    places: list[Reals] = [coordinates.inverse(start) for start in matched(disk, model, coordinates, {})]
    seen, wide = (
        Objective([replace(thinned(one, POINTS), model=model) for one in those], coordinates, priors)
        for those in (recordings, list(map(broadened, recordings)))
    )
    return followed_robustly([(wide if one[0] >= _WIDE else seen, *one) for one in _STAGES], places, jobs)[0]


def followed_robustly(
    stages: Sequence[tuple[Objective, float, int, int]], places: Sequence[Reals], jobs: int
) -> list[Bottom]:
    """Return where descents from `places` lead to, the deepest first.

    `stages`: objectives with the scale of the loss, the number of places followed, and the steps from each.
    """
    found = [Bottom(x, math.inf, 0) for x in places]
    for objective, scale, count, most in stages:
        starts = [bottom.x for bottom in found[:count]]
        found = _distinct(on_cores([partial(_reached, objective, x, scale, most) for x in starts], jobs))
    return found


def _reached(objective: Objective, x: Reals, scale: float, most: int) -> Bottom:
    """Return where a descent ends; where it began, at infinite cost, if it comes to where there is no such device."""
    try:
        return robust_bottom(objective, x, scale, most)
    except UNCOMPUTABLE:
        return Bottom(x, math.inf, 0)


def _distinct(bottoms: Sequence[Bottom]) -> list[Bottom]:
    """Return these, the deepest first, without those that are close to a deeper one."""
    kept: list[Bottom] = []
    for bottom in sorted(bottoms, key=lambda bottom: bottom.cost):
        if not any(np.abs(bottom.x - other.x).max() < SAME for other in kept):
            kept.append(bottom)
    return kept


def robust_bottom(objective: Objective, x: Reals, scale: float, most: int) -> Bottom:
    """Descend by Cauchy's loss, ln(1 + |ln(Z_model/Z)|^2 / scale^2): least squares with weights chosen anew."""
    evaluations, known = 0, (*objective.priors, *objective.posteriors)
    for _ in range(0, most, _PER_WEIGHT):
        weighted = [
            replace(one, noise=np.hypot(size, np.abs(ratio)), misfit=0.0, correlation=1.0)
            for one, size, ratio in _scaled(objective, x, scale)
        ]
        end = descend(Objective(weighted, objective.coordinates, known), x, ROUGH, _PER_WEIGHT)
        evaluations += end.evaluations
        moved, x = float(np.abs(end.x - x).max()), end.x
        if moved < _UNMOVED:
            break
    return Bottom(x, robust_cost(objective, x, scale), evaluations)


def robust_cost(objective: Objective, x: Reals, scale: float) -> float:
    """Return the sum of Cauchy's loss over all points, and what priors add."""
    of_priors = objective.residual(x)[2 * objective.points :]
    losses = (_loss(ratio, size) for _, size, ratio in _scaled(objective, x, scale))
    return sum(losses) + float(of_priors @ of_priors) / 2


def loss_of(recording: Recording, Z: Impedances, scale: float) -> float:
    """Return the sum of Cauchy's loss over the points of a recording, for an impedance that should describe it."""
    return _loss(log_ratio(Z, recording.sweep.impedance), np.hypot(scale, recording.noise))


def _loss(ratio: Complexes, size: Reals) -> float:
    return float(np.sum(np.log1p(np.abs(ratio / size) ** 2)))


def _scaled(objective: Objective, x: Reals, scale: float) -> list[tuple[Recording, Reals, Complexes]]:
    """Return each recording with the scale of its loss and ln(Z_model/Z), shapes (N,)."""
    pairs = zip(objective.recordings, objective.log_ratios(x), strict=True)
    return [(one, np.hypot(scale, one.noise), ratio) for one, ratio in pairs]
