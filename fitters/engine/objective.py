"""Objective: noise-weighted complex residuals of ln Z over all steps, and the residuals of priors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ...models.base.copies import changed
from ...models.base.errors import PzctlError
from ...models.base.model import Model
from .parameters.coordinates import Coordinates
from .recording import Posterior, Prior, Recording, log_ratio

LOADS = ("back.z", "front.z")
_NOWHERE = 1e8
_LOSS_MEAN, _LOSS_WIDTH = float(np.log(0.01)), 2.3
# Prior of ln tan d: from 1e-4 to 1 within two standard deviations. A recording determines it a thousand times better;
# if a wrong or unfinished model would favour a negative loss, this prior keeps the logarithm from diverging.


@dataclass(frozen=True, eq=False)
class _Shared:
    """Consecutive recordings with the same model, which is evaluated once over the points of all of them."""

    model: Model
    owned: Mapping[int, str]
    """Rows of the fit's parameters that the model has, and their names in the model."""
    recordings: tuple[Recording, ...]
    frequency: Reals
    """Frequencies of all recordings in turn."""
    parts: tuple[slice, ...]
    """Slice of each recording's points."""


class Objective:
    """Residuals and exact Jacobian over the free coordinates of a fit.

    With `slopes_later`, derivatives are computed only on request, because some models' derivatives cost many times as
    much as a curve and a rejected step needs none.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        coordinates: Coordinates,
        priors: Sequence[Prior | Posterior],
        *,
        slopes_later: bool = False,
    ) -> None:
        self.recordings = tuple(recordings)
        self.coordinates = coordinates
        known = [prior for prior in priors if isinstance(prior, Prior)]
        self.priors = tuple(prior for prior in known if set(prior.needs) <= set(coordinates.parameters))
        self.posteriors = tuple(prior for prior in priors if isinstance(prior, Posterior))
        self.evaluations = 0
        self._row = {name: k for k, name in enumerate(coordinates.parameters)}
        self._shared = [self._shared_by(alike) for alike in _alike(self.recordings)]
        told = {name for posterior in self.posteriors for name in posterior.names}
        self._losses = [k for k in coordinates.log_losses if coordinates.free[k] not in told]
        self._told = [self._told_by(posterior) for posterior in self.posteriors]
        self._mean = np.array([prior.mean for prior in self.priors])
        self._u = np.array([prior.u for prior in self.priors])
        self._tether = np.zeros((len(self.coordinates.free), len(self._losses)))
        self._tether[self._losses, range(len(self._losses))] = 1 / _LOSS_WIDTH
        self._rows = 2 * self.points + len(self.priors) + len(self._losses) + sum(len(root) for root, _ in self._told)
        self._slopes_later = slopes_later
        self._cache: _Evaluation | None = None

    def _shared_by(self, alike: tuple[Recording, ...]) -> _Shared:
        first = alike[0]
        there = {first.renamed.get(name, name): name for name in first.model.parameters()}
        owned = {self._row[name]: there[name] for name in self.coordinates.parameters if name in there}
        ends = np.cumsum([0, *(recording.sweep.frequency.size for recording in alike)]).tolist()
        frequency = np.concatenate([recording.sweep.frequency for recording in alike])
        frequency.flags.writeable = False  # so that a stack may cache its results for these points
        return _Shared(first.model, owned, alike, frequency, tuple(map(slice, ends[:-1], ends[1:])))

    def _told_by(self, posterior: Posterior) -> tuple[Reals, Reals]:
        """Return root and mean over the free coordinates; a coordinate that is now held keeps its value."""
        free = self.coordinates.free
        root, mean = np.zeros((len(posterior.root), len(free))), np.zeros(len(free))
        for k, name in enumerate(posterior.names):
            if name in free:
                root[:, free.index(name)], mean[free.index(name)] = posterior.root[:, k], posterior.mean[k]
        return root, mean

    def straight(self, x: Reals) -> tuple[Reals, Reals]:
        """Return the coordinates in which posteriors are linear, shape (M,), and their derivatives by x.

        These are x itself, except for loads, which are given in Rayl: a load's coordinate is strongly curved near zero,
        where an earlier step knows it to a part in a million.
        """
        values, chain = self.coordinates.forward(x)
        y, slope = x.copy(), np.ones(x.size)
        for k, name in enumerate(self.coordinates.free):
            if name in LOADS:
                y[k], slope[k] = values[name], chain[self._row[name], k]
        return y, slope

    @property
    def all_priors(self) -> tuple[Prior | Posterior, ...]:
        """All that is known beforehand, for another objective: of single quantities, and of several coordinates."""
        return (*self.priors, *self.posteriors)

    def with_recordings(self, recordings: Sequence[Recording], *, slopes_later: bool = False) -> "Objective":
        """Return the objective of the same coordinates, with all that is known beforehand, for other recordings."""
        return Objective(recordings, self.coordinates, self.all_priors, slopes_later=slopes_later)

    def with_models(self, models: Sequence[Model], coordinates: Coordinates) -> "Objective":
        """Return the objective of the same recordings with other models, which have the same parameters.

        `models`: of each recording; `coordinates`: the same ones, of which the held ones may have other values.
        """
        recordings = tuple(changed(one, model=own) for one, own in zip(self.recordings, models, strict=True))
        following = iter(recordings)
        alike = [tuple(next(following) for _ in shared.recordings) for shared in self._shared]
        shared = [
            changed(old, model=new[0].model, recordings=new) for old, new in zip(self._shared, alike, strict=True)
        ]
        return changed(self, recordings=recordings, coordinates=coordinates, _shared=shared, _cache=None, evaluations=0)

    @property
    def points(self) -> int:
        """Number of complex points."""
        return sum(recording.sweep.frequency.size for recording in self.recordings)

    def models(self, x: Reals) -> tuple[Model, ...]:
        """Return the model of each recording at these coordinates; those of the last evaluation with their caches."""
        models = self._known_models(x) or self._models_for(self.coordinates.forward(x)[0])
        pairs = zip(models, self._shared, strict=True)
        return tuple(model for model, shared in pairs for _ in shared.recordings)

    def _known_models(self, x: Reals) -> tuple[Model, ...]:
        """Return the models of the last evaluation, if that was at x."""
        return self._cache.models if self._cache is not None and np.array_equal(x, self._cache.x) else ()

    def _models_for(self, values: Mapping[str, float]) -> tuple[Model, ...]:
        return tuple(self._with(shared, values) for shared in self._shared)

    def _with(self, shared: _Shared, values: Mapping[str, float]) -> Model:
        names = self.coordinates.parameters
        return shared.model.replace({parameter: values[names[i]] for i, parameter in shared.owned.items()})

    def _evaluated(self, x: Reals, *, slopes: bool) -> "_Evaluation":
        known = self._cache if self._cache is not None and np.array_equal(x, self._cache.x) else None
        if known is None or (slopes and known.slopes is None):
            self.evaluations += known is None
            evaluate = self._evaluate if slopes or not self._slopes_later else self._residual
            known = self._cache = self._guarded(x, evaluate)
        return known

    def _guarded(self, x: Reals, evaluate: "Callable[[Reals], _Evaluation]") -> "_Evaluation":
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                evaluation = evaluate(x)
            if np.all(np.isfinite(evaluation.residual)):
                return evaluation
        except (PzctlError, ArithmeticError):
            pass
        # A step so long that a layer vanishes: a huge residual makes the optimiser take a shorter one.
        return _Evaluation(x.copy(), np.full(self._rows, _NOWHERE), np.zeros((x.size, self._rows)), ())

    def _residual(self, x: Reals) -> "_Evaluation":
        """Evaluate the models without derivatives."""
        values, _ = self.coordinates.forward(x)
        models = self._models_for(values)
        wholes = [model.impedance(shared.frequency) for shared, model in zip(self._shared, models, strict=True)]
        curves = self._parted(wholes)
        r, _ = self._weighed(x, values, curves)
        return _Evaluation(x.copy(), r, None, curves, models)

    def _evaluate(self, x: Reals) -> "_Evaluation":
        """Evaluate the models and their derivatives."""
        values, chain = self.coordinates.forward(x)
        models = self._known_models(x) or self._models_for(values)
        moves: list[bool] = np.any(chain, axis=1).tolist()
        moved = [[i for i in shared.owned if moves[i]] for shared in self._shared]
        answers = [
            model.jacobian(shared.frequency, [shared.owned[i] for i in indices])
            for shared, model, indices in zip(self._shared, models, moved, strict=True)
        ]
        curves = self._parted([whole for whole, _ in answers])
        r, weights = self._weighed(x, values, curves)
        weight = iter(weights)
        J, row = np.empty((x.size, self._rows)), 0
        for shared, (_, slopes), indices in zip(self._shared, answers, moved, strict=True):
            down = chain[indices].T
            for part in shared.parts:
                # as real numbers, Re and Im in turn: chain is real, and a complex product would cost four times as much
                rows = down @ np.multiply(slopes[:, part], next(weight), dtype=np.complex128).view(np.float64)
                size = part.stop - part.start
                J[:, row : row + size], J[:, row + size : row + 2 * size] = rows[:, 0::2], rows[:, 1::2]
                row += 2 * size
        near = row + len(self.priors)
        J[:, row:near] = (self._prior_slopes(values) @ chain / self._u[:, None]).T
        J[:, near : near + len(self._losses)] = self._tether
        if self._told:
            _, slope = self.straight(x)
            J[:, near + len(self._losses) :] = np.concatenate([root * slope for root, _ in self._told]).T
        return _Evaluation(x.copy(), r, J, curves, models)

    def _prior_slopes(self, values: Mapping[str, float]) -> Reals:
        """Return the derivatives of what the priors are about by the parameters, shape (priors, P)."""
        slopes = np.zeros((len(self.priors), len(self._row)))
        for k, prior in enumerate(self.priors):
            for name, slope in prior.slopes(values).items():
                slopes[k, self._row[name]] = slope
        return slopes

    def _parted(self, wholes: Sequence[Complexes]) -> tuple[Complexes, ...]:
        """Split curves over shared models into one curve per recording."""
        return tuple(Z[part] for Z, shared in zip(wholes, self._shared, strict=True) for part in shared.parts)

    def _weighed(
        self, x: Reals, values: Mapping[str, float], curves: Sequence[Complexes]
    ) -> tuple[Reals, list[Reals | Complexes]]:
        """Return the residuals, and the factors d residual / d ln Z of each recording."""
        r, row = np.empty(self._rows), 0
        weights: list[Reals | Complexes] = []
        for recording, Z in zip(self.recordings, curves, strict=True):
            residual, weight = recording.weighted(Z)
            size = residual.size
            r[row : row + size], r[row + size : row + 2 * size] = residual.real, residual.imag
            weights.append(weight)
            row += 2 * size
        r[row:] = np.concatenate(self._beforehand(x, values))
        return r, weights

    def _beforehand(self, x: Reals, values: Mapping[str, float]) -> list[Reals]:
        """Return the residuals of priors, losses and earlier steps' posteriors."""
        priors = self.prior_deviations(values)
        losses = (x[self._losses] - _LOSS_MEAN) / _LOSS_WIDTH
        y, _ = self.straight(x) if self._told else (x, x)
        return [priors, losses, *(root @ (y - mean) for root, mean in self._told)]

    def prior_deviations(self, values: Mapping[str, float]) -> Reals:
        """Return how far the parameters are from their priors in a fit, in standard uncertainties, shape (K,)."""
        return (np.array([prior.predicted(values) for prior in self.priors]) - self._mean) / self._u

    def improbability(self, values: Mapping[str, float]) -> Reals:
        """Return how improbably far the parameters are from their priors, in standard uncertainties, shape (K,)."""
        return np.array([prior.deviation(values) for prior in self.priors], np.float64)

    def cost(self, x: Reals) -> float:
        """Return half the sum of squares at x without derivatives; infinite where the model does not exist."""
        self.evaluations += 1
        total = 0.0
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                values, _ = self.coordinates.forward(x)
                for shared in self._shared:
                    whole = self._with(shared, values).impedance(shared.frequency)
                    for recording, part in zip(shared.recordings, shared.parts, strict=True):
                        r, _ = recording.weighted(whole[part])
                        total += float(np.vdot(r, r).real)
        except (PzctlError, ArithmeticError):
            return np.inf
        total += sum(float(r @ r) for r in self._beforehand(x, values))
        return total / 2 if np.isfinite(total) else np.inf

    def forget(self) -> None:
        """Release the last evaluation."""
        self._cache = None

    def residual(self, x: Reals) -> Reals:
        """Return the weighted residuals: Re and Im of each recording in turn, then priors and losses."""
        return self._evaluated(x, slopes=False).residual

    def jacobian(self, x: Reals) -> Reals:
        """Return d residual / d free coordinate, shape (R, M)."""
        return cast(Reals, self._evaluated(x, slopes=True).slopes).T

    @property
    def spread(self) -> Reals:
        """Standard deviation of each weighted residual of the recordings due to noise, Re and Im in turn."""
        return np.concatenate([np.tile(recording.spread, 2) for recording in self.recordings])

    def curves(self, x: Reals) -> tuple[Complexes, ...]:
        """Return the model's impedance at the points of each recording, ohm."""
        if self._cache is not None and self._cache.curves and np.array_equal(x, self._cache.x):
            return self._cache.curves
        values, _ = self.coordinates.forward(x)
        return self._parted([self._with(shared, values).impedance(shared.frequency) for shared in self._shared])

    def log_ratios(self, x: Reals) -> tuple[Complexes, ...]:
        """Return ln(Z_model/Z_measured) of each recording."""
        pairs = zip(self.curves(x), self.recordings, strict=True)
        return tuple(log_ratio(Z, recording.sweep.impedance) for Z, recording in pairs)


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """Values of an objective at one point."""

    x: Reals
    residual: Reals
    slopes: Reals | None
    """d residual / d free coordinate, shape (M, R), column by column as MINPACK needs it; None if not yet computed."""
    curves: tuple[Complexes, ...]
    """Model impedance of each recording, ohm; empty if the model does not exist."""
    models: tuple[Model, ...] = ()
    """The models with their caches, for derivatives that are asked for later."""


def _alike(recordings: Sequence[Recording]) -> list[tuple[Recording, ...]]:
    """Group consecutive recordings with the same model."""
    groups: list[list[Recording]] = []
    for recording in recordings:
        last = groups[-1][0] if groups else None
        if last is not None and last.model is recording.model and last.renamed == recording.renamed:
            groups[-1].append(recording)
        else:
            groups.append([recording])
    return [tuple(alike) for alike in groups]
