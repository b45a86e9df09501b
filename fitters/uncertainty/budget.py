"""The uncertainty budget: what noise, dimensions, data sheets and assumptions contribute to each constant.

To first order an answer is linear in everything that went into it, so its variance is a sum (GUM, JCGM 100:2008, 5.1).
What is held as exact contributes by how far it would move the answer if it were off by a nominal tolerance, or by as
much of it as the recordings would let pass.
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
    """Return the budget of every constant that moved.

    `by`: standard uncertainties of all parameters by source, shape (P,), where the error model told them.
    """
    now, x = solution.judged, solution.descent.x
    steps = tuple(dict.fromkeys(recording.step for recording in now.recordings))
    objective = Objective(now.recordings, now.coordinates, priors_of(solution.build, steps))
    values, chain = objective.coordinates.forward(x)
    bent = curvature(objective, x)
    moved = chain @ bent.answer
    noise = np.sqrt(np.sum(moved[:, : bent.data] ** 2, axis=1))
    names = [prior.parameter for prior in objective.priors]
    names += ["losses beforehand"] * (len(bent.rows) - bent.data - len(names))
    held, tolerances = held_constants(objective.coordinates, values)
    assumed = _assumed(bent, slopes_by_held(objective, held, values)[: bent.data] / bent.scale, tolerances)
    parts = np.hstack([moved[:, bent.data :], chain @ assumed])
    share = _Shares(objective.coordinates.parameters, noise, parts, [*names, *tolerances], len(names), by or {})
    return Budget(re=share.of(".re"), im=share.of(".im"), tolerances=tolerances)


def _assumed(bent: Curvature, columns: Reals, tolerances: Mapping[str, float]) -> Reals:
    """Return what each held value adds to x, shape (M, held); `columns` is d residual / d held value.

    As far as the recordings would let it be off: a glue's loss that is wrong by half shows as misfit.
    """
    rows = bent.rows[: bent.data]
    shift = bent.half @ (bent.half.T @ (rows.T @ columns))
    seen = columns.T @ (columns - rows @ shift)
    nominal = np.diag([1 / tolerance for tolerance in tolerances.values()])
    left = np.linalg.inv(nominal @ nominal + seen) if tolerances else np.zeros((0, 0))
    return shift * np.sqrt(np.diag(left))


class _Shares:
    """The parts of every parameter's uncertainty, shape (P, parts), and what each part is called."""

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
        found: dict[str, Share] = {}
        for k, name in enumerate(self._parameters):
            bare = name.removesuffix(".re").removesuffix(".im")
            if (name.endswith(".im")) == (part == ".im") and (self._noise[k] > 0 or np.any(self._parts[k] > 0)):
                found[bare] = self._share(k)
        return found

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
        # The error model gives what was known beforehand as one part; least squares say how it is divided.
        u = {source: float(values[k]) for source, values in self._by.items()}
        known = float(np.hypot(share.dimensions, share.knowledge))
        scale = u["dimensions"] / known if known else 0.0
        return replace(
            share,
            noise=u["noise"],
            instrument=u["instrument"],
            model=u["model"],
            dimensions=scale * share.dimensions if known else u["dimensions"],
            knowledge=scale * share.knowledge,
        )


def _is_dimension(name: str) -> bool:
    return kind_of(name) in ("thickness", "density", "area")
