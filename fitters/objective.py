"""What is minimised: noise-weighted complex residuals of ln Z over all steps at once, and what was known before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..models.arrays import Complexes, Reals
from ..models.errors import PzctlError
from ..models.model import Model
from ..models.sweep import Sweep
from .coordinates import Coordinates

_NOWHERE = 1e8
_LOSSES = (".c33D.loss", ".eps33S.loss")
_LOSS_MEAN, _LOSS_WIDTH = float(np.log(0.01)), 2.3
# Logarithm of a loss tangent before any measurement: from 1e-4 to 1 within two standard deviations. A recording tells
# it a thousand times better; where a wrong model would want a negative loss, this keeps the logarithm from running off.


@dataclass(frozen=True)
class Prior:
    """What is known of a model parameter before the fit: mean and standard uncertainty, SI."""

    parameter: str
    mean: float
    u: float


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

    @property
    def sigma(self) -> Reals:
        """What residuals are weighted by, shape (N,)."""
        return np.sqrt((self.noise**2 + self.misfit**2) * self.correlation)


def log_ratio(model: Complexes, measured: Complexes) -> Complexes:
    """Return ln(Z_model / Z_measured), imaginary part in (-pi, pi]."""
    return np.log(model / measured)


class Objective:
    """Residuals and exact Jacobian over the moving coordinates of a fit."""

    def __init__(self, recordings: Sequence[Recording], coordinates: Coordinates, priors: Sequence[Prior]) -> None:
        self.recordings = tuple(recordings)
        self.coordinates = coordinates
        self.priors = tuple(prior for prior in priors if prior.parameter in coordinates.parameters)
        self.evaluations = 0
        self._owned = [
            [k for k, name in enumerate(coordinates.parameters) if name in recording.model.parameters()]
            for recording in self.recordings
        ]
        self._losses = [k for k, name in enumerate(coordinates.free) if name.endswith(_LOSSES)]
        self._rows = 2 * self.points + len(self.priors) + len(self._losses)
        self._row = {name: k for k, name in enumerate(coordinates.parameters)}
        self._moving = np.zeros(0)
        self._cache: tuple[Reals, Reals] = (np.zeros(0), np.zeros((0, 0)))

    @property
    def points(self) -> int:
        """Number of complex points."""
        return sum(recording.sweep.frequency.size for recording in self.recordings)

    def models(self, x: Reals) -> tuple[Model, ...]:
        """Return the model of each recording at these coordinates."""
        values, _ = self.coordinates.forward(x)
        return tuple(self._with(k, values) for k in range(len(self.recordings)))

    def _with(self, k: int, values: Mapping[str, float]) -> Model:
        names = self.coordinates.parameters
        return self.recordings[k].model.replace({names[i]: values[names[i]] for i in self._owned[k]})

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
        rows: list[Reals] = []
        for k, recording in enumerate(self.recordings):
            moved = [i for i in self._owned[k] if np.any(chain[i])]
            names = [self.coordinates.parameters[i] for i in moved]
            Z, dlnZ = self._with(k, values).jacobian(recording.sweep.frequency, names)
            sigma = recording.sigma
            r = log_ratio(Z, recording.sweep.impedance) / sigma
            J = (dlnZ / sigma).T @ chain[moved]
            residuals += [r.real, r.imag]
            rows += [J.real, J.imag]
        for prior in self.priors:
            i = self._row[prior.parameter]
            residuals.append(np.array([(values[prior.parameter] - prior.mean) / prior.u]))
            rows.append(chain[i][None, :] / prior.u)
        tether = np.zeros((len(self._losses), x.size))
        tether[range(len(self._losses)), self._losses] = 1 / _LOSS_WIDTH
        residuals.append((x[self._losses] - _LOSS_MEAN) / _LOSS_WIDTH)
        return np.concatenate(residuals), np.concatenate([*rows, tether])

    def residual(self, x: Reals) -> Reals:
        """Return the weighted residuals, Re and Im of each recording in turn, then priors and losses."""
        return self._evaluate(x)[0]

    def jacobian(self, x: Reals) -> Reals:
        """Return d residual / d moving coordinate."""
        return self._evaluate(x)[1]

    def log_ratios(self, x: Reals) -> tuple[Complexes, ...]:
        """Return ln(Z_model/Z_measured) of each recording."""
        return tuple(
            log_ratio(model.impedance(recording.sweep.frequency), recording.sweep.impedance)
            for model, recording in zip(self.models(x), self.recordings, strict=True)
        )
