"""What is minimised: noise-weighted complex residuals of ln Z over all steps at once, and what was known before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..models.arrays import Complexes, Reals
from ..models.errors import PzctlError
from ..models.model import Model
from ..models.sweep import Sweep
from .coordinates import Coordinates

LOADS = ("back.z", "front.z")
_NOWHERE = 1e8
_LOSS_MEAN, _LOSS_WIDTH = float(np.log(0.01)), 2.3
# Logarithm of a loss tangent before any measurement: from 1e-4 to 1 within two standard deviations. A recording tells
# it a thousand times better; where a model that is wrong, or not right yet, would want a negative loss, this keeps the
# logarithm from running off to where nothing pulls it back.


@dataclass(frozen=True)
class Prior:
    """What is known of a model parameter before the fit: mean and standard uncertainty, SI."""

    parameter: str
    mean: float
    u: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """What earlier steps have told of the moving coordinates, with all correlations."""

    names: tuple[str, ...]
    """Of the coordinates."""
    mean: Reals
    """Shape (M,), as `Objective.straight` gives it."""
    root: Reals
    """Shape (R, M): root^T root is the information, so that root (y - mean) are residuals of unit variance."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One sweep, the model that should describe it, and its noise."""

    step: str
    sweep: Sweep
    model: Model
    """Knows the constants of its step; `Model.replace` takes those of its names that the fit moves."""
    noise: Reals
    """Standard deviation of Re and Im of ln Z at each point, shape (N,)."""
    misfit: float = 0.0
    """What the model is known to miss, as further noise of Re and Im of ln Z."""
    correlation: float = 1.0
    """How many correlated points are worth one."""
    renamed: Mapping[str, str] = field(default_factory=dict[str, str])
    """Parameters of the model that have another name in the fit: `ml1.thickness` after it was ground."""
    weighting: Literal["log", "thesis"] = "log"
    """`log`: ln(Z_model/Z)/sigma. `thesis`: w (Z_model - Z), scaled as a whole to the noise."""

    @property
    def sigma(self) -> Reals:
        """What residuals are weighted by, shape (N,)."""
        return np.sqrt((self.noise**2 + self.misfit**2) * self.correlation)

    @property
    def spread(self) -> Reals:
        """Standard deviation that the noise gives each weighted residual, shape (N,); its rms is 1."""
        if self.weighting == "log":
            return np.ones(self.sweep.frequency.size)
        size = self._lever * self.sigma
        return size / float(np.sqrt(np.mean(size**2)))

    @property
    def _lever(self) -> Reals:
        """|w Z|, shape (N,)."""
        return 2 * np.pi * self.sweep.frequency * np.abs(self.sweep.impedance)

    def weighted(self, Z: Complexes) -> tuple[Complexes, Reals | Complexes]:
        """Return the weighted residuals of a model Z, shape (N,), and what makes d residual of d ln Z, shape (N,)."""
        if self.weighting == "log":
            weight = 1 / self.sigma
            return log_ratio(Z, self.sweep.impedance) * weight, weight
        scale = 2 * np.pi * self.sweep.frequency / float(np.sqrt(np.mean((self._lever * self.sigma) ** 2)))
        return scale * (Z - self.sweep.impedance), scale * Z


def log_ratio(model: Complexes, measured: Complexes) -> Complexes:
    """Return ln(Z_model / Z_measured), imaginary part in (-pi, pi]."""
    return np.log(model / measured)


class Objective:
    """Residuals and exact Jacobian over the moving coordinates of a fit."""

    def __init__(
        self, recordings: Sequence[Recording], coordinates: Coordinates, priors: Sequence[Prior | Posterior]
    ) -> None:
        self.recordings = tuple(recordings)
        self.coordinates = coordinates
        known = [prior for prior in priors if isinstance(prior, Prior)]
        self.priors = tuple(prior for prior in known if prior.parameter in coordinates.parameters)
        self.posteriors = tuple(prior for prior in priors if isinstance(prior, Posterior))
        self.evaluations = 0
        self._row = {name: k for k, name in enumerate(coordinates.parameters)}
        self._owned = [self._owned_by(recording) for recording in self.recordings]
        self._shares = [self._first_like(recording) for recording in self.recordings]
        told = {name for posterior in self.posteriors for name in posterior.names}
        self._losses = [k for k in coordinates.log_losses if coordinates.free[k] not in told]
        self._told = [self._told_by(posterior) for posterior in self.posteriors]
        self._rows = 2 * self.points + len(self.priors) + len(self._losses) + sum(len(root) for root, _ in self._told)
        self._moving = np.zeros(0)
        self._cache: tuple[Reals, Reals] = (np.zeros(0), np.zeros((0, 0)))

    def _owned_by(self, recording: Recording) -> dict[int, str]:
        """Return the rows of the fit's parameters that a recording's model has, and what the model calls each."""
        there = {recording.renamed.get(name, name): name for name in recording.model.parameters()}
        return {self._row[name]: there[name] for name in self.coordinates.parameters if name in there}

    def _first_like(self, recording: Recording) -> int:
        """Return the first recording with the same model; sweeps of one step have it once for all."""
        same = (other.model is recording.model and other.renamed == recording.renamed for other in self.recordings)
        return next(k for k, found in enumerate(same) if found)

    def _told_by(self, posterior: Posterior) -> tuple[Reals, Reals]:
        """Return root and mean over the moving coordinates; a coordinate that is held now is where it was."""
        free = self.coordinates.free
        root, mean = np.zeros((len(posterior.root), len(free))), np.zeros(len(free))
        for k, name in enumerate(posterior.names):
            if name in free:
                root[:, free.index(name)], mean[free.index(name)] = posterior.root[:, k], posterior.mean[k]
        return root, mean

    def straight(self, x: Reals) -> tuple[Reals, Reals]:
        """Return what posteriors are straight in, shape (M,), and its derivatives by x: x itself, but loads in Rayl.

        A load's coordinate bends where the load is next to nothing, and along that bend lies what an earlier step knows
        to a part in a million.
        """
        values, chain = self.coordinates.forward(x)
        y, slope = x.copy(), np.ones(x.size)
        for k, name in enumerate(self.coordinates.free):
            if name in LOADS:
                y[k], slope[k] = values[name], chain[self._row[name], k]
        return y, slope

    @property
    def points(self) -> int:
        """Number of complex points."""
        return sum(recording.sweep.frequency.size for recording in self.recordings)

    def models(self, x: Reals) -> tuple[Model, ...]:
        """Return the model of each recording at these coordinates."""
        values, _ = self.coordinates.forward(x)
        return self._all_with(values)

    def _with(self, k: int, values: Mapping[str, float]) -> Model:
        names = self.coordinates.parameters
        return self.recordings[k].model.replace({own: values[names[i]] for i, own in self._owned[k].items()})

    def _all_with(self, values: Mapping[str, float]) -> tuple[Model, ...]:
        """Return the model of each recording; recordings of one step share theirs."""
        made = {k: self._with(k, values) for k in set(self._shares)}
        return tuple(made[k] for k in self._shares)

    def _evaluate(self, x: Reals) -> tuple[Reals, Reals]:
        if not np.array_equal(x, self._moving) or self._cache[0].size == 0:
            self.evaluations += 1
            try:
                with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                    self._cache = self._residual_and_jacobian(x)
            except (PzctlError, ArithmeticError):
                # A step so long that a layer is none any more: a huge residual makes the optimiser take a shorter one.
                self._cache = (np.full(self._rows, _NOWHERE), np.zeros((self._rows, x.size)))
            if not np.all(np.isfinite(self._cache[0])):
                self._cache = (np.full(self._rows, _NOWHERE), np.zeros((self._rows, x.size)))
            self._moving = x.copy()
        return self._cache

    def _residual_and_jacobian(self, x: Reals) -> tuple[Reals, Reals]:
        values, chain = self.coordinates.forward(x)
        residuals: list[Reals] = []
        J = np.empty((self._rows, x.size))
        row = 0
        models = self._all_with(values)
        for k, recording in enumerate(self.recordings):
            moved = [i for i in self._owned[k] if np.any(chain[i])]
            names = [self._owned[k][i] for i in moved]
            Z, slopes = models[k].jacobian(recording.sweep.frequency, names)
            r, weight = recording.weighted(Z)
            slopes = np.multiply(slopes, weight, dtype=np.complex128)
            residuals += [r.real, r.imag]
            # as real numbers, Re and Im in turn: chain is real, and a complex product would be four of these
            parts = slopes.view(np.float64).T @ chain[moved]
            J[row : row + r.size], J[row + r.size : row + 2 * r.size] = parts[0::2], parts[1::2]
            row += 2 * r.size
        known = [chain[self._row[prior.parameter]][None, :] / prior.u for prior in self.priors]
        tether = np.zeros((len(self._losses), x.size))
        tether[range(len(self._losses)), self._losses] = 1 / _LOSS_WIDTH
        _, slope = self.straight(x)
        J[row:] = np.concatenate([*known, tether, *(root * slope for root, _ in self._told)])
        return np.concatenate([*residuals, *self._beforehand(x, values)]), J

    def _beforehand(self, x: Reals, values: Mapping[str, float]) -> list[Reals]:
        """Return the residuals of what was known before: priors, losses, earlier steps."""
        priors = [(values[prior.parameter] - prior.mean) / prior.u for prior in self.priors]
        y, _ = self.straight(x) if self._told else (x, x)
        losses = (x[self._losses] - _LOSS_MEAN) / _LOSS_WIDTH
        return [np.array(priors), losses, *(root @ (y - mean) for root, mean in self._told)]

    def cost(self, x: Reals) -> float:
        """Return half the sum of squares at x, for those who need no derivatives; infinite where no model is."""
        self.evaluations += 1
        values, _ = self.coordinates.forward(x)
        total = 0.0
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                for recording, model in zip(self.recordings, self._all_with(values), strict=True):
                    r, _ = recording.weighted(model.impedance(recording.sweep.frequency))
                    total += float(np.vdot(r, r).real)
        except (PzctlError, ArithmeticError):
            return np.inf
        total += sum(float(r @ r) for r in self._beforehand(x, values))
        return total / 2 if np.isfinite(total) else np.inf

    def residual(self, x: Reals) -> Reals:
        """Return the weighted residuals, Re and Im of each recording in turn, then priors and losses."""
        return self._evaluate(x)[0]

    def jacobian(self, x: Reals) -> Reals:
        """Return d residual / d moving coordinate."""
        return self._evaluate(x)[1]

    @property
    def spread(self) -> Reals:
        """Standard deviation that the noise gives each weighted residual of the recordings, Re and Im in turn."""
        return np.concatenate([np.tile(recording.spread, 2) for recording in self.recordings])

    def log_ratios(self, x: Reals) -> tuple[Complexes, ...]:
        """Return ln(Z_model/Z_measured) of each recording."""
        return tuple(
            log_ratio(model.impedance(recording.sweep.frequency), recording.sweep.impedance)
            for model, recording in zip(self.models(x), self.recordings, strict=True)
        )
