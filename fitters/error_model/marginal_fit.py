"""Fits by marginal likelihood: errors of instrument and model are integrated out, and their sizes estimated."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ...models.base.model import Model
from ...models.effects.base.corrected_constants import Corrections
from ..engine.objective import LOADS
from .error_columns import ErrorColumns, Part
from .error_sizes import USUAL, ErrorSizes, Gram, Held, Value, chosen, exchanged, of_the_instrument, rough_guess
from .joint_descent import CLOSE, NEAR, STEPS, JointPoint, descend
from .local_error_kinds import WeakLine
from .marginal import Marginal
from .point_covariance import PointErrors, spread_of_variance
from .prior_scales import FEW_SHAPE, RARE, SHAPE

ORDER = ("held", "tau", "slow", "fixture", "losses", "uneven", "shape", "fast", "bend", "rho", "colour")
ONE_IN_TWENTY = 1.645
"""Standard deviations that a normal number exceeds in one case of twenty."""
_SETTLED, _FURTHER = 3.0, 4
"""Change of ln evidence in a round below which a fit has converged, a tenth of the smallest that decides beside errors
of instrument or model; number of further rounds until then, at most."""
_IDLE = 3
"""Rounds in succession in which the evidence has not grown, after which a fit ends: columns and sizes go to and fro."""
_WEIGHTED, _UNCHANGED = 10, 0.02
"""Largest number of reweightings of plain least squares, and the relative decrease below which they stop."""
NEVER = (-np.inf, -np.inf)
"""A range that nothing is in."""
_NOT_OF_THE_MODEL = ("slow", "fast", "switch", "fixture", "held")
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
            PointErrors(at := np.zeros(own.noise.size), np.hypot(own.noise, misfit), at, at)
            for own, misfit in zip(marginal.objective.recordings, misfits, strict=True)
        )
        held = Held.of(ErrorColumns((), np.zeros(0), none, errors), ErrorSizes())
        # Nothing is lost in a valley here: all misfit counts as noise. Two thirds of the evaluations would be for it.
        x = descend(JointPoint.of(marginal, x, held, np.zeros(0)), most=most, close=NEAR, led_back=False)[0].x
    misfits = [float(np.mean(np.abs(r) ** 2)) for r in marginal.residuals(x)]
    return x, 0.5 * sum(count * float(np.log(misfit)) for count, misfit in zip(points, misfits, strict=True))


@dataclass(frozen=True, eq=False)
class Minimum:
    """What determines a fit, for a given marginal likelihood."""

    x: Reals
    """Coordinates, shape (M,)."""
    sizes: ErrorSizes
    converged: bool
    corrections: Corrections | None = None
    """Corrections of constants about which the errors are linear."""
    means: Mapping[str, Reals] | None = None
    """Means of the smooth functions of errors."""
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
    def at(cls, marginal: Marginal, minimum: Minimum, value: Value | None = None) -> "MarginalFit":
        """Return the fit with this minimum; `value`: of the likelihood there, if it is known."""
        marginal = replace(marginal, corrections=minimum.corrections, means=minimum.means)
        if value is not None:
            return cls(marginal, minimum, value)
        made = _gram_at(marginal, minimum)
        return cls(marginal, minimum, made.value(minimum.sizes), made)

    def with_sizes_of(self, others: Sequence[ErrorSizes]) -> "MarginalFit":
        """Return the fit at the same place, with the most probable sizes of errors there.

        For recordings other than those that it was fitted to; `others`: sizes to begin with beside its own.
        """
        sizes, value = chosen(self.gram, (self.sizes, *others), ORDER, all_starts=False)
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
        return float(max(0.0, 0.5 * (excess - ONE_IN_TWENTY * by_chance)))

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

    @property
    def has_usual_errors(self) -> bool:
        """Whether they are not those of less than one instrument, fixture or build in twenty."""
        return self.log_usual > np.log(RARE)

    @cached_property
    def deviations(self) -> dict[Part, tuple[float, float]]:
        """By part of the instrument's error: sum of squares of its coefficients, and how many the recordings show.

        They are in units of what is specified: the analyzer's accuracy, a fixture's usual residue, a value's tolerance.
        What they do not show is most probably zero and no sign of a good instrument: five residues of a fixture, of
        which one is seen, are one number.
        """
        columns = self.gram.columns
        on, _ = columns.present(self.sizes.of_columns())
        z, told = self._coefficients, self.gram.told(self.sizes)
        made: dict[Part, tuple[float, float]] = {}
        for name in _NOT_OF_THE_MODEL:
            own = [k for k in on.tolist() if columns.parts[k] == name]
            if own:
                made[name] = float(np.sum(z[own] ** 2)), max(1.0, float(np.sum(told[own])))
        return made

    @cached_property
    def bent(self) -> float:
        """Relative error that the formulas of the effects most probably have, root mean square over frequency.

        Those of several effects add up in squares.
        """
        own = [k for k, part in enumerate(self.gram.columns.parts) if part == "shape"]
        return SHAPE * float(np.sqrt(np.sum(self._coefficients[own] ** 2) / (2 * FEW_SHAPE)))

    @property
    def line_heights(self) -> dict[WeakLine, float]:
        """Most probable height of each weak line, in standard deviations of the height of such lines."""
        lines = [one for one in self.marginal.local if isinstance(one, WeakLine)]
        own = np.array([part == "line" for part in self.gram.columns.parts], dtype=bool)
        # in phase and in quadrature; the errors of frequency and Q follow
        residues = self._coefficients[own].reshape(-1, 4)[:, :2]
        return dict(zip(lines, np.linalg.norm(residues, axis=1).tolist(), strict=True))

    @cached_property
    def _coefficients(self) -> Reals:
        """Most probable coefficient of each column, shape (C,)."""
        return self.gram.coefficients(self.sizes)

    @property
    def values(self) -> dict[str, float]:
        """Every model parameter."""
        return self.marginal.objective.coordinates.forward(self.x)[0]


def _promised(value: Value) -> float:
    return max(0.0, 0.5 * float(value.step @ value.H @ value.step) - _SETTLED)


def _unusual(squares: float, count: float) -> float:
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
    hopeless: tuple[float, float] = NEVER,
) -> MarginalFit:
    """Fit from `x`: alternate between choosing the sizes of the errors and descending with them.

    `fixed`: use the sizes of the first start. `compared`: whether its evidence will be compared with that of others and
    has to settle, if need be in further rounds; constants then move by less than their uncertainties. `barred`: parts
    of the error that it has none of, by their names in `ErrorSizes`. `hopeless`: range of ln evidence, without
    what the priors take from it, in which a fit ends if it would stay there although each round that is left gained as
    much as the last one. Above, it may be of interest; below, it has not even come to where its effects are absent.

    It ends where the evidence was largest: far from any minimum, where little is explained, the errors that are
    expected where a descent ends may be quite others than those with which it began.
    """
    order = [name for name in ORDER if name not in barred]
    starts = _without(barred, starts)
    sizes = starts[0]
    now = best = _Round.before(marginal, _with_loads(marginal, x), sizes)
    converged, held, before, idle, steps, further = False, False, np.inf, 0, 0, 0.0
    most = rounds + _FURTHER if rounds and compared else rounds
    for k in range(most):
        if not (fixed or held):
            others = sizes.at("slow", 1.0).at("tau", 0.0), *of_the_instrument(sizes.colour), *exchanged(sizes)
            again = (sizes, *_without(barred, others)) if k > 0 else ()
            # Later rounds only follow the descent; another start has its turn if it has become the better one.
            sizes, _ = chosen(now.made, (*again, *starts, rough_guess(now.made)), order, all_starts=k == 0)
            best = _better(best, replace(now, sizes=sizes))
            if k > 0 and hopeless[0] < now.made.most(sizes) < hopeless[1] - (most - k) * further:
                converged = False
                break
        last, now = now, now.next(sizes, CLOSE if compared else NEAR)
        # a descent that has ended by itself leaves nothing to the next one but what other sizes promise
        further = 0.0 if now.steps < STEPS else max(0.0, now.worth - replace(last, sizes=sizes).worth)
        steps += now.steps
        if now.sizes != last.sizes and now.log_evidence < last.log_evidence - _SETTLED:
            # The quadratic expansion by which these were chosen promised more than it kept.
            now, sizes, held = last, last.sizes, True
            continue
        best = _better(now, best)
        # without errors evidence depends on no columns
        exact = (fixed or held) and now.made.exact(sizes)
        gained = abs(now.log_evidence - before)
        converged = now.steps < STEPS and (exact or gained < _SETTLED)
        if converged and (k >= rounds - 1 or (now.sizes == last.sizes and gained < CLOSE)):
            break
        idle = 0 if best is now else idle + 1
        if idle == _IDLE:
            break
        before = now.log_evidence
    if best.worth > now.worth + _SETTLED:
        now, sizes, converged = best, best.sizes, False
    marginal = now.marginal
    minimum = Minimum(now.x, sizes, converged, marginal.corrections, marginal.means, steps)
    return MarginalFit(marginal, minimum, now.made.value(sizes), now.made)


def _with_loads(marginal: Marginal, x: Reals) -> Reals:
    """Return coordinates from which the loads can come back.

    Least squares may have driven that of a face in air to nothing, where no recording feels it: to minus 1e9 of it.
    """
    coordinates = marginal.objective.coordinates
    loads = [k for k, name in enumerate(coordinates.free) if name in LOADS]
    if not loads:
        return x
    made = x.copy()
    made[loads] = coordinates.inverse(coordinates.forward(x)[0])[loads]
    return made


def _without(barred: Collection[str], some: Sequence[ErrorSizes]) -> tuple[ErrorSizes, ...]:
    """Return sizes of errors with none of these parts."""
    return tuple(replace(one, **dict.fromkeys(barred, 0.0)) for one in some)


def _gram_at(marginal: Marginal, minimum: Minimum) -> Gram:
    return marginal.gram(minimum.x, marginal.columns(minimum.x))


@dataclass(frozen=True, eq=False)
class _Round:
    """A descent with sizes of the errors fixed, and what is the case where it ended."""

    marginal: Marginal
    """About the corrections there."""
    x: Reals
    sizes: ErrorSizes
    made: Gram
    a: Reals
    """Coefficients of the columns, shape (C,)."""
    steps: int = STEPS

    @classmethod
    def before(cls, marginal: Marginal, x: Reals, sizes: ErrorSizes) -> Self:
        """Return where the first round begins."""
        columns = marginal.columns(x)
        marginal = marginal.centred(columns.means)
        return cls(marginal, x, sizes, marginal.gram(x, columns), np.zeros(len(columns.parts)))

    def next(self, sizes: ErrorSizes, close: float) -> Self:
        """Descend with these sizes of the errors to `close` to the minimum."""
        begun = JointPoint.at(self.marginal, self.x, self.made.columns, sizes, self.a)
        end, steps = descend(begun, close=close)
        made = end.marginal.gram(end.x, end.marginal.columns(end.x))
        a = end.a if made.columns.parts == end.held.columns.parts else np.zeros(len(made.columns.parts))
        return type(self)(end.marginal, end.x, sizes, made, a, steps)

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
