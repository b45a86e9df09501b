"""Choices of a person for a manual fit, and the interface that a fitter's model must offer for it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...models.build import Build
from ...models.sweep import Sweep
from ..diagnosis.hypotheses.problem import Candidate
from ..engine.descent import Descent
from ..engine.parameters.coordinates import Coordinates
from ..engine.recording import Prior, Recording
from ..interface import Constant, FitError, FitResult

NAME = "by-hand"
Bands = tuple[tuple[float, float], ...]
"""Lower and upper limit, Hz."""
Kept = Mapping[str, Sequence[tuple[Sweep, NDArray[np.float64]]]]
"""By step: the selected part of its sweeps, and the standard deviation of Re and Im of ln Z at each point."""


@dataclass(frozen=True)
class Choices:
    """Choices of a person; the defaults repeat the model's own fitter, from the current values."""

    free: tuple[str, ...] | None = None
    """Names of the free adjustables, exactly; None: all that have an uncertainty, and all of the effects'."""
    values: Mapping[str, float] = field(default_factory=dict[str, float])
    """Start values, SI; others keep their current values."""
    bands: Mapping[str, Bands] = field(default_factory=dict[str, Bands])
    """Selected bands by step, Hz. An unnamed step keeps the bands of its fitter; a step without bands is excluded."""
    effects: tuple[tuple[str, str], ...] = ()
    """Name and place, as in `lead-inductance`, `terminals`."""


class FitSetup(Protocol):
    """The selected recordings, each with the model that should describe it."""

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The recordings, without effects."""
        ...

    @property
    def priors(self) -> tuple[Prior, ...]:
        """The priors."""
        ...

    def places(self, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
        """Return the effects that the model can be extended by, all or those in `names`."""
        ...

    def with_effects(self, effects: Sequence[Candidate]) -> tuple[Recording, ...]:
        """Return the recordings with their models extended by these effects."""
        ...

    def coordinates(
        self, effects: Sequence[Candidate], values: Mapping[str, float], free: tuple[str, ...] | None
    ) -> Coordinates:
        """Return the coordinates of a fit from `values` with these `free`; None: the usual ones."""
        ...


class Subject(Protocol):
    """The model of one fitter, and the recordings that it applies to."""

    values: dict[str, float]
    """Start values, by model parameter."""

    @property
    def fitter(self) -> str:
        """The fitter's name."""
        ...

    @property
    def build(self) -> Build:
        """The build."""
        ...

    @property
    def sweeps(self) -> Mapping[str, tuple[Sweep, ...]]:
        """By step, in gluing order; without recordings that the fitter has no model for."""
        ...

    @property
    def noises(self) -> Mapping[str, Sequence[NDArray[np.float64]]]:
        """By step, for each sweep: standard deviation of Re and Im of ln Z at each point."""
        ...

    @property
    def usual(self) -> Bands:
        """Bands of each step that are used if none are chosen."""
        ...

    @property
    def parts(self) -> Bands:
        """Bands that each sweep is divided into; each part has its own misfit."""
        ...

    @property
    def says(self) -> tuple[str, ...]:
        """Sentences about the start values for the user."""
        ...

    def pose(self, kept: Kept) -> FitSetup:
        """Return the fit of the selected recordings."""
        ...

    def answer(self, steps: Sequence[str], descent: Descent, seconds: float) -> FitResult:
        """Return the result of a fit over these steps."""
        ...


def check_bands(choices: Choices, steps: Sequence[str]) -> None:
    """Raise FitError for bands of a step that was not recorded, or invalid bands."""
    for step, bands in choices.bands.items():
        if step not in steps:
            raise FitError(f"bands of step {step!r}: it was not recorded; {', '.join(steps)} was")
        for low, high in bands:
            if not 0 <= low < high:
                raise FitError(f"band {low / 1e6:g} to {high / 1e6:g} MHz of step {step!r}: the lower end comes first")


def within(sweep: Sweep, bands: Bands) -> NDArray[np.bool_]:
    """Return which points of a sweep lie in one of the bands, as a mask of shape (N,)."""
    inside = [(sweep.frequency >= low) & (sweep.frequency <= high) for low, high in bands]
    return np.any(inside, axis=0) if inside else np.zeros(sweep.frequency.size, bool)


def began_with(values: Mapping[str, float], constants: Mapping[str, Constant]) -> dict[str, float]:
    """Return the model parameters with the values of a fit's `constants` where it has them."""
    return {name: _begun_with(name, value, constants) for name, value in values.items()}


def _begun_with(name: str, value: float, constants: Mapping[str, Constant]) -> float:
    bare, _, part = name.rpartition(".")
    if part in ("re", "im") and bare in constants:
        return constants[bare].re if part == "re" else constants[bare].im
    return constants[name].re if name in constants else value
