"""Refits with effects: all parameters free again, starting from several sizes of the effect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.effects import EffectParameter
from ...engine.descent import Descent, chi2_per_point, descend
from ...engine.objective import Objective
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem

ROUGH = 1e-3
AGAIN = 60
"""Evaluation budget of a fit that starts near its minimum."""
_ROUGHLY = 25
"""Evaluation budget of the first, rough fit of a candidate."""


@dataclass(frozen=True, eq=False)
class Refit:
    """A least-squares fit with some effects, and everything else free as before."""

    effects: tuple[Candidate, ...]
    descent: Descent
    chi2: tuple[float, ...]
    """By recording: mean |ln(Z_model/Z)|^2 over its expectation from noise alone."""
    against: float
    """Sum of squares of the priors' residuals."""

    @property
    def objective(self) -> Objective:
        """The objective that was minimised."""
        return self.descent.objective

    @property
    def values(self) -> dict[str, float]:
        """Every model parameter at the minimum."""
        return self.objective.coordinates.forward(self.descent.x)[0]

    @property
    def chi2_per_dof(self) -> float:
        """Misfit per degree of freedom over all recordings."""
        sizes = np.array([recording.sweep.frequency.size for recording in self.objective.recordings])
        total = float(np.sum(2 * sizes * np.array(self.chi2)))
        return total / max(1.0, 2.0 * float(sizes.sum()) - self.descent.x.size)

    @property
    def in_noise(self) -> tuple[Complexes, ...]:
        """ln(Z_model/Z) of every recording in units of its noise, each of shape (N,)."""
        ratios = self.objective.log_ratios(self.descent.x)
        return tuple(ratio / one.noise for one, ratio in zip(self.objective.recordings, ratios, strict=True))


def finished(effects: Sequence[Candidate], descent: Descent) -> Refit:
    """Return a finished descent as a refit."""
    ratios = descent.objective.log_ratios(descent.x)
    chi2 = tuple(
        chi2_per_point(recording, ratio) for recording, ratio in zip(descent.objective.recordings, ratios, strict=True)
    )
    beforehand = descent.objective.residual(descent.x)[2 * descent.objective.points :]
    return Refit(tuple(effects), descent, chi2, float(np.sum(beforehand**2)))


def as_refit(problem: Problem, found: Hypothesis) -> Refit:
    """Return a hypothesis as a fit weighted by noise alone, for figures, held-out misfit and residual summary."""
    return refit_at(problem, found.effects, found.values)


def refit_at(problem: Problem, effects: Sequence[Candidate], values: Mapping[str, float]) -> Refit:
    """Return a fit weighted by noise alone that has ended at these values."""
    objective = problem.objective(effects, values)
    x = objective.coordinates.x
    return finished(effects, Descent(objective, x, x, 0.0, converged=True, evaluations=0))


def refit(
    problem: Problem,
    effects: Sequence[Candidate],
    values: Mapping[str, float],
    guess: float | None,
    tolerance: float = ROUGH,
) -> Refit:
    """Fit with `effects`, the last of them new: start from `values`, and from several sizes of its first parameter.

    `guess` is a first size (from the score test); None means that `values` contains all parameters.
    """
    new = effects[-1] if effects else None
    if guess is None or new is None:
        objective = problem.objective(effects, values)
        return finished(effects, descend(objective, objective.coordinates.x, tolerance, AGAIN))
    elsewhere = any(values.get(name, knob.null) != knob.null for name, knob in new.sizes[1:])
    sizes = _sizes(guess, new.effect_parameters[0])
    starts = [{**values, new.parameters[0]: size} for size in ([*sizes, guess] if elsewhere else sizes)]
    objectives = [problem.objective(effects, start) for start in starts]
    best = min(objectives, key=lambda one: float(np.sum(one.residual(one.coordinates.x) ** 2)))
    return finished(effects, descend(best, best.coordinates.x, tolerance, _ROUGHLY))


def _sizes(guess: float, knob: EffectParameter) -> list[float]:
    """Return start sizes: the score test's estimate, and a typical one whatever the score test says."""
    plausible = knob.typical if guess >= 0 else -knob.typical
    sizes = [guess, plausible] if guess != knob.null else [plausible]
    return [float(np.clip(size, knob.lower, knob.upper)) for size in sizes]


def shift_of(objective: Objective, x: Reals, change: Reals) -> dict[str, float]:
    """Return the change of every model parameter for a given change of the free coordinates."""
    _, chain = objective.coordinates.forward(x)
    return dict(zip(objective.coordinates.parameters, (chain @ change).tolist(), strict=True))
