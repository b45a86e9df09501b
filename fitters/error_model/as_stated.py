"""Constants for the values that a build states as exact, where the recordings tell less of these than it does.

A density and a compliance that only together determine a resonance move freely along each other: a fit ends anywhere
within the density's tolerance, and its compliance describes the recordings with that density only. What is told
belongs to the build as it is stated, unless the recordings know better.
"""

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from ...models.base.arrays import Reals
from ...models.effects.base.corrected_constants import Corrections
from ..engine.recording import rms
from .joint_descent import FURTHEST
from .marginal_fit import MarginalFit
from .prior_scales import RARE
from .uncertainty_sources import beside_held

_HALF = 0.5
"""Variance of a value, in its tolerance squared, above which the build tells more of it than the recordings do."""


def as_stated(found: MarginalFit) -> MarginalFit:
    """Return the same fit with the constants that are most probable if held values are as the build states them.

    Those stay off of which the recordings tell more than the build, or which they contradict, as they do by chance in
    one build of twenty; and all of them, if the constants would not describe the recordings better.
    """
    names, off, beside, covariance = beside_held(found)
    kept = _not_contradicted(off, covariance)
    if not kept:
        return found
    move = -np.linalg.solve(covariance[np.ix_(kept, kept)], off[kept])
    dx = beside[:, kept] @ move
    if not np.max(np.abs(dx), initial=0.0) < FURTHEST:
        return found  # further than the model is linear
    minimum = replace(found.minimum, x=found.x + dx)
    known = found.minimum.corrections
    if known is not None:
        stated = {names[k] for k in kept}
        held = {name: value for name, value in known.held.items() if name not in stated}
        minimum = replace(minimum, corrections=Corrections(known.log_f, known.relative, known.paths, held))
    made = MarginalFit.at(found.marginal, minimum)
    return made if rms(*made.left_by_the_model) < rms(*found.left_by_the_model) else found


def _not_contradicted(off: Reals, covariance: Reals) -> list[int]:
    """Return the positions of the values that may be as stated, all together, by how far they are `off`."""
    kept = [k for k in range(off.size) if covariance[k, k] > _HALF]
    while kept:
        own = covariance[np.ix_(kept, kept)]
        if float(off[kept] @ np.linalg.solve(own, off[kept])) <= float(chdtri(len(kept), RARE)):
            break
        away = np.abs(off[kept]) / np.sqrt(np.diag(own))
        del kept[int(np.argmax(away))]
    return kept
