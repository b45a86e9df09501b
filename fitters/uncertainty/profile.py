"""Profile likelihood: intervals for constants whose misfit is not a parabola.

D. J. Venzon, S. H. Moolgavkar, Appl. Statist. 37 (1988) 87. A narrow prior pulls a constant to one side, and everything
else is refitted; the misfit without that prior is a point of the profile, wherever the constant ended.
"""

from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..engine.covariance import curvature, remaining
from ..engine.descent import Descent, descend
from ..engine.objective import Objective
from ..engine.recording import Prior
from ..error_model.marginal_estimate import MarginalEstimate
from ..interface import Interval

_PULL = 0.05
# Standard uncertainty of the pulling prior, in standard uncertainties of the constant: it reaches its target.
_ONE, _NINETY_FIVE = 1.0, 1.959964
_NEAR = 0.03
_PULLS = 4
_TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class _Profile:
    """Profile of one constant near its best value."""

    objective: Objective
    x: Reals
    name: str
    best: float
    u: float
    way: Reals
    """d x / d constant along the profile at its beginning, shape (M,)."""
    chi2: float
    unit: float
    """Misfit that counts as one (Birge ratio squared)."""

    def drawn(self, target: float, x: Reals) -> tuple[float, float, Reals]:
        """Return the value of the pulled constant, the square root of the rise of the misfit there, and x."""
        prior = Prior(self.name, target, _PULL * self.u)
        known = (*self.objective.all_priors, prior)
        there = descend(Objective(self.objective.recordings, self.objective.coordinates, known), x, _TOLERANCE)
        value = self.objective.coordinates.forward(there.x)[0][self.name]
        rise = 2 * there.cost - ((value - target) / prior.u) ** 2 - self.chi2
        return value, float(np.sqrt(max(0.0, rise) / self.unit)), there.x

    def end(self, level: float, sign: int) -> float:
        """Return where the misfit has risen by level^2 on one side, or the farthest value that can be reached."""
        target, x = self.best + sign * level * self.u, self.x + sign * level * self.u * self.way
        value = self.best
        for _ in range(_PULLS):
            value, z, x = self.drawn(target, x)
            if abs(z / level - 1) < _NEAR or z < 1e-3 * level:
                break
            target = self.best + (value - self.best) * level / z
        else:
            return value
        return self.best + (value - self.best) * (level / z if z > 1e-3 * level else 1.0)


def profile_intervals(descent: Descent, told: MarginalEstimate | None = None) -> dict[str, Interval]:
    """Return the intervals of every fitted parameter by name, SI. The objective must be weighted by the noise.

    The profile is that of noise and priors. `told`: the answer that also counts errors of instrument and model; the
    intervals are about its values, and what it knows of further variance is added in quadrature.
    """
    objective, x = descent.objective, descent.x
    values, chain = objective.coordinates.forward(x)
    bent = curvature(objective, x)
    half = chain @ bent.half
    chi2, unit = float(np.sum(objective.residual(x) ** 2)), remaining(objective, x)
    intervals: dict[str, Interval] = {}
    for k, name in enumerate(objective.coordinates.parameters):
        u = float(np.linalg.norm(half[k]))
        if u == 0 or not np.isfinite(u):
            continue
        way = bent.half @ half[k] / u**2
        profile = _Profile(objective, x, name, values[name], u, way, chi2, unit)
        about, more = values[name], 0.0
        if told is not None:
            about, more = told.values[name], max(0.0, float(told.covariance[k, k]) - u**2)

        def end(level: float, sign: int, of: _Profile = profile, about: float = about, more: float = more) -> float:
            return about + sign * float(np.hypot(of.end(level, sign) - of.best, level * np.sqrt(more)))

        intervals[name] = Interval(*((end(level, -1), end(level, 1)) for level in (_ONE, _NINETY_FIVE)))
    return intervals
