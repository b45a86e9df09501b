"""The proof: misfit on what took no part in the fit, before and after."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...engine.descent import descend
from ..hypotheses.problem import Candidate, Problem
from ..search.refit import AGAIN, Refit, finished
from ..search.trial_fits import resoftened


def held_out_chi2(problem: Problem, found: Refit) -> float:
    """Return the misfit per degree of freedom on what is held out, of a fit to everything else.

    Measured against noise and against what the fit to the rest does not know itself: a resonance that was held out is
    foretold less well, and that is no fault of the model. So it is what the held-out points add to the least chi2 of
    the rest, Chow's test of a forecast (Econometrica 28 (1960) 591): 1 where the model is right, whatever the rest
    determines; but never less than what the fit to everything leaves there, as it may be where a fit far from the noise
    weighs its points otherwise.
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
    """Return the misfit of a fit on some points in units of noise."""
    ratios = found.objective.log_ratios(found.descent.x)
    parts = zip(problem.recordings, ratios, points, strict=True)
    return sum(float(np.sum(np.abs(ratio / one.noise)[own] ** 2)) for one, ratio, own in parts)


def unforeseen(problem: Problem, found: Refit) -> tuple[Candidate, ...]:
    """Return the effects that nothing tells but what was held out: in another step, or with lines in other bands."""
    return tuple(one for one in found.effects if _lies_in(problem, one, found))


def _lies_in(problem: Problem, effect: Candidate, found: Refit) -> bool:
    places = [found.values[name] for name in effect.resonance_parameters]
    return all(
        mask.all() or (places and all(mask[np.argmin(np.abs(recording.sweep.frequency - f))] for f in places))
        for recording, mask in zip(problem.recordings, problem.proof, strict=True)
        if recording.step in effect.steps
    )
