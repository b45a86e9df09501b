"""Fits by noise alone, softened by what they leave: what is told of held-out bands and of other samples."""

from dataclasses import replace

from ...engine.descent import descend, with_model_discrepancy
from ..hypotheses.problem import Problem
from .refit import ROUGH, Refit, finished, refit

SIGNIFICANT = 30.0
"""Gain in chi2 of an effect that a fair judge may ask for: chance gives 16 once in a thousand recordings for forty
candidates, and the noise itself is known to some per cent only."""
_POLISH = 1e-5
"""Relative tolerance of the fits that are held against each other: a tenth of chi2, where thirty decide."""


def null_refit(problem: Problem) -> Refit:
    """Return the fit without effects."""
    objective = problem.objective((), problem.values)
    return finished((), descend(objective, objective.coordinates.x, ROUGH))


def resoftened(problem: Problem, current: Refit) -> Problem:
    """Return the problem with its recordings softened by what a refit leaves."""
    ratios = current.objective.log_ratios(current.descent.x)
    soft = tuple(
        with_model_discrepancy(recording, ratio) for recording, ratio in zip(problem.recordings, ratios, strict=True)
    )
    return replace(problem, recordings=soft)


def polish(problem: Problem, rough: Refit, tolerance: float = _POLISH) -> Refit:
    """Return a refit with weights that fit what it leaves over."""
    best = rough
    for _ in range(3):
        again = refit(resoftened(problem, best), best.effects, best.values, None, tolerance)
        if again.chi2_per_dof > 0.97 * best.chi2_per_dof:
            return again if again.chi2_per_dof < best.chi2_per_dof else best
        best = again
    return best
