"""Validation: misfit on the held-out points, before and after."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...engine.descent import descend
from ..hypotheses.problem import Candidate, Problem
from ..search.refit import AGAIN, Refit, finished
from ..search.trial_fits import resoftened


def held_out_chi2(problem: Problem, found: Refit) -> float:
    """Return the misfit per degree of freedom on the held-out points, predicted by a fit to all others.

    The prediction has an uncertainty of its own (a held-out resonance is predicted less well), which is no fault of the
    model. The result is therefore the increase of the minimal chi2 when the held-out points are added (Chow's forecast
    test, Econometrica 28 (1960) 591): 1 if the model is right, whatever the other points determine. It is never less
    than the residual of the fit to everything, which can be larger where a fit far from the noise weights its points
    differently.
    """
    rest = resoftened(problem, found).without(problem.proof)
    objective = rest.objective(found.effects, found.values)
    again = finished(found.effects, descend(objective, objective.coordinates.x, 1e-8, AGAIN))
    taking_part = tuple(~mask for mask in problem.proof)
    everywhere = tuple(np.ones_like(mask) for mask in problem.proof)
    added = _chi2(problem, found, everywhere) + found.against - _chi2(problem, again, taking_part) - again.against
    left = _chi2(problem, found, problem.proof)
    return max(added, left) / (2.0 * max(1, sum(int(mask.sum()) for mask in problem.proof)))


def _chi2(problem: Problem, found: Refit, points: Sequence[NDArray[np.bool_]]) -> float:
    """Return the chi2 of a fit over some points, in units of noise."""
    ratios = found.objective.log_ratios(found.descent.x)
    parts = zip(problem.recordings, ratios, points, strict=True)
    return sum(float(np.sum(np.abs(ratio / one.noise)[own] ** 2)) for one, ratio, own in parts)


def unforeseen(problem: Problem, found: Refit) -> tuple[Candidate, ...]:
    """Return the effects constrained by held-out data only: those in another step, or with lines in other bands."""
    return tuple(one for one in found.effects if _lies_in(problem, one, found))


def _lies_in(problem: Problem, effect: Candidate, found: Refit) -> bool:
    places = [found.values[name] for name in effect.resonance_parameters]
    return all(
        mask.all() or (places and all(mask[np.argmin(np.abs(recording.sweep.frequency - f))] for f in places))
        for recording, mask in zip(problem.recordings, problem.proof, strict=True)
        if recording.step in effect.steps
    )
