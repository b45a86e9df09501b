"""Uncertainty budget: contributions of noise, dimensions, data sheets and assumptions to each constant.

To first order the result is linear in all its inputs, so its variance is a sum (GUM, JCGM 100:2008, 5.1). A value held
as exact contributes the change of the result if it were off by a nominal tolerance, or by as much of it as the
recordings allow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...models.base.arrays import Reals
from ..engine.covariance import Curvature, curvature
from ..engine.held_constants import held_constants, kind_of, slopes_by_held
from ..engine.multi_step_fit import Solution
from ..engine.objective import Objective
from ..engine.parameters.assembly import priors_of
from ..interface import Budget, Share


def budget_of(solution: Solution, by: Mapping[str, Reals] | None = None) -> Budget:
    """Return the budget of every fitted constant.

    `by`: standard uncertainties of all parameters by source, shape (P,), if the error model was used.
    """
    now = solution.judged
    steps = tuple(dict.fromkeys(recording.step for recording in now.recordings))
    objective = Objective(now.recordings, now.coordinates, priors_of(solution.build, steps))
    return budget_at(objective, solution.descent.x, by)


def budget_at(objective: Objective, x: Reals, by: Mapping[str, Reals] | None = None) -> Budget:
    """Return the budget of every fitted parameter at a minimum; `by` as for `budget_of`.

    Without it, misfit beyond the noise counts as noise.
    """
    values, chain = objective.coordinates.forward(x)
    bent = curvature(objective, x)
    moved = chain @ bent.answer
    noise = np.sqrt(np.sum(moved[:, : bent.data] ** 2, axis=1))
    names = [prior.parameter for prior in objective.priors]
    told = sum(len(posterior.root) for posterior in objective.posteriors)
    names += ["losses beforehand"] * (len(bent.rows) - bent.data - len(names) - told) + ["earlier steps"] * told
    held, tolerances = held_constants(objective.coordinates, values)
    assumed = _assumed(bent, slopes_by_held(objective, held, values)[: bent.data] / bent.scale, tolerances)
    parts = np.hstack([moved[:, bent.data :], chain @ assumed])
    share = _Shares(objective.coordinates.parameters, noise, parts, [*names, *tolerances], len(names), by or {})
    return Budget(re=share.of(".re"), im=share.of(".im"), tolerances=tolerances)


def _assumed(bent: Curvature, columns: Reals, tolerances: Mapping[str, float]) -> Reals:
    """Return the contribution of each held value to x, shape (M, held); `columns` is d residual / d held value.

    Only as far as the recordings allow: a glue's loss that is wrong by half shows as misfit.
    """
    rows = bent.rows[: bent.data]
    shift = bent.half @ (bent.half.T @ (rows.T @ columns))
    seen = columns.T @ (columns - rows @ shift)
    nominal = np.diag([1 / tolerance for tolerance in tolerances.values()])
    left = np.linalg.inv(nominal @ nominal + seen) if tolerances else np.zeros((0, 0))
    return shift * np.sqrt(np.diag(left))


class _Shares:
    """Contributions to every parameter's uncertainty, shape (P, parts), and their names."""

    def __init__(
        self,
        parameters: Sequence[str],
        noise: Reals,
        parts: Reals,
        names: Sequence[str],
        known: int,
        by: Mapping[str, Reals],
    ) -> None:
        self._parameters, self._noise, self._parts, self._names = parameters, noise, np.abs(parts), names
        self._dimensions = np.array([_is_dimension(name) for name in names], dtype=bool)
        self._dimensions[known:] = False
        self._assumed = np.arange(len(names)) >= known
        self._by = by

    def of(self, part: str) -> dict[str, Share]:
        """Return the shares of all constants' real or imaginary part (`.re`, `.im`)."""
        shares: dict[str, Share] = {}
        for k, name in enumerate(self._parameters):
            bare = name.removesuffix(".re").removesuffix(".im")
            if (name.endswith(".im")) == (part == ".im") and (self._noise[k] > 0 or np.any(self._parts[k] > 0)):
                shares[bare] = self._share(k)
        return shares

    def _share(self, k: int) -> Share:
        parts = self._parts[k]
        largest = int(np.argmax(parts)) if parts.size else -1
        share = Share(
            noise=float(self._noise[k]),
            dimensions=float(np.linalg.norm(parts[self._dimensions])),
            knowledge=float(np.linalg.norm(parts[~self._dimensions & ~self._assumed])),
            assumptions=float(np.linalg.norm(parts[self._assumed])),
            largest=(self._names[largest], float(parts[largest])) if parts.size else ("noise", float(self._noise[k])),
        )
        if not self._by:
            return share
        # The error model gives the priors' contribution as one number; least squares say how it is divided.
        u = {source: float(values[k]) for source, values in self._by.items()}
        known = float(np.hypot(share.dimensions, share.knowledge))
        scale = u["dimensions"] / known if known else 0.0
        counted = u["assumptions"]
        return replace(
            share,
            noise=u["noise"],
            instrument=u["instrument"],
            model=u["model"],
            dimensions=scale * share.dimensions if known else u["dimensions"],
            knowledge=float(np.hypot(scale * share.knowledge, counted)),
            assumptions=float(np.sqrt(max(0.0, share.assumptions**2 - counted**2))),
        )


def _is_dimension(name: str) -> bool:
    return kind_of(name) in ("thickness", "density", "area", "mass")
