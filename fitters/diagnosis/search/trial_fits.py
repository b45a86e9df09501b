"""Fits weighted by noise and model discrepancy, for held-out bands and other samples."""

from dataclasses import replace

from ...engine.descent import descend, with_model_discrepancy
from ..hypotheses.problem import Problem
from .refit import ROUGH, Refit, finished, refit

SIGNIFICANT = 30.0
"""Gain in chi2 that an effect needs to be significant: chance reaches 16 once in a thousand recordings with forty
candidates, and the noise is known to a few per cent only."""
_POLISH = 1e-5
"""Relative tolerance of fits that are compared: a tenth of chi2, where thirty are decisive."""


def null_refit(problem: Problem) -> Refit:
    """Fit without effects."""
    objective = problem.objective((), problem.values)
    return finished((), descend(objective, objective.coordinates.x, ROUGH))


def resoftened(problem: Problem, current: Refit) -> Problem:
    """Return the problem with recordings reweighted by the residual of a refit."""
    ratios = current.objective.log_ratios(current.descent.x)
    soft = tuple(
        with_model_discrepancy(recording, ratio) for recording, ratio in zip(problem.recordings, ratios, strict=True)
    )
    return replace(problem, recordings=soft)


def polish(problem: Problem, rough: Refit, tolerance: float = _POLISH) -> Refit:
    """Refit with weights that match the residual, until they no longer change."""
    best = rough
    for _ in range(3):
        again = refit(resoftened(problem, best), best.effects, best.values, None, tolerance)
        if again.chi2_per_dof > 0.97 * best.chi2_per_dof:
            return again if again.chi2_per_dof < best.chi2_per_dof else best
        best = again
    return best
