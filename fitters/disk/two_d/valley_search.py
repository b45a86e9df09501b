"""Search for the right valley: from every ceramic of the library to a start for the final descent."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np

from ....models.base.arrays import Reals
from ....models.disk2d.disk_model import Disk2D
from ...engine.descent import descend
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior, Recording
from ...interface import FitError
from ..bare_disk import BareDisk
from .broadened import Broadening
from .tensor_start import matched

Known: TypeAlias = Prior | Posterior
COARSE = 400
# Points of each sweep for the search.
_SEARCH = ((1.0, 10, 10), (0.3, 6, 15), (0.1, 4, 20), (0.03, 2, 20), (0.01, 1, 25))
_HURRIED = tuple((misfit, max(1, count // 3), most) for misfit, count, most in _SEARCH)
# Successive misfits that the search counts as noise, the number of places that it follows, and the steps from each.
_FAR, _SAME = 4.0, 0.02
# Places that cost this many times as much as the best, or are this close to a better one, are dropped.
_ROUGH = 3e-3
_WIDE, DAMPING = 0.1, 0.0125
# Misfit from which resonances are broadened, and by what loss tangent: together with that of the hardest ceramic it is
# the usual one of a soft one.
_MERGED, _SMOOTH = 0.2, ((0.3, 12, 10), (0.1, 8, 10))
# Loss tangent by which overtones merge, which are a tenth of their frequency apart or less, and the search there.
FEW = 200
# Points of each sweep where a curve takes ten times as long, with a dot on a face.


def searched(
    disk: BareDisk,
    model: Disk2D,
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Known],
    enough: float = 0.0,
    hopeless: float = math.inf,
    jobs: int = 1,
) -> tuple[Reals, int]:
    """Return the bottom of the deepest valley, and the number of evaluations; `jobs`: number of processes.

    Misfit is counted as noise, less and less of it: the more, the wider the valleys. If the most promising places alone
    lead below `enough`, rms of ln Z, no others are followed; if they leave more than `hopeless`, FitError is raised.
    """
    model = replace(model, rough=True)
    places: list[Reals] = [coordinates.inverse(start) for start in matched(disk, model, coordinates, {})]
    coarse = [replace(thinned(recording), model=model) for recording in recordings]
    evaluations = len(places)
    wide = broader(recordings, model, DAMPING, COARSE)
    if enough > 0:
        x, more = followed(coarse, coordinates, priors, places, _HURRIED, jobs, wide)
        ratios = Objective(coarse, coordinates, ()).log_ratios(x)
        left = max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in ratios)
        evaluations += more
        if left > hopeless:
            raise FitError(f"a disk of finite diameter leaves {left:.2g} of ln Z, more than {hopeless:.2g}")
        if left < enough:
            return x, evaluations
    x, more = followed(coarse, coordinates, priors, places, _SEARCH, jobs, wide)
    return x, evaluations + more


def smoothest(
    disk: BareDisk,
    model: Disk2D,
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Known],
    jobs: int = 1,
) -> tuple[Reals, int]:
    """Return the bottom of the valley that is left if overtones merge, and the number of evaluations.

    What acts on single resonances, such as a dot on a face, hardly matters there; constants of motion along the disk
    are near their priors. `jobs`: number of processes.
    """
    model = replace(model, rough=True)
    places: list[Reals] = [coordinates.inverse(start) for start in matched(disk, model, coordinates, {})]
    return followed(broader(recordings, model, _MERGED, COARSE), coordinates, priors, places, _SMOOTH, jobs)


def broader(recordings: Sequence[Recording], model: Disk2D, damping: float, points: int) -> list[Recording]:
    """Return recordings with broadened resonances, of at most so many points, with the model of a disk damped alike."""
    damped, wide = replace(model, damping=damping), (Broadening.of(one).by(damping, points) for one in recordings)
    return [replace(one, model=damped) for one in wide]


def followed(
    coarse: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Known],
    places: list[Reals],
    search: Sequence[tuple[float, int, int]],
    jobs: int,
    wide: Sequence[Recording] = (),
) -> tuple[Reals, int]:
    """Return the deepest place that descents from `places` lead to, and the number of evaluations.

    `search`: successive misfits that are counted as noise, the number of places followed, and the steps from each.
    `wide`: the recordings with broader resonances, if there are such, to be used as long as misfits are large.
    """
    evaluations = 0
    for misfit, count, most in search:
        seen = wide if wide and misfit >= _WIDE else coarse
        objective = Objective([replace(each, misfit=misfit) for each in seen], coordinates, priors)
        tried = on_cores([partial(bottom_near, objective, x, most) for x in places[:count]], jobs)
        evaluations += sum(bottom.evaluations for bottom in tried)
        apart = distinct(tried)
        places = [bottom.x for bottom in apart if bottom.cost < _FAR * apart[0].cost]
    return places[0], evaluations


@dataclass(frozen=True, eq=False)
class Bottom:
    """End of a descent."""

    x: Reals
    cost: float
    evaluations: int


def distinct(bottoms: Sequence[Bottom]) -> list[Bottom]:
    """Return these, the deepest first, without those that are close to a deeper one."""
    kept: list[Bottom] = []
    for bottom in sorted(bottoms, key=lambda bottom: bottom.cost):
        if not any(np.abs(bottom.x - other.x).max() < _SAME for other in kept):
            kept.append(bottom)
    return kept


def bottom_near(objective: Objective, x: Reals, most: int) -> Bottom:
    """Return where a descent of so many steps at most ends."""
    end = descend(objective, x, _ROUGH, most)
    return Bottom(end.x, end.cost, end.evaluations)


def thinned(recording: Recording, points: int = COARSE) -> Recording:
    """Return the recording with every n-th point only, about so many."""
    every = max(1, recording.sweep.frequency.size // points)
    return replace(recording, sweep=recording.sweep.at(slice(None, None, every)), noise=recording.noise[::every])
