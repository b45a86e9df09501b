"""The data of a fit: recordings with their noise, and prior knowledge."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Complexes, Reals, complex_log
from ...models.base.model import Model
from ...models.sweep import Sweep

_FEW = 100
# Points of a reduced recording: its minimum is a few standard uncertainties from that of all points.


@dataclass(frozen=True)
class Prior:
    """Prior of a model parameter: mean and standard uncertainty, SI."""

    parameter: str
    mean: float
    u: float

    @property
    def needs(self) -> tuple[str, ...]:
        """The model parameters that it is about."""
        return (self.parameter,)

    def deviation(self, values: Mapping[str, float]) -> float:
        """Return how improbably far the model is from the mean, in standard uncertainties."""
        return (self.predicted(values) - self.mean) / self.u

    def predicted(self, values: Mapping[str, float]) -> float:
        """Return the value of the model for which the mean was measured."""
        return values[self.parameter]

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivatives of `predicted` by the model parameters."""
        return {self.parameter: 1.0}


@dataclass(frozen=True)
class QualityFactor(Prior):
    """Prior of a quality factor, which scatters by factors: 40 with a `u` of 25 may be 20 or 80, but never 1.

    Fits use the normal density, which also ends the way of a fit towards no loss at all. How probable a value is tells
    the log-normal one of the same `u`.
    """

    def deviation(self, values: Mapping[str, float]) -> float:
        """Return how far the logarithm is from that of the mean, in standard uncertainties."""
        ratio = max(values[self.parameter] / self.mean, 1e-300)
        return float(np.log(ratio) / np.sqrt(np.log1p((self.u / self.mean) ** 2)))


@dataclass(frozen=True)
class Weighing(Prior):
    """The mass (kg) of the layers of a step: area times the sum of density times thickness.

    Unlike a density computed from the mass, it carries the correlation of density with thickness and area.
    """

    densities: tuple[tuple[str, ...], ...] = ()
    """For each layer the parameter `density`, or those of an elastic layer: `z` and `c`, density = z/c."""
    thicknesses: tuple[str, ...] = ()

    @property
    def needs(self) -> tuple[str, ...]:
        """Area, densities and thicknesses."""
        return ("area", *(name for names in self.densities for name in names), *self.thicknesses)

    def predicted(self, values: Mapping[str, float]) -> float:
        """Return the mass of the model, kg."""
        return values["area"] * sum(per_area for _, _, per_area in self._layers(values))

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivatives of the mass."""
        layers, area = self._layers(values), values["area"]
        slopes = dict.fromkeys(self.needs, 0.0)
        slopes["area"] = sum(per_area for _, _, per_area in layers)
        for names, thickness, per_area in layers:
            for name, power in zip(names, (1, -1), strict=False):
                slopes[name] += power * area * per_area / values[name]
            slopes[thickness] += area * per_area / values[thickness]
        return slopes

    def _layers(self, values: Mapping[str, float]) -> list[tuple[tuple[str, ...], str, float]]:
        """Return density names, thickness name and mass per area of each layer."""
        pairs = zip(self.densities, self.thicknesses, strict=True)
        return [
            (names, thickness, values[names[0]] / (values[names[1]] if len(names) > 1 else 1.0) * values[thickness])
            for names, thickness in pairs
        ]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of earlier steps over the free coordinates, with all correlations."""

    names: tuple[str, ...]
    """Names of the coordinates."""
    mean: Reals
    """Shape (M,), in the coordinates of `Objective.straight`."""
    root: Reals
    """Root of the information, shape (R, M): root (y - mean) are residuals of unit variance."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One sweep with its noise and the model that should describe it."""

    step: str
    sweep: Sweep
    model: Model
    """Contains the constants of its step; `Model.replace` accepts the names that the fit changes."""
    noise: Reals
    """Standard deviation of Re and Im of ln Z at each point, shape (N,)."""
    misfit: float = 0.0
    """Known model error, as further noise of Re and Im of ln Z."""
    correlation: float = 1.0
    """Number of correlated points that count as one."""
    renamed: Mapping[str, str] = field(default_factory=dict[str, str])
    """Parameters of the model that have another name in the fit: `ml1.thickness` after it was ground."""
    colour_limit: float = 1.0
    """Largest correlation that the noise of neighbouring points can have."""
    weighting: Literal["log", "thesis"] = "log"
    """`log`: ln(Z_model/Z)/sigma. `thesis`: w (Z_model - Z), scaled as a whole to the noise."""

    @cached_property
    def sigma(self) -> Reals:
        """Divisor of the residuals, shape (N,)."""
        return np.sqrt((self.noise**2 + self.misfit**2) * self.correlation)

    @cached_property
    def _log_weight(self) -> Reals:
        return 1 / self.sigma

    @property
    def spread(self) -> Reals:
        """Standard deviation of each weighted residual due to noise, shape (N,); its rms is 1."""
        if self.weighting == "log":
            return np.ones(self.sweep.frequency.size)
        size = self._lever * self.sigma
        return size / float(np.sqrt(np.mean(size**2)))

    @property
    def _lever(self) -> Reals:
        """|w Z|, shape (N,)."""
        return 2 * np.pi * self.sweep.frequency * np.abs(self.sweep.impedance)

    def weighted(self, Z: Complexes) -> tuple[Complexes, Reals | Complexes]:
        """Return the weighted residuals of a model Z, shape (N,), and the factors d residual / d ln Z, shape (N,)."""
        if self.weighting == "log":
            return log_ratio(Z, self.sweep.impedance) * self._log_weight, self._log_weight
        scale = 2 * np.pi * self.sweep.frequency / float(np.sqrt(np.mean((self._lever * self.sigma) ** 2)))
        return scale * (Z - self.sweep.impedance), scale * Z


def recorded_band(recordings: Sequence[Recording]) -> tuple[float, float]:
    """Return the lowest and the highest frequency of all recordings, Hz."""
    lowest = min(float(recording.sweep.frequency[0]) for recording in recordings)
    return lowest, max(float(recording.sweep.frequency[-1]) for recording in recordings)


def log_ratio(model: Complexes, measured: Complexes) -> Complexes:
    """Return ln(Z_model / Z_measured), imaginary part in (-pi, pi]."""
    return complex_log(model / measured)


def along_curve(impedance: Complexes) -> NDArray[np.intp]:
    """Return the indices of a hundred points at most, evenly spaced along the curve of ln Z."""
    way = np.cumsum(np.abs(np.diff(np.log(impedance), prepend=0.0)))
    return np.unique(np.searchsorted(way, np.linspace(float(way[0]), float(way[-1]), _FEW)))


def rms(*log_ratios: Complexes) -> float:
    """Return the rms of |ln(Z_model/Z_measured)| over all points of all recordings, each of shape (N,)."""
    return float(np.sqrt(np.mean(np.abs(np.concatenate(log_ratios)) ** 2)))
