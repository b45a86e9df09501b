"""Fits by marginal likelihood: errors of instrument and model are integrated out, and their sizes estimated."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ...models.base.model import Model
from ...models.effects.base.corrected_constants import Corrections
from .error_columns import ErrorColumns, Part
from .error_sizes import USUAL, ErrorSizes, Expansion, Gram, Held, Value, chosen, exchanged, rough_guess
from .marginal import Marginal
from .point_covariance import PointErrors, spread_of_variance

ORDER = ("held", "tau", "slow", "fixture", "losses", "uneven", "shape", "fast", "bend", "rho", "colour")
_STEPS = 15
_ONE_IN_TWENTY = 1.645
"""Standard deviations that a normal number exceeds in one case of twenty."""
_CLOSE, _NEAR = 0.1, 0.3
"""Decrease of minus twice ln density below which a fit has converged, and below which one has that is continued if it
is worth while; no decision depends on a twentieth of a nat."""
_LINEAR = 0.1
"""Part of chi2 that corrections of constants may leave beyond first order."""
_SETTLED, _FURTHER = 3.0, 4
"""Change of ln evidence in a round below which a fit has converged, a tenth of the smallest that decides beside errors
of instrument or model; number of further rounds until then, at most."""
_IDLE = 3
"""Rounds in succession in which the evidence has not grown, after which a fit ends: columns and sizes go to and fro."""
_RELAXATION = 0.5
"""Part of the way to the minimum with columns of where it began: the minimum with those of where it ends may lie on the
other side, and so on for ever."""
_DAMPED, _RELAXED = 4.0, 1 / 3
"""Factors of damping after a step that fails for the first time, and at least after one that brings what it should."""
_LEAST, _UNDAMPED, _REGULAR = 3e-3, 1e-4, 1e-9
"""Damping, in units of the information, from which a step differs, below which there is none, and by which information
that is singular by rounding has an inverse."""
_SHORT = 3
"""Number of short steps in succession after which a descent ends in a curved valley."""
_WEIGHTED, _UNCHANGED = 10, 0.02
"""Largest number of reweightings of plain least squares, and the relative decrease below which they stop."""
_ALONG, _BENT = 0.1, 0.375
"""Part of a step over which its second derivative is taken, and the largest part of a step by which it is bent
(Transtrum and Sethna, arXiv:1201.5885)."""
_FURTHEST = 1.5
"""Longest step in any coordinate (a logarithm, or prior standard deviations) for which the model is nearly linear."""


_NOT_OF_THE_MODEL = ("slow", "fast", "fixture", "held")
"""Parts of the error that have physical sizes known beforehand."""


def plain(marginal: Marginal, starts: Sequence[Reals], most: int = 8) -> Reals:
    """Return the lowest minimum of plain least squares, with all misfit as white noise and no smooth errors.

    The marginal fit starts there: if it started where the errors have absorbed an effect, it would never find the
    effect.
    """
    return min((_plain(marginal, x, most) for x in starts), key=lambda end: end[1])[0]


def _plain(marginal: Marginal, x: Reals, most: int) -> tuple[Reals, float]:
    """Return a minimum of plain least squares, and the sum of ln rms residual over all points."""
    none = tuple(np.zeros((r.noise.size, 0), np.complex128) for r in marginal.objective.recordings)
    points = [recording.noise.size for recording in marginal.objective.recordings]
    last = np.inf
    for _ in range(_WEIGHTED):
        misfits = [float(np.sqrt(np.mean(np.abs(r) ** 2) / 2)) for r in marginal.residuals(x)]
        if float(np.sum(np.log(misfits))) > last - _UNCHANGED * len(misfits):
            break
        last = float(np.sum(np.log(misfits)))
        errors = tuple(
            PointErrors(np.zeros(own.noise.size), np.hypot(own.noise, misfit), *(np.zeros(own.noise.size),) * 2)
            for own, misfit in zip(marginal.objective.recordings, misfits, strict=True)
        )
        held = Held.of(ErrorColumns((), np.zeros(0), none, errors), ErrorSizes())
        x = _down(_Point(marginal, x, held), most, _NEAR)[0].x
    misfits = [float(np.mean(np.abs(r) ** 2)) for r in marginal.residuals(x)]
    return x, 0.5 * sum(count * float(np.log(misfit)) for count, misfit in zip(points, misfits, strict=True))


@dataclass(frozen=True, eq=False)
class Minimum:
    """What determines a fit, for a given marginal likelihood."""

    x: Reals
    """Coordinates, shape (M,)."""
    sizes: ErrorSizes
    fast: bool
    """Whether these include fast instrument errors."""
    converged: bool
    corrections: Corrections | None = None
    """Corrections of constants about which the errors are linear."""
    steps: int = 0
    """Number of steps of descents that led there."""


@dataclass(eq=False)
class MarginalFit:
    """A minimum of the marginal likelihood."""

    marginal: Marginal
    """About the corrections of the minimum."""
    minimum: Minimum
    value: Value
    _gram: Gram | None = None

    @classmethod
    def at(cls, marginal: Marginal, minimum: Minimum) -> "MarginalFit":
        """Return the fit with this minimum."""
        marginal = marginal.around(minimum.corrections)
        made = _gram_at(marginal, minimum)
        return cls(marginal, minimum, made.value(minimum.sizes), made)

    def with_sizes_of(self, others: Sequence[ErrorSizes]) -> "MarginalFit":
        """Return the fit at the same place, with the most probable sizes of errors there.

        For recordings other than those that it was fitted to; `others`: sizes to begin with beside its own.
        """
        order = [name for name in ORDER if name != "fast" or self.minimum.fast]
        sizes, value = chosen(self.gram, (self.sizes, *others), order, all_starts=False)
        return MarginalFit(self.marginal, replace(self.minimum, sizes=sizes, converged=False), value, self._gram)

    @property
    def gram(self) -> Gram:
        """Products of columns, derivatives and residual; megabytes for each thousand points."""
        if self._gram is None:
            self._gram = _gram_at(self.marginal, self.minimum)
        return self._gram

    def forget(self) -> None:
        """Release what takes much memory and can be computed again."""
        self._gram = None
        self.marginal.objective.forget()
        self.marginal = replace(self.marginal)

    @property
    def x(self) -> Reals:
        """Coordinates, shape (M,)."""
        return self.minimum.x

    @property
    def sizes(self) -> ErrorSizes:
        """Sizes of the errors."""
        return self.minimum.sizes

    @property
    def exact(self) -> bool:
        """Whether there are no errors but white noise, so that the likelihood is no approximation."""
        return self.gram.exact(self.sizes)

    @property
    def converged(self) -> bool:
        """Whether the last descent ended at a minimum, and little is promised beside it."""
        return self.minimum.converged and self.promised == 0

    @property
    def log_evidence(self) -> float:
        """Logarithm of the marginal likelihood about where the fit ended.

        Up to a constant that is common to all fits of the same recordings.
        """
        return self.value.log_evidence - self.promised

    @property
    def promised(self) -> float:
        """What the quadratic expansion promises of ln evidence beyond what a fit that has settled may still gain.

        It does not count: where a fit has not converged, the minimum is where nothing is nearly quadratic any more.
        """
        return _promised(self.value)

    @cached_property
    def shortfall(self) -> float:
        """Missing ln likelihood compared with an explanation that leaves only noise and the usual errors.

        The usual errors are those of a good device and instrument, where this fit has any. What chance and the
        uncertain size of the noise alone exceed in one recording of twenty is not missing; 0 if no more is.
        """
        columns = self.gram.columns
        numbers = 2 * sum(int(np.count_nonzero(np.isfinite(own.noise))) for own in columns.points)
        usual = Held.of(columns, self.sizes.at_most(USUAL))
        excess = self.value.here - numbers - usual.log_S - usual.kernel.log_det
        by_chance = np.sqrt(2 * numbers + numbers**2 * spread_of_variance(numbers / 2) ** 2)
        return float(max(0.0, 0.5 * (excess - _ONE_IN_TWENTY * by_chance)))

    @cached_property
    def left_by_the_model(self) -> tuple[Complexes, ...]:
        """ln(Z_model/Z) of each recording without any errors, shape (N,)."""
        return tuple(self.marginal.around(None).residuals(self.x))

    @property
    def models(self) -> Sequence[Model]:
        """The model of each recording, with the most probable corrections."""
        return self.marginal.models(self.x)

    @cached_property
    def log_usual(self) -> float:
        """Logarithm of how usual the errors of instrument, fixture and held values are: 0 for usual ones.

        It is the prior density of each one's size, the root sum of squares of its normal coefficients, relative to its
        largest value; 0 below the most probable size.
        """
        return sum(-0.5 * max(0.0, _unusual(*one)) for one in self.deviations.values())

    @cached_property
    def deviations(self) -> dict[Part, tuple[float, int]]:
        """By part of the instrument's error: sum of squares of its coefficients, and their number.

        They are in units of what is specified: the analyzer's accuracy, a fixture's usual residue, a value's tolerance.
        """
        columns = self.gram.columns
        scale, z = columns.scaled(self.sizes.of_columns()), self.gram.coefficients(self.sizes)
        made: dict[Part, tuple[float, int]] = {}
        for name in _NOT_OF_THE_MODEL:
            own = np.array([part == name for part in columns.parts], dtype=bool) & (scale > 0)
            if np.any(own):
                made[name] = float(np.sum(z[own] ** 2)), int(np.count_nonzero(own))
        return made

    @property
    def values(self) -> dict[str, float]:
        """Every model parameter."""
        return self.marginal.objective.coordinates.forward(self.x)[0]


def _promised(value: Value) -> float:
    return max(0.0, 0.5 * float(value.step @ value.H @ value.step) - _SETTLED)


def _unusual(squares: float, count: int) -> float:
    """Return minus twice ln density of a root sum of squares of `count` normal numbers, relative to its maximum."""
    mode = count - 1
    if squares <= mode:
        return 0.0
    return squares - mode - (mode * float(np.log(squares / mode)) if mode else 0.0)


def fit(
    marginal: Marginal,
    x: Reals,
    starts: Sequence[ErrorSizes] = (ErrorSizes(),),
    rounds: int = 3,
    *,
    fixed: bool = False,
    compared: bool = True,
    barred: Collection[str] = (),
) -> MarginalFit:
    """Fit from `x`: alternate between choosing the sizes of the errors and descending with them.

    `fixed`: use the sizes of the first start. `compared`: whether its evidence will be compared with that of others and
    has to settle, if need be in further rounds; constants then move by less than their uncertainties. `barred`: parts
    of the error that it has none of, by their names in `ErrorSizes`.

    It ends where the evidence was largest. A descent lowers the misfit with the errors that are expected where it
    begins; far from any minimum, where little is explained, those expected where it ends may be quite others.
    """
    fast, order = "fast" not in barred, [name for name in ORDER if name not in barred]
    for name in barred:
        starts = tuple(own.at(name, 0.0) for own in starts)
    sizes = starts[0]
    now = best = _Round.before(marginal, x, sizes, fast)
    converged, held, before, idle, steps = False, False, np.inf, 0, 0
    for k in range(rounds + _FURTHER if rounds and compared else rounds):
        if not (fixed or held):
            again = (sizes, sizes.at("slow", 1.0).at("tau", 0.0), *exchanged(sizes)) if k > 0 else ()
            # Later rounds only follow the descent; another start has its turn if it has become the better one.
            sizes, _ = chosen(now.made, (*again, *starts, rough_guess(now.made)), order, all_starts=k == 0)
            best = _better(best, replace(now, sizes=sizes))
        last, now = now, now.next(sizes, fast, _RELAXATION if held else 1.0, _CLOSE if compared else _NEAR)
        steps += now.steps
        if now.sizes != last.sizes and now.log_evidence < last.log_evidence - _SETTLED:
            # The quadratic expansion by which these were chosen promised more than it kept.
            now, sizes, held = last, last.sizes, True
            continue
        best = _better(now, best)
        # without errors evidence depends on no columns
        exact = (fixed or held) and now.made.exact(sizes)
        converged = now.steps < _STEPS and (exact or abs(now.log_evidence - before) < _SETTLED)
        if (k >= rounds - 1 and converged) or (k > 0 and now.steps <= 1 and now.remainder < _LINEAR):
            break
        idle = 0 if best is now else idle + 1
        if idle == _IDLE:
            break
        before = now.log_evidence
    if best.worth > now.worth + _SETTLED:
        now, sizes, converged = best, best.sizes, False
    minimum = Minimum(now.x, sizes, fast, converged, now.marginal.corrections, steps)
    return MarginalFit(now.marginal, minimum, now.made.value(sizes), now.made)


def _gram_at(marginal: Marginal, minimum: Minimum) -> Gram:
    return marginal.gram(minimum.x, marginal.columns(minimum.x, fast=minimum.fast))


@dataclass(frozen=True, eq=False)
class _Round:
    """A descent with sizes and columns of the errors fixed, and what is the case where it ended."""

    marginal: Marginal
    """About the most probable corrections there."""
    x: Reals
    sizes: ErrorSizes
    made: Gram
    steps: int = _STEPS
    remainder: float = np.inf
    """Part of chi2 that the corrections leave beyond first order."""
    near: bool = False
    """Whether a descent has ended there. Far from any explanation errors would be what no device has, and a model with
    such errors leads nowhere."""

    @classmethod
    def before(cls, marginal: Marginal, x: Reals, sizes: ErrorSizes, fast: bool) -> Self:
        """Return where the first round begins."""
        return cls(marginal, x, sizes, marginal.gram(x, marginal.columns(x, fast=fast)))

    def next(self, sizes: ErrorSizes, fast: bool, part: float, close: float) -> Self:
        """Descend with these sizes of the errors to `close` to the minimum, and go this part of the way."""
        begun = _Point(self.marginal, self.x, Held.of(self.made.columns, sizes), self.near)
        end, steps = _down(begun, close=close)
        between = replace(begun, x=self.x + part * (end.x - self.x))
        if part < 1 and between.here < begun.here:
            end = between
        end, remainder = end.recorrected()
        made = end.marginal.gram(end.x, end.marginal.columns(end.x, fast=fast))
        return type(self)(end.marginal, end.x, sizes, made, steps, remainder, near=True)

    @cached_property
    def log_evidence(self) -> float:
        """Logarithm of the marginal likelihood where it ended."""
        return self.made.value(self.sizes).log_evidence

    @cached_property
    def worth(self) -> float:
        """The same without what is only promised; minus infinity if there is no covariance."""
        try:
            value = self.made.value(self.sizes)
        except np.linalg.LinAlgError:
            return -np.inf
        return value.log_evidence - _promised(value)


def _better(one: _Round, other: _Round) -> _Round:
    return one if one.worth >= other.worth else other


@dataclass(frozen=True, eq=False)
class _Point:
    """A point of a descent, with the corrections about which the errors are linear there."""

    marginal: Marginal
    x: Reals
    held: Held
    """Columns of errors, the same throughout a descent but for what the corrections absorb."""
    followed: bool = False
    """Whether errors are linear about what they most probably are at every point of a descent."""

    @cached_property
    def here(self) -> float:
        """Minus twice ln of the joint density, apart from constants."""
        return self.held.here(self.marginal.residuals(self.x), self.marginal.against(self.x))

    def expanded(self) -> Expansion:
        """Return the marginal likelihood and its derivatives. Raises LinAlgError."""
        return self.marginal.expanded(self.x, self.held)

    def after(self, at: Expansion, step: Reals) -> Self:
        """Return the point after a step.

        It is about what the errors most probably are there, if they are `followed`: where constants and errors shift a
        resonance in opposite ways, errors that stayed where they are would be linear over much less than its width, and
        the descent would creep along a valley.
        """
        there = replace(self, x=self.x + step)
        return there.about(self.held.coefficients(at, step)) if self.followed else there

    def about(self, coefficients: Reals) -> Self:
        """Return the same point about errors with these coefficients of the columns, shape (C,)."""
        columns = self.held.columns
        on = self.marginal.corrected(columns)
        absorbed = tuple(block[:, on] @ coefficients[on] for block in columns.blocks)
        marginal = self.marginal.around(self.marginal.corrections_at(columns, coefficients))
        return replace(self, marginal=marginal, held=replace(self.held, columns=replace(columns, absorbed=absorbed)))

    def recorrected(self) -> tuple[Self, float]:
        """Return the point about the most probable errors, and how far from linear they were: their part of chi2.

        If that is little, it is left as it is.
        """
        r = self.held.columns.beyond(self.marginal.residuals(self.x))
        there = self.about(self.held.most_probable(r))
        beyond = there.held.columns.beyond(there.marginal.residuals(self.x))
        pairs = zip(beyond, r, self.held.columns.points, strict=True)
        remainder = sum(float(np.sum((np.abs(new - old) / own.noise) ** 2)) for new, old, own in pairs)
        return (there if remainder >= _LINEAR else self), remainder


def _down(point: _Point, most: int = _STEPS, close: float = _CLOSE) -> tuple[_Point, int]:
    """Minimise by Levenberg-Marquardt with columns and sizes fixed; return the point and the number of steps.

    Damping follows how much of the expected fall a step has brought (H. B. Nielsen, Damping parameter in Marquardt's
    method, IMM-REP-1999-05). In a curved valley all damped steps are short, and none means that the minimum is near.
    """
    damping, growth, short, used = 0.0, _DAMPED, 0, 0
    at = point.expanded()
    for _ in range(most):
        value = at.value
        if float(value.step @ value.H @ value.step) < close or short > _SHORT:
            break
        step = value.step if damping == 0 else _damped(value, value.H @ value.step, damping)
        step = step / max(1.0, float(np.max(np.abs(step))) / _FURTHEST)
        used += 1
        there = point.after(at, step + _acceleration(point, at, step, damping))
        fall = value.here - there.here
        if fall > 0:
            point = there
            if damping == 0 and fall < close:
                break
            expected = float((2 * value.step - step) @ value.H @ step)
            part = min(fall / max(expected, 1e-300), 1.0)
            damping, growth = damping * max(_RELAXED, 1 - (2 * part - 1) ** 3), _DAMPED
            damping = damping if damping > _UNDAMPED else 0.0
            short = short + 1 if fall < close else 0
            try:
                at = point.expanded()
            except np.linalg.LinAlgError:
                break
        else:
            damping, growth = max(damping, _LEAST) * growth, 2 * growth
            if damping > 1e6:
                break
    return point, used


def _acceleration(point: _Point, at: Expansion, step: Reals, damping: float) -> Reals:
    """Return by how much a step along a curved valley is bent; nothing where the valley is not smooth enough.

    M. K. Transtrum, B. B. Machta and J. P. Sethna, Phys. Rev. E 83 (2011) 036701: half the geodesic acceleration, from
    the second derivative of the residuals along the step.
    """
    there = point.after(at, _ALONG * step)
    near = there.held.columns.beyond(there.marginal.residuals(there.x))
    second = [2 / _ALONG * ((b - a) / _ALONG - J @ step) for a, b, J in zip(at.r, near, at.J, strict=True)]
    if not all(np.all(np.isfinite(own)) for own in second):
        return np.zeros_like(step)
    bend = _damped(at.value, -point.held.gradient(at, second), max(damping, _REGULAR)) / 2
    length, bent = (float(np.sqrt(np.diag(at.value.H) @ one**2)) for one in (step, bend))
    return bend if bent <= _BENT * length else np.zeros_like(step)


def _damped(value: Value, pull: Reals, damping: float) -> Reals:
    """Return a damped step; `pull` is minus half the gradient."""
    unit = np.sqrt(np.where(np.diag(value.H) > 0, np.diag(value.H), 1.0))
    H = value.H / unit / unit[:, None]
    return np.asarray(np.linalg.solve(H + damping * np.eye(unit.size), pull / unit) / unit, np.float64)
