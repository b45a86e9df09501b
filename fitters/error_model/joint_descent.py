"""Descents over constants and errors together, with sizes of the errors fixed.

Errors of instrument and model are linear only about where they are. A descent that had eliminated them with the columns
of where it began would lower what is no longer the joint density where it ends. Here every point has coefficients of
the errors, the model contains what they correct, and only what lowers the joint density of both is a step.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.linalg import solve_triangular

from ...models.base.arrays import Complexes, Reals
from .contained_errors import ContainedErrors
from .error_columns import ErrorColumns
from .error_sizes import Beforehand, ErrorSizes, Held, whitened_by
from .marginal import Marginal
from .point_covariance import WhitenedColumns

STEPS = 15
"""Largest number of steps of a descent."""
CLOSE, NEAR = 0.3, 1.0
"""Expected fall of minus twice ln density below which a fit has converged, and below which one has that is continued if
it is worth while; no decision depends on a sixth of a nat."""
_SHORT = 3
"""Number of steps of less than that after which a descent ends."""
FURTHEST, _LEAST = 1.5, 1e-3
"""Longest step in any coordinate (a logarithm, or prior standard deviations) for which the model is nearly linear, and
the one below which a descent ends."""
_OF_ERRORS = 0.01
"""The same for errors: in so many of their standard deviations one is as far as a coordinate in one."""
_LONGER, _POOR, _GOOD = 3.0, 0.25, 0.75
"""Factor by which steps become longer or shorter, and the parts of the expected fall above and below which they do."""
_STALE = 0.5
"""Part of the expected fall below which derivatives by errors are computed anew before steps become shorter."""
_BACK, _CONTRACTS = 8, 0.3
"""Largest number of steps back into a valley, and the part of the way that each has to come nearer."""
_ASTRAY = 30.0
"""How far from where their derivatives hold steps back may lead in any coordinate: further than any prior allows. Along
what the recording hardly tells, they led 500 prior standard deviations away."""
_FLAT = 0.1
"""Part of the information of each coordinate and error by which steps back are damped."""
_WITHIN, _DAMPINGS = 1.2, 8
"""Factor by which a step may be longer than the longest one, and the number of dampings tried for it."""
_REGULAR = 1e-9
"""Part of the information by which it is increased where rounding has made it singular."""


@dataclass(frozen=True, eq=False)
class JointPoint:
    """Constants and errors, with the derivatives by errors of this point or of one nearby."""

    marginal: Marginal
    """About what the errors correct."""
    x: Reals
    held: Held
    contained: ContainedErrors
    a: Reals
    """Coefficients of the columns, shape (C,)."""
    fresh: bool = True
    """Whether the columns are those of this very point."""

    @classmethod
    def at(cls, marginal: Marginal, x: Reals, columns: ErrorColumns, sizes: ErrorSizes, a: Reals) -> Self:
        """Return the point with the more probable of two sets of errors: `a`, or the most probable to first order."""
        here = cls.of(marginal, x, Held.of(columns, sizes), a)
        linear = here.held.most_probable(columns.beyond(marginal.residuals(x)))
        return min((here.with_errors(own) for own in (here.held.present(a), linear)), key=lambda one: one.here)

    @classmethod
    def of(cls, marginal: Marginal, x: Reals, held: Held, a: Reals) -> Self:
        """Return the point with these columns and their coefficients, which `marginal` is about."""
        return cls(marginal, x, held, ContainedErrors(marginal.objective.recordings, held.columns), a)

    def with_errors(self, a: Reals) -> Self:
        """Return the point with other errors."""
        return replace(self, marginal=self.marginal.around(self.contained.corrections(a)), a=a)

    def moved(self, dx: Reals, dz: Reals) -> Self:
        """Return the point after a step; `dz` in standard deviations of the columns that are present."""
        a = self.a.copy()
        a[self.held.on] += self.held.d * dz
        marginal = self.marginal.around(self.contained.corrections(a))
        return replace(self, x=self.x + dx, fresh=not dz.size, marginal=marginal, a=a)

    def refreshed(self) -> Self:
        """Return the same point with its own derivatives by what the model contains.

        What the model does not contain stays as it is: the density that a descent lowers must not change on its way.
        """
        columns = self.marginal.renewed(self.x, self.held.columns)
        there = replace(self, held=Held.of(columns, self.held.sizes), fresh=True)
        there.__dict__.update(residuals=self.residuals, seen=self.seen, here=self.here)
        return there

    @cached_property
    def residuals(self) -> list[Complexes]:
        """ln(Z_model/Z) of each recording with all errors, shape (N,)."""
        return self.contained.with_rest(self.marginal.residuals(self.x), self.a)

    @cached_property
    def seen(self) -> WhitenedColumns:
        """The residuals, whitened."""
        return self.held.kernel.white([own[:, None] for own in self.residuals])

    @property
    def z(self) -> Reals:
        """Coefficients of the columns that are present, in standard deviations."""
        return self.a[self.held.on] / self.held.d

    @cached_property
    def here(self) -> float:
        """Minus twice ln of the joint density, apart from constants; infinite where the model has no value."""
        total = float(self.seen.lengths()[0]) + float(self.z @ self.z) + self.marginal.against(self.x)
        return total if np.isfinite(total) else np.inf


@dataclass(frozen=True, eq=False)
class _Expansion:
    """Quadratic expansion of minus twice the ln joint density at a point, the second derivatives of the model left out.

    Its gradient is twice (`g`, `pull`), its matrix of second derivatives twice that of `A`, `across` and `held.L L^T`.
    """

    at: JointPoint
    own: bool
    """Whether the derivatives by constants are those of this very point."""
    before: Beforehand
    seen: WhitenedColumns
    """Derivatives by constants, whitened."""
    A: Reals
    """By constants twice, shape (M, M)."""
    across: Reals
    """By errors and constants, shape (on, M)."""
    g: Reals
    pull: Reals

    @classmethod
    def of(cls, at: JointPoint) -> Self:
        """Return the expansion at a point."""
        held, before = at.held, at.marginal.beforehand(at.x)
        seen = held.kernel.white(at.marginal.slopes(at.x))
        g, pull = seen.times(at.seen)[:, 0] + before.g, held.products(at.seen)[:, 0] + at.z
        return cls(at, True, before, seen, seen.squared() + before.P, held.products(seen), g, pull)

    def carried(self, there: JointPoint) -> Self:
        """Return the expansion at a point nearby with the derivatives of here."""
        g, pull = self._gradient(there)
        before = replace(self.before, g=self.before.g + self.before.P @ (there.x - self.at.x))
        return replace(self, at=there, own=False, before=before, g=g, pull=pull)

    def _gradient(self, there: JointPoint) -> tuple[Reals, Reals]:
        """Return half the gradient at a point nearby with the derivatives of here."""
        g = self.seen.times(there.seen)[:, 0] + self.before.g + self.before.P @ (there.x - self.at.x)
        return g, self.at.held.products(there.seen)[:, 0] + there.z

    def step(self, radius: float) -> "_Step":
        """Return the step to the minimum within this distance in any coordinate. Raises LinAlgError."""
        step = self._damped_step(0.0)
        for _ in range(_DAMPINGS):
            if step.length <= _WITHIN * radius:
                break
            # as if all of the fall were along its longest coordinate
            least = step.fall / step.length**2
            step = self._damped_step((step.damping + least) * step.length / radius - least)
        return step

    def _damped_step(self, damping: float) -> "_Step":
        L = self._factor(damping)
        dx, dz = self._solved(self.g, self.pull, damping, L)
        curved = dx @ self.A @ dx + 2 * dz @ (self.across @ dx) + float(np.sum((self.at.held.L.T @ dz) ** 2))
        fall = float(-2 * (self.g @ dx + self.pull @ dz) - curved)
        length = max(float(np.max(np.abs(dx), initial=0.0)), _OF_ERRORS * float(np.max(np.abs(dz), initial=0.0)))
        return _Step(dx, dz, damping, fall, length)

    def back(self, there: JointPoint, step: "_Step") -> JointPoint:
        """Return a point after this step, moved to where the expansion would have it.

        The step has left a curved valley by second order. Where the walls of the valley are steep, the derivatives of
        where it began lead back: a Newton step with an old matrix, of the residuals that should not be there.
        """
        g, pull = self._gradient(there)
        g, pull = g + step.damping * step.dx, pull + step.damping * _OF_ERRORS**2 * step.dz
        return there.moved(*self._solved(g, pull, self._steep, self._steep_factor))

    @cached_property
    def _steep(self) -> Reals:
        """Damping by which only steep directions are left: in flat ones old derivatives lead astray, shape (M,)."""
        return _FLAT * np.diag(self.A)

    @cached_property
    def _steep_factor(self) -> Reals:
        """The same for errors: Cholesky factor of their damped information. Raises LinAlgError."""
        L = self.at.held.L
        S = L @ L.T
        return np.asarray(np.linalg.cholesky(S + _FLAT * np.diag(np.diag(S))), np.float64) if L.size else L

    def _factor(self, damping: float) -> Reals:
        """Return the Cholesky factor of the damped information of the errors. Raises LinAlgError."""
        L = self.at.held.L
        if not (damping and L.size):
            return L
        return np.asarray(np.linalg.cholesky(L @ L.T + damping * _OF_ERRORS**2 * np.eye(len(L))), np.float64)

    def _solved(self, g: Reals, pull: Reals, damping: float | Reals, L: Reals) -> tuple[Reals, Reals]:
        """Return the damped step from a point with this gradient. Raises LinAlgError."""
        B = whitened_by(L, np.concatenate([self.across, pull[:, None]], axis=1))
        H, b = self.A - B[:, :-1].T @ B[:, :-1] + np.diag(np.full(g.size, damping)), B[:, -1]
        unit = np.sqrt(np.where(np.diag(H) > 0, np.diag(H), 1.0))
        scaled = H / unit / unit[:, None] + _REGULAR * np.eye(unit.size)
        dx = -np.linalg.solve(scaled, (g - B[:, :-1].T @ b) / unit) / unit
        dz = -solve_triangular(L, b + B[:, :-1] @ dx, lower=True, trans=1, check_finite=False) if b.size else b
        return dx, dz


@dataclass(frozen=True, eq=False)
class _Step:
    """A step from the point of an expansion."""

    dx: Reals
    dz: Reals
    """In standard deviations of the columns that are present."""
    damping: float
    fall: float
    """By how much the expansion falls."""
    length: float
    """Largest change of a coordinate."""


def descend(
    point: JointPoint, most: int = STEPS, close: float = CLOSE, *, led_back: bool = True
) -> tuple[JointPoint, int]:
    """Return where the joint density is largest, or as far as `most` steps lead, and the number of steps.

    Levenberg and Marquardt's steps in coordinates in which the model is nearly linear over the same distance, each led
    back into the valley that it leaves. As long as what was expected of them comes true, derivatives are kept;
    otherwise they are computed anew, and then steps become shorter. `close`: expected fall of minus twice the ln
    density at which it ends. `led_back`: whether steps are led back into a valley that they leave.
    """
    radius, short, used = FURTHEST, 0, 0
    try:
        expansion = _Expansion.of(point)
        while used < most and short < _SHORT and radius > _LEAST:
            step = expansion.step(radius)
            if step.damping == 0 and not step.fall > close:
                break
            used, there, kept = used + 1, *_in_valley(expansion, step, _BACK if led_back else 0)
            fall = point.here - there.here
            if fall > 0:
                point, short = there, short + (fall < close)
            stale = not (expansion.own and expansion.at.fresh)
            if kept > _GOOD:
                radius = min(FURTHEST, max(radius, _LONGER * step.length))
                expansion = expansion.carried(point)
                continue
            if kept < _STALE and stale:
                point = point.refreshed()
            elif kept < _POOR:
                radius = min(radius, step.length) / _LONGER
            if point is not expansion.at or not expansion.own:
                expansion = _Expansion.of(point)
    except np.linalg.LinAlgError:
        pass
    return point, used


def _in_valley(expansion: _Expansion, step: _Step, back: int) -> tuple[JointPoint, float]:
    """Return the point after a step and at most `back` back into its valley, and what it kept of the expected fall."""
    begun = expansion.at
    there = begun.moved(step.dx, step.dz)
    for _ in range(back):
        missing = there.here - (begun.here - step.fall)
        if missing < (1 - _GOOD) * step.fall:
            break
        nearer = expansion.back(there, step)
        off = float(np.max(np.abs(nearer.x - begun.x), initial=0.0))
        if off > _ASTRAY or not there.here - nearer.here > _CONTRACTS * missing:
            break
        there = nearer
    return there, min((begun.here - there.here) / max(step.fall, 1e-300), 1.0)
