"""The marginal likelihood: errors of instrument and model, linear about known corrections, are integrated out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from ...models.base.arrays import Complexes, Impedances, Reals
from ...models.base.model import Model
from ...models.effects import Device
from ...models.effects.base.corrected_constants import EVERYWHERE, CorrectedConstants, Corrections
from ...models.effects.base.corrected_path import PATH, SERIES, CorrectedPath
from ...models.effects.base.effect import TERMINALS
from ..engine.held_constants import held_constants, kind_of, slopes_by_held
from ..engine.objective import LOADS, Objective
from ..engine.parameters.coordinates import Coordinates
from ..engine.recording import Recording
from .contained_errors import altered, layers_corrected
from .error_columns import HELD, ErrorColumns, HeldValue, LinearisedRecording, columns_of, place_of
from .error_sizes import Beforehand, Gram
from .local_error_kinds import LocalError

_UNINFORMED = 1 / 9
"""Prior precision of a coordinate about which nothing is known: a logarithm is known within a factor of twenty.

Around wherever the fit is, so that no value is preferred. Without it a thickness that recordings do not feel would run
away, and its boundless posterior volume would count as evidence."""
_LOOSE = ("z", "c", "q", "thickness", "density")
"""Held constants that may be off because a build gives them as bare numbers, mostly of glue; others are exact."""


@dataclass(frozen=True)
class FormulaError:
    """How a device may deviate from the formula of an effect."""

    through: tuple[tuple[str, Callable[[float], float]], ...]
    """Coordinates that it acts through, each with the function d coordinate / d ln parameter."""
    rough: bool
    """Whether also from one line's width of frequency to the next, and not only smoothly."""
    in_time: bool = False
    """Whether it is smooth in the time of the sweeps, and not in frequency."""


Shapes = Mapping[str, FormulaError]
"""By effect, and by parameter that may change with frequency."""


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
    shapes: Shapes = field(default_factory=dict[str, FormulaError])
    local: tuple[LocalError, ...] = ()
    corrections: Corrections | None = None
    """Corrections of constants about which the errors are linear; none: about exact constants."""
    means: Mapping[str, Reals] | None = None
    """Means of the smooth functions of errors (`ErrorColumns.means`); None: those of the point that is looked at."""

    @classmethod
    def of(
        cls,
        objective: Objective,
        known: Known | None = None,
        shapes: Shapes | None = None,
        local: tuple[LocalError, ...] = (),
    ) -> "Marginal":
        """Return the marginal fit of an objective, without the misfit weights of its recordings."""
        plain = [replace(recording, misfit=0.0, correlation=1.0) for recording in objective.recordings]
        bare = objective.with_recordings(plain, slopes_later=True)
        return cls(bare, known or Nothing(), _shapes_of(bare, shapes or {}), local)

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
        models = [known[id(one.model)] for one in self.objective.recordings]
        coordinates, held = self.objective.coordinates, self.corrections.held
        if held:
            start = {name: value * float(np.exp(held.get(name, 0.0))) for name, value in coordinates.start.items()}
            coordinates = Coordinates(coordinates.blocks, start, coordinates.free)
        return self.objective.with_models(models, coordinates)

    def columns(self, x: Reals) -> ErrorColumns:
        """Return the columns of errors at a point."""
        J = self.slopes(x)
        free = self.objective.coordinates.free
        places: list[LinearisedRecording] = []
        for k, (recording, model) in enumerate(zip(self.objective.recordings, self.models(x), strict=True)):
            shapes = {
                name: sum(
                    (J[k][:, free.index(at)] * per(float(x[free.index(at)])) for at, per in error.through),
                    np.zeros(len(J[k]), np.complex128),
                )
                for name, error in self.shapes.items()
            }
            rough = [shapes[name] for name, error in self.shapes.items() if error.rough]
            places.append(place_of(replace(recording, model=model), shapes, rough, self._in_series(recording)))
        held = self._held(x)
        in_time = frozenset(name for name, error in self.shapes.items() if error.in_time)
        made = columns_of(places, held, self.local, means=self.means, in_time=in_time)
        if self.corrections is None:
            return made
        absorbed = [self._absorbed(place) for place in places]
        for one in held:
            moved = self.corrections.held.get(one.name, 0.0) / one.relative
            absorbed = [total + moved * own for total, own in zip(absorbed, one.columns, strict=True)]
        return replace(made, absorbed=tuple(absorbed))

    def renewed(self, x: Reals, columns: ErrorColumns) -> ErrorColumns:
        """Return columns with the derivatives of this point by what the model contains; the others as they are."""
        held = {HELD + one.name: one for one in self._held(x)}
        blocks: list[Complexes] = []
        for k, (recording, model) in enumerate(zip(self.objective.recordings, self.models(x), strict=True)):
            place = place_of(replace(recording, model=model), {}, [], self._in_series(recording))
            slopes = {name: place.path_slope(name) for name in PATH}
            slopes |= {name: own for name, own in place.felt.items() if name in self.of_layers}
            slopes |= {name: one.columns[k] / one.relative for name, one in held.items()}
            block = columns.blocks[k].copy()
            for column, one in enumerate(columns.corrections):
                if one is not None and one.name in slopes:
                    np.multiply(slopes[one.name], one.relative[k], out=block[:, column])
            blocks.append(block)
        return replace(columns, blocks=tuple(blocks))

    def _in_series(self, recording: Recording) -> Impedances | float:
        """Return what the path that the model contains has in series in a recording, shape (N,)."""
        path = None if self.corrections is None else self.corrections.paths.get(recording.step)
        return 0.0 if path is None or altered(recording.model) else path.over(SERIES, recording.sweep.frequency)

    def _absorbed(self, place: LinearisedRecording) -> Complexes:
        """Return what the corrections change in ln Z of a recording to first order, shape (N,)."""
        total, known, f = np.zeros(place.Z.size, np.complex128), self.corrections, place.recording.sweep.frequency
        if known is None:
            return total
        for name in known.relative:
            if name in place.felt:
                total += place.felt[name] * known.over(name, f)
        path = known.paths.get(place.recording.step)
        if path is not None and not altered(place.recording.model):
            total += sum(path.over(name, f) * place.path_slope(name) for name in PATH)
        return total

    def centred(self, means: Mapping[str, Reals]) -> "Marginal":
        """Return the same with smooth functions of errors less these means, wherever it is looked at."""
        return replace(self, means=means)

    def slopes(self, x: Reals) -> list[Complexes]:
        """Return the derivatives of the residuals of each recording, shape (N, M)."""
        return self._unweighted(self._corrected.jacobian(x).T)

    @cached_property
    def of_layers(self) -> frozenset[str]:
        """Names of the constants of layers that the model can contain corrections of."""
        return frozenset(name for one in self.objective.recordings for name in layers_corrected(one.model))

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
        return Gram(columns, self.slopes(x), columns.beyond(self.residuals(x)), self.beforehand(x))

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
        J = np.concatenate([self._corrected.jacobian(x)[data:], slopes])  # before the residuals, which it computes too
        r = np.concatenate([self._corrected.residual(x)[data:], more])
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


def _with_corrections(device: Device, step: str, corrections: Corrections) -> Device:
    """Return a device with the corrected constants of its layers and the corrected path of its step."""
    if corrections.relative:
        device = device.with_effect(CorrectedConstants(corrections), EVERYWHERE)
    path = corrections.paths.get(step)
    return device if path is None or altered(device) else device.with_effect(CorrectedPath(path), TERMINALS)


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
        one.prefix: FormulaError(
            tuple((name, lambda _: 1.0) for name in list(one.parameters())[: one.effect.sizes] if name in free),
            one.effect.errs_roughly,
            one.effect.errs_in_time,
        )
        for one in added
    }
    return {**stated, **searched}
