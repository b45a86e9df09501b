"""The proof: misfit on bands that took no part in the fit, before and after."""

import numpy as np

from .bands import held_out
from .decide import resoftened
from .problem import Problem
from .search import Refit, refit


def held_out_chi2(problem: Problem, found: Refit) -> float:
    """Return the misfit per degree of freedom on the held-out bands, of a fit to everything else."""
    masks = [held_out(recording.sweep) for recording in problem.recordings]
    again = refit(resoftened(problem, found).without(masks), found.effects, found.values, None, tolerance=1e-8)
    ratios = again.objective.log_ratios(again.descent.x)
    total = points = 0.0
    for recording, ratio, mask in zip(problem.recordings, ratios, masks, strict=True):
        total += float(np.sum(np.abs(ratio[mask] / recording.noise[mask]) ** 2)) / 2
        points += float(mask.sum())
    return total / max(points, 1.0)
