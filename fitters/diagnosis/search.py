"""Refits with effects: everything free again, from several sizes of the effect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.arrays import Reals
from ..descent import Descent, chi2_per_point, descend
from ..objective import Objective
from .problem import Candidate, Problem

_SIZES = (0.3, 3.0)
"""First guesses of an effect's size in typical sizes, beside the one the score test gives."""
ROUGH = 1e-3


@dataclass(frozen=True, eq=False)
class Refit:
    """A fit with some effects, everything else free as before."""

    effects: tuple[Candidate, ...]
    descent: Descent
    chi2: tuple[float, ...]
    """By recording: mean |ln(Z_model/Z)|^2 over its expectation from noise alone."""

    @property
    def objective(self) -> Objective:
        """The objective at whose minimum it is."""
        return self.descent.objective

    @property
    def values(self) -> dict[str, float]:
        """Every model parameter at the minimum."""
        return self.objective.coordinates.forward(self.descent.x)[0]

    @property
    def chi2_per_dof(self) -> float:
        """Misfit over all recordings and its degrees of freedom."""
        sizes = np.array([recording.sweep.frequency.size for recording in self.objective.recordings])
        total = float(np.sum(2 * sizes * np.array(self.chi2)))
        return total / max(1.0, 2.0 * float(sizes.sum()) - self.descent.x.size)


def finished(effects: Sequence[Candidate], descent: Descent) -> Refit:
    """Return a descent as a refit."""
    ratios = descent.objective.log_ratios(descent.x)
    chi2 = tuple(
        chi2_per_point(recording, ratio) for recording, ratio in zip(descent.objective.recordings, ratios, strict=True)
    )
    return Refit(tuple(effects), descent, chi2)


def refit(
    problem: Problem,
    effects: Sequence[Candidate],
    values: Mapping[str, float],
    guess: float | None,
    tolerance: float = ROUGH,
) -> Refit:
    """Fit with `effects`, the last of them new: from `values`, and from several sizes of the new one's first knob.

    `guess` is a first size of it (from the score test); None means that all knobs are in `values` already.
    """
    new = effects[-1] if effects else None
    if guess is None or new is None:
        objective = problem.objective(effects, values)
        return finished(effects, descend(objective, objective.coordinates.x, tolerance))
    knob = new.knobs[0]
    sizes = {float(np.clip(size, knob.lower, knob.upper)) for size in _sizes(guess, knob.typical, knob.lower)}
    best: Descent | None = None
    for size in sorted(sizes):
        objective = problem.objective(effects, {**values, new.parameters[0]: size})
        descent = descend(objective, objective.coordinates.x, tolerance)
        best = descent if best is None or descent.cost < best.cost else best
    return finished(effects, best) if best is not None else refit(problem, effects, values, None, tolerance)


def _sizes(guess: float, typical: float, lower: float) -> list[float]:
    signs = (1.0,) if lower >= 0 else (1.0, -1.0)
    return [guess, *(sign * part * typical for part in _SIZES for sign in signs)]


def shift_of(objective: Objective, x: Reals, change: Reals) -> dict[str, float]:
    """Return the change of every model parameter that a change of the moving coordinates makes."""
    _, chain = objective.coordinates.forward(x)
    return dict(zip(objective.coordinates.parameters, (chain @ change).tolist(), strict=True))
