"""Whether a hypothesis predicts held-out data as well as its error model promises."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from ...error_model.error_sizes import ErrorSizes, Held
from ...error_model.marginal_fit import MarginalFit, fit
from ...error_model.point_covariance import spread_of_variance
from ..decision_rules import FALSE_ALARM
from ..hypotheses.hypothesis import Hypothesis, marginal_of
from ..hypotheses.problem import Problem

_ROUNDS = 6
"""Rounds of a fit at most; most converge after two."""


@dataclass(frozen=True)
class Forecast:
    """Misfit of held-out data, relative to what noise, errors and uncertain constants make likely."""

    chi2_per_dof: float
    """With errors as large as the other data show: 1 on average if the hypothesis is right."""
    probability: float
    """Probability of at least such a misfit if the hypothesis is right."""

    @property
    def failed(self) -> bool:
        """Whether the held-out data contradict the hypothesis."""
        return self.probability < FALSE_ALARM

    @property
    def says(self) -> str:
        """What a failed forecast means."""
        return (
            "Fitted without the held-out data, what was learned does not predict them: they deviate by chi2/dof "
            f"{self.chi2_per_dof:.3g}, in units of noise and of errors as large as the other data show."
        )


def forecast_of(problem: Problem, found: Hypothesis) -> Forecast | None:
    """Return how well a hypothesis that is fitted to all other data predicts those held out.

    This is Chow's forecast test in the error model: the increase of the minimum of -2 ln likelihood when the held-out
    data are added, with constants, effects and all errors free. Unlike `held_out_chi2` it counts in units of everything
    that may differ from the model, not of noise alone, so that it is 1 for a right model of a real recording as well.
    The other data do not determine the sizes of the errors exactly. The probability is therefore averaged over the
    sizes that these choose and those that all data choose, weighted by their coarsened posterior probabilities given
    the other data. None if nothing is held out or a fit does not converge. Raises FitError or LinAlgError if a fit
    cannot be computed.
    """
    whole = replace(problem, local=found.fit.marginal.local)
    rest = _without_held_out(whole)
    numbers, of_all = _numbers(whole) - _numbers(rest), _numbers(whole)
    own = _fitted(rest, found, found.fit.sizes, fixed=False)
    made: list[tuple[MarginalFit, float]] = []
    for sizes in dict.fromkeys((own.sizes, found.fit.sizes)):
        alone, both = _fitted(rest, found, sizes), _fitted(whole, found, sizes)
        if alone.converged and both.converged:
            made.append((alone, (_misfit(both) - _misfit(alone)) / max(1, numbers)))
    if not made or numbers == 0:
        return None
    log_p = np.array([alone.log_evidence for alone, _ in made]) / found.coarseness
    weights = np.exp(log_p - np.max(log_p)) / np.sum(np.exp(log_p - np.max(log_p)))
    by_chance = np.array([_by_chance(added, numbers, of_all) for _, added in made])
    return Forecast(made[0][1], float(weights @ by_chance))


def _fitted(problem: Problem, found: Hypothesis, sizes: ErrorSizes, *, fixed: bool = True) -> MarginalFit:
    """Return the fit of a hypothesis to the data of a problem, from where it was found."""
    marginal = marginal_of(problem, found.effects, found.values).around(found.fit.minimum.corrections)
    x, allowed = marginal.objective.coordinates.x, found.fit.sizes
    barred = [name for name in ("tau", "shape") if getattr(allowed, name) == 0]
    return fit(marginal, x, (sizes,), _ROUNDS, fixed=fixed, barred=barred)


def _without_held_out(problem: Problem) -> Problem:
    """Return the problem without its held-out points; recordings that are held out entirely are left out."""
    rest = problem.without(problem.proof)
    parts = zip(rest.recordings, problem.proof, strict=True)
    return replace(rest, recordings=tuple(one for one, held_out in parts if not held_out.all()))


def _numbers(problem: Problem) -> int:
    """Return the number of real numbers that count."""
    return 2 * sum(int(np.count_nonzero(np.isfinite(one.noise))) for one in problem.recordings)


def _misfit(one: MarginalFit) -> float:
    """Return -2 ln likelihood at a minimum without its determinants: a sum of squares, with that of the priors."""
    held = Held.of(one.gram.columns, one.sizes)
    return one.value.here - held.log_S - held.kernel.log_det


def _by_chance(added: float, held_out: int, of_all: int) -> float:
    """Return the probability that noise, whose size is itself uncertain, adds more than this for each number.

    Both uncertainties together are taken as a chi2 of fewer degrees of freedom, with the same variance (Satterthwaite,
    Biometrics Bulletin 2 (1946) 110).
    """
    freedom = 2 / (2 / max(1, held_out) + spread_of_variance(of_all / 2) ** 2)
    return float(chdtrc(freedom, max(0.0, added) * freedom))
