"""Validation: how much better least squares fit with what was found, on all points and on held-out ones."""

from dataclasses import dataclass

from ...error_model.marginal_fit import plain
from ..hypotheses.hypothesis import Hypothesis, marginal_of
from ..hypotheses.problem import Problem
from ..search.refit import Refit, as_refit, refit_at
from ..search.trial_fits import polish
from .held_out_misfit import held_out_chi2


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """What constants and effects of a hypothesis can do for the recordings, whatever errors are usual."""

    fit: Refit
    held_out: float
    """Misfit per degree of freedom on the held-out points."""

    @classmethod
    def of(cls, problem: Problem, found: Hypothesis) -> "LeastSquares":
        """Fit a hypothesis by least squares, from where it is, and from where all misfit is noise.

        Where it is, errors of instrument and model have left their part of the misfit: as figures for people, the
        misfits with and without an effect would compare what the errors have left. What they have left at a resonance
        may be so much that weights which match the residual keep it.
        """
        starts = [as_refit(problem, found)]
        if not found.fit.exact:
            marginal = marginal_of(problem, found.effects, found.values)
            x = plain(marginal, [marginal.objective.coordinates.x])
            values, _ = marginal.objective.coordinates.forward(x)
            starts.append(refit_at(problem, found.effects, values))
        fit = polish(problem, min(starts, key=lambda one: one.chi2_per_dof))
        return cls(fit, held_out_chi2(problem, fit))

    @property
    def chi2_per_dof(self) -> float:
        """Misfit per degree of freedom."""
        return self.fit.chi2_per_dof

    def share_beside(self, without: "LeastSquares") -> float:
        """Return the part of the misfit `without` an effect that it explains."""
        return max(0.0, 1 - self.chi2_per_dof / without.chi2_per_dof) if without.chi2_per_dof > 0 else 0.0
