"""Fits by marginal likelihood: errors of instrument and model are integrated out, and their sizes estimated."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Complexes, Reals
from ...models.base.model import Model
from ...models.effects import Device
from ...models.effects.base.corrected_constants import CORRECTED, EVERYWHERE, CorrectedConstants, Corrections
from ...models.effects.base.corrected_path import SERIES, SHUNT, CorrectedPath, PathCorrection
from ...models.effects.base.effect import TERMINALS
from ...models.effects.polarity import Polarity
from ...models.stack import Piezo, Stack
from ..engine.held_constants import held_constants, kind_of, slopes_by_held
from ..engine.objective import LOADS, Objective
from ..engine.parameters.coordinates import Coordinates
from ..engine.recording import Recording
from .error_columns import HELD, ErrorColumns, HeldValue, LinearisedRecording, Part, WeakLine, columns_of, place_of
from .error_sizes import USUAL, Beforehand, ErrorSizes, Gram, Held, Value, chosen, rough_guess
from .point_covariance import PointErrors, spread_of_variance

ORDER = ("held", "tau", "slow", "fixture", "losses", "shape", "fast", "bend", "rho", "colour")
_STEPS = 15
_ONE_IN_TWENTY = 1.645
"""Standard deviations that a normal number exceeds in one case of twenty."""
_UNINFORMED = 1 / 9
"""Prior precision of a coordinate about which nothing is known: a logarithm is known within a factor of twenty.

Around wherever the fit is, so that no value is preferred. Without it a thickness that recordings do not feel would run
away, and its boundless posterior volume would count as evidence."""
_CLOSE = 0.02
"""Decrease of minus twice ln density below which a fit has converged; no decision depends on a fiftieth."""
_LINEAR = 0.1
"""Part of chi2 that corrections of constants may leave beyond first order."""
_SETTLED, _FURTHER = 0.5, 4
"""Change of ln evidence in a round below which a fit has converged, a fifth of the smallest that decides; number
of further rounds until then, at most."""
_DAMPED, _RELAXED = 10.0, 0.1
_WEIGHTED, _UNCHANGED = 10, 0.02
"""Largest number of reweightings of plain least squares, and the relative decrease below which they stop."""
_FURTHEST = 1.5
"""Longest step in any coordinate (a logarithm, or prior standard deviations) for which the model is nearly linear."""


_NOT_OF_THE_MODEL = ("slow", "fast", "fixture", "held")
"""Parts of the error that have physical sizes known beforehand."""
_LOOSE = ("z", "c", "q", "thickness", "density")
"""Held constants that may be off because a build gives them as bare numbers, mostly of glue; others are exact."""


Shapes = Mapping[str, tuple[tuple[str, Callable[[float], float]], ...]]
"""For each effect: its size coordinates, each with the function d coordinate / d ln size."""


class Known(Protocol):
    """Priors beyond those of the objective."""

    def rows(self, x: Reals) -> tuple[Reals, Reals]:
        """Return residuals of unit variance, shape (K,), and their derivatives, shape (K, M)."""
        ...


@dataclass(frozen=True, eq=False)
class Nothing:
    """No further priors."""

    def rows(self, x: Reals) -> tuple[Reals, Reals]:
        """Return no rows."""
        return np.zeros(0), np.zeros((0, x.size))


@dataclass(eq=False)
class Marginal:
    """A fit whose residuals contain errors of instrument, fixture and model."""

    objective: Objective
    """Weighted by noise alone."""
    known: Known = field(default_factory=Nothing)
    shapes: Shapes = field(default_factory=dict[str, tuple[tuple[str, Callable[[float], float]], ...]])
    lines: tuple[WeakLine, ...] = ()
    corrections: Corrections | None = None
    """Corrections of constants about which the errors are linear; none: about exact constants."""

    @classmethod
    def of(
        cls,
        objective: Objective,
        known: Known | None = None,
        shapes: Shapes | None = None,
        lines: tuple[WeakLine, ...] = (),
    ) -> "Marginal":
        """Return the marginal fit of an objective, without the misfit weights of its recordings."""
        plain = [replace(recording, misfit=0.0, correlation=1.0) for recording in objective.recordings]
        bare = Objective(plain, objective.coordinates, objective.priors, slopes_later=True)
        return cls(bare, known or Nothing(), _shapes_of(bare, shapes or {}), lines)

    def around(self, corrections: Corrections | None) -> "Marginal":
        """Return the same with errors that are linear about these corrections."""
        return replace(self, corrections=corrections)

    @cached_property
    def _corrected(self) -> Objective:
        """The objective of the corrected model."""
        if self.corrections is None:
            return self.objective
        known: dict[int, Model] = {}
        for one in self.objective.recordings:
            model = one.model
            if id(model) not in known:
                device = model if isinstance(model, Device) else Device(model)
                known[id(model)] = _with_corrections(device, one.step, self.corrections)
        recordings = [replace(one, model=known[id(one.model)]) for one in self.objective.recordings]
        old, held = self.objective.coordinates, self.corrections.held
        start = {name: value * float(np.exp(held.get(name, 0.0))) for name, value in old.start.items()}
        return Objective(recordings, Coordinates(old.blocks, start, old.free), self.objective.priors, slopes_later=True)

    def columns(self, x: Reals, *, fast: bool = True) -> ErrorColumns:
        """Return the columns of errors at a point."""
        J = self._unweighted(self._corrected.jacobian(x).T)
        free = self.objective.coordinates.free
        places: list[LinearisedRecording] = []
        for k, (recording, model) in enumerate(zip(self.objective.recordings, self.models(x), strict=True)):
            shapes = {
                name: sum(
                    (J[k][:, free.index(at)] * per(float(x[free.index(at)])) for at, per in sizes),
                    np.zeros(len(J[k]), np.complex128),
                )
                for name, sizes in self.shapes.items()
            }
            places.append(place_of(replace(recording, model=model), shapes))
        held = self._held(x)
        made = columns_of(places, held, self.lines, fast=fast)
        if self.corrections is None:
            return made
        absorbed = [self._absorbed(place) for place in places]
        for one in held:
            moved = self.corrections.held.get(one.name, 0.0) / one.relative
            absorbed = [total + moved * own for total, own in zip(absorbed, one.columns, strict=True)]
        return replace(made, absorbed=tuple(absorbed))

    def _absorbed(self, place: LinearisedRecording) -> Complexes:
        """Return what the corrections change in ln Z of a recording to first order, shape (N,)."""
        total, known, f = np.zeros(place.Z.size, np.complex128), self.corrections, place.recording.sweep.frequency
        if known is None:
            return total
        for name in known.relative:
            if name in place.felt:
                total += place.felt[name] * known.over(name, f)
        if (path := known.paths.get(place.recording.step)) is not None:
            total += path.over(SERIES, f) / place.Z - path.over(SHUNT, f) * place.Z
        return total

    def corrections_at(self, made: Gram, coefficients: Reals) -> Corrections | None:
        """Return corrections of constants and paths from the coefficients of columns, shape (C,); None for none."""
        recordings = self.objective.recordings
        log_f, relative = _sampled(recordings, made, coefficients, self.of_ceramics)
        paths: dict[str, PathCorrection] = {}
        for step in dict.fromkeys(one.step for one in recordings):
            own = [k for k, one in enumerate(recordings) if one.step == step and not _altered(one.model)]
            if own:
                paths[step] = PathCorrection(*_sampled(recordings, made, coefficients, _PATH, own))
        paths = {step: path for step, path in paths.items() if path.values}
        held = {
            own.name.removeprefix(HELD): float(size * own.relative[0][0].real)
            for own, size in zip(made.columns.corrections, coefficients.tolist(), strict=True)
            if own is not None and size and own.name.startswith(HELD)
        }
        return Corrections(log_f, relative, paths, held) if relative or paths or held else None

    def corrected(self, columns: ErrorColumns) -> NDArray[np.bool_]:
        """Return whether each column stands for a correction of what can be corrected, shape (C,)."""
        there = self.of_ceramics | _PATH
        return np.array(
            [own is not None and (own.name in there or own.name.startswith(HELD)) for own in columns.corrections],
            dtype=bool,
        )

    @cached_property
    def of_ceramics(self) -> frozenset[str]:
        """Names of the constants that can be corrected."""
        names: set[str] = set()
        for one in self.objective.recordings:
            bare = one.model.bare if isinstance(one.model, Device) else one.model
            if isinstance(bare, Stack):
                layers = [layer.name for layer in bare.layers if isinstance(layer, Piezo)]
                names |= {f"{name}.{constant}" for name in layers for constant in CORRECTED}
        return frozenset(names)

    def _held(self, x: Reals) -> list[HeldValue]:
        """Return the held values that may be off."""
        coordinates = self._corrected.coordinates
        values, _ = coordinates.forward(x)
        names, tolerances = held_constants(coordinates, values)
        loose = tuple(name for name in names if kind_of(name) in _LOOSE)
        slopes = self._unweighted(slopes_by_held(self._corrected, loose, values).T)
        made = [
            HeldValue(name, tolerances[name] / values[name], tuple(own[:, k] * tolerances[name] for own in slopes))
            for k, name in enumerate(loose)
            if tolerances[name] > 0
        ]
        return [one for one in made if all(np.all(np.isfinite(own)) for own in one.columns)]

    def gram(self, x: Reals, columns: ErrorColumns) -> Gram:
        """Return all inputs of the marginal likelihood at `x`."""
        J = self._unweighted(self._corrected.jacobian(x).T)
        return Gram(columns, J, columns.beyond(self.residuals(x)), self.beforehand(x))

    def value(self, x: Reals, held: Held) -> Value:
        """Return the marginal likelihood at a point, with the columns of errors fixed."""
        return held.value(self._unweighted(self._corrected.jacobian(x).T), self.residuals(x), self.beforehand(x))

    def models(self, x: Reals) -> Sequence[Model]:
        """Return the corrected model of each recording."""
        return self._corrected.models(x)

    def residuals(self, x: Reals) -> list[Complexes]:
        """Return ln(Z_model/Z) of each recording with the corrected model, shape (N,)."""
        return [own[:, 0] for own in self._unweighted(self._corrected.residual(x)[None, :])]

    def against(self, x: Reals) -> float:
        """Return the sum of squares of all priors' residuals."""
        more, _ = self.known.rows(x)
        loads = [k for k, name in enumerate(self.objective.coordinates.free) if name in LOADS]
        parts = (self._corrected.residual(x)[2 * self.objective.points :], more, x[loads] - 1)
        return sum(float(part @ part) for part in parts)

    def beforehand(self, x: Reals) -> Beforehand:
        """Return the normal equations of all priors."""
        data = 2 * self.objective.points
        more, slopes = self.known.rows(x)
        loads = [k for k, name in enumerate(self.objective.coordinates.free) if name in LOADS]
        more = np.concatenate([more, x[loads] - 1])
        slopes = np.concatenate([slopes, np.eye(x.size)[loads]])
        r = np.concatenate([self._corrected.residual(x)[data:], more])
        J = np.concatenate([self._corrected.jacobian(x)[data:], slopes])
        P = J.T @ J
        unknown = np.flatnonzero(np.diag(P) < _UNINFORMED)
        P[unknown, unknown] += _UNINFORMED
        return Beforehand(P, J.T @ r, float(r @ r))

    def _unweighted(self, rows: Reals) -> list[Complexes]:
        """Return rows (P, R) of weighted real residuals as complex ln Z, for each recording (N, P)."""
        made: list[Complexes] = []
        at = 0
        for recording in self.objective.recordings:
            n = recording.sweep.frequency.size
            sigma = np.where(np.isfinite(recording.sigma), recording.sigma, 0.0)[:, None]
            made.append((rows[:, at : at + n].T + 1j * rows[:, at + n : at + 2 * n].T) * sigma)
            at += 2 * n
        return made


_PATH = frozenset({SERIES, SHUNT})


def _with_corrections(device: Device, step: str, corrections: Corrections) -> Device:
    """Return a device with the corrected constants of its layers and the corrected path of its step."""
    if corrections.relative:
        device = device.with_effect(CorrectedConstants(corrections), EVERYWHERE)
    path = corrections.paths.get(step)
    return device if path is None or _altered(device) else device.with_effect(CorrectedPath(path), TERMINALS)


def _altered(model: Model) -> bool:
    """Return whether a recording is inverted or conjugated: nothing can be added to its path as to that of a device."""
    return isinstance(model, Device) and any(isinstance(one.effect, Polarity) for one in model.added)


def _sampled(
    recordings: Sequence[Recording],
    made: Gram,
    coefficients: Reals,
    names: Collection[str],
    which: Sequence[int] | None = None,
) -> tuple[Reals, dict[str, Complexes]]:
    """Return ln f of these recordings, shape (K,), and the sum of their columns' corrections by name, shape (K,)."""
    which = range(len(recordings)) if which is None else which
    points, first = np.unique(np.concatenate([np.log(recordings[k].sweep.frequency) for k in which]), return_index=True)
    found: dict[str, Complexes] = {}
    for own, size in zip(made.columns.corrections, coefficients.tolist(), strict=True):
        if own is not None and size and own.name in names:
            found[own.name] = found.get(own.name, 0) + size * np.concatenate([own.relative[k] for k in which])[first]
    return points, found


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
        x, _ = _down(marginal, x, Held.of(ErrorColumns((), np.zeros(0), none, errors), ErrorSizes()), most, 0.3)
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


@dataclass(frozen=True, eq=False)
class MarginalFit:
    """A minimum of the marginal likelihood."""

    marginal: Marginal
    minimum: Minimum
    gram: Gram
    value: Value

    @classmethod
    def at(cls, marginal: Marginal, minimum: Minimum) -> "MarginalFit":
        """Return the fit with this minimum."""
        marginal = marginal.around(minimum.corrections)
        made = marginal.gram(minimum.x, marginal.columns(minimum.x, fast=minimum.fast))
        return cls(marginal, minimum, made, made.value(minimum.sizes))

    @property
    def x(self) -> Reals:
        """Coordinates, shape (M,)."""
        return self.minimum.x

    @property
    def sizes(self) -> ErrorSizes:
        """Sizes of the errors."""
        return self.minimum.sizes

    @property
    def converged(self) -> bool:
        """Whether the last descent ended at a minimum."""
        return self.minimum.converged

    @property
    def log_evidence(self) -> float:
        """Logarithm of the marginal likelihood, up to a constant common to all fits of the same recordings."""
        return self.value.log_evidence

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
        """By part of the instrument's error: sum of squares of its standardised coefficients, and their number."""
        columns = self.gram.columns
        scale = columns.scaled(self.sizes.of_columns())
        z = self.gram.coefficients(self.sizes) / np.where(scale > 0, scale, 1.0)
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


def _unusual(squares: float, count: int) -> float:
    """Return minus twice ln density of a root sum of squares of `count` normal numbers, relative to its maximum."""
    mode = count - 1
    if squares <= mode:
        return 0.0
    return squares - mode - (mode * float(np.log(squares / mode)) if mode else 0.0)


def _shapes_of(objective: Objective, searched: Shapes) -> Shapes:
    """Return the sizes of all effects whose formulas may err: of those `searched` for, and of those the build states.

    The coordinates of the latter are logarithms of the sizes. Beside a law that was chosen to describe the recording no
    formula may err, since the errors of formulas would absorb what the law describes.
    """
    devices = [recording.model for recording in objective.recordings if isinstance(recording.model, Device)]
    added = [one for device in devices for one in device.added]
    if not all(one.effect.formula_errs for one in added):
        return {}
    free = objective.coordinates.free
    stated: Shapes = {
        one.prefix: tuple((name, lambda _: 1.0) for name in list(one.parameters())[: one.effect.sizes] if name in free)
        for one in added
    }
    return {**stated, **searched}


def fit(
    marginal: Marginal,
    x: Reals,
    starts: Sequence[ErrorSizes] = (ErrorSizes(),),
    rounds: int = 3,
    fixed: bool = False,
    fast: bool = True,
    tau: bool = True,
    shape: bool = True,
    compared: bool = True,
) -> MarginalFit:
    """Fit from `x`: alternate between choosing the sizes of the errors and descending with them.

    `fixed`: use the sizes of the first start; `fast`: whether fast instrument errors are allowed; `tau`: whether smooth
    errors of all constants are; `shape`: whether those of the effects' formulas are. `compared`: whether its evidence
    will be compared with that of others and has to settle, if need be in further rounds; constants then move by less
    than their uncertainties.
    """
    never = [name for name, allowed in (("tau", tau), ("shape", shape)) if not allowed]
    for name in never:
        starts = tuple(own.at(name, 0.0) for own in starts)
    sizes = starts[0]
    order = [name for name in ORDER if (fast or name != "fast") and name not in never]
    made = marginal.gram(x, marginal.columns(x, fast=fast))
    converged, before = False, np.inf
    for k in range(rounds + _FURTHER if rounds and compared else rounds):
        if not fixed:
            again = (sizes, sizes.at("slow", 1.0).at("tau", 0.0)) if k > 0 else ()
            # Later rounds only follow the descent; another start has its turn if it has become the better one.
            sizes, _ = chosen(made, (*again, *starts, rough_guess(made)), order, all_starts=k == 0)
        x, steps = _down(marginal, x, Held.of(made.columns, sizes))
        marginal, remainder = _recorrected(marginal, x, made, sizes)
        made = marginal.gram(x, marginal.columns(x, fast=fast))
        value = made.value(sizes)
        converged = steps < _STEPS and abs(value.log_evidence - before) < _SETTLED
        if (k >= rounds - 1 and converged) or (k > 0 and steps <= 1 and remainder < _LINEAR):
            break
        before = value.log_evidence
    return MarginalFit(marginal, Minimum(x, sizes, fast, converged, marginal.corrections), made, made.value(sizes))


def _recorrected(marginal: Marginal, x: Reals, made: Gram, sizes: ErrorSizes) -> tuple[Marginal, float]:
    """Return the fit about the most probable corrections, and how far from linear they are: its part of chi2.

    `made` has the columns with which the fit descended to `x`. Corrections that are linear enough are left as they are.
    """
    made = marginal.gram(x, made.columns)
    coefficients, columns = made.coefficients(sizes), made.columns
    corrected = marginal.around(marginal.corrections_at(made, coefficients))
    on = marginal.corrected(columns)
    expected = [block[:, on] @ coefficients[on] for block in columns.blocks]
    pairs = zip(corrected.residuals(x), made.r, expected, columns.points, strict=True)
    remainders = [np.abs(there - here - change) / own.noise for there, here, change, own in pairs]
    remainder = sum(float(np.sum(part**2)) for part in remainders)
    return corrected if remainder >= _LINEAR else marginal, remainder


def _down(marginal: Marginal, x: Reals, held: Held, most: int = _STEPS, close: float = _CLOSE) -> tuple[Reals, int]:
    """Minimise by Levenberg-Marquardt with columns and sizes fixed; return the point and the number of steps."""
    damping, used = 0.0, 0
    value = marginal.value(x, held)
    for _ in range(most):
        step = value.step if damping == 0 else _damped(value, damping)
        if float(step @ value.H @ step) < close:
            break
        step = step / max(1.0, float(np.max(np.abs(step))) / _FURTHEST)
        used += 1
        fall = value.here - held.here(marginal.residuals(x + step), marginal.against(x + step))
        if fall > 0:
            x = x + step
            damping = 0.0 if damping < 1e-2 else damping * _RELAXED
            if fall < close:
                break
            try:
                value = marginal.value(x, held)
            except np.linalg.LinAlgError:
                break
        else:
            damping = 1e-2 if damping == 0 else damping * _DAMPED
            if damping > 1e6:
                break
    return x, used


def _damped(value: Value, damping: float) -> Reals:
    unit = np.sqrt(np.where(np.diag(value.H) > 0, np.diag(value.H), 1.0))
    H = value.H / unit / unit[:, None]
    return np.asarray(np.linalg.solve(H + damping * np.eye(unit.size), H @ (value.step * unit)) / unit, np.float64)
