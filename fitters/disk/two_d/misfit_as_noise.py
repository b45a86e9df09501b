"""Descents that count the misfit as noise, for models that describe no recording to its noise everywhere."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ...engine.descent import Descent, with_model_discrepancy
from ...engine.objective import Objective
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior, Recording


def left_of(recordings: Sequence[Recording], coordinates: Coordinates, x: Reals) -> float:
    """Return the norm of the residual ln(Z_model/Z) over all recordings."""
    ratios = Objective(recordings, coordinates, ()).log_ratios(x)
    return math.sqrt(sum(float(np.sum(np.abs(ratio) ** 2)) for ratio in ratios))


def at_level(recording: Recording, coordinates: Coordinates, x: Reals) -> Recording:
    """Return the recording with its misfit counted as noise of independent points.

    This determines the minimum; the effect of correlated misfit on the uncertainty is left to the covariance.
    """
    (ratio,) = Objective([recording], coordinates, ()).log_ratios(x)
    return replace(with_model_discrepancy(recording, ratio), correlation=1.0)


def judged(
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Prior | Posterior],
    x: Reals,
    settled: bool,
    evaluations: int,
) -> Descent:
    """Return a minimum `x` with the misfit of each recording as noise, correlated points counted once."""
    ratios = Objective(recordings, coordinates, priors).log_ratios(x)
    objective = Objective(list(map(with_model_discrepancy, recordings, ratios)), coordinates, priors)
    cost = float(np.sum(objective.residual(x) ** 2)) / 2
    return Descent(objective, coordinates.x, x, cost, settled, evaluations)
