"""What a person chooses of a fit, and what a fitter's model must offer so that it can be taken in hand."""

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
"""From, to, in Hz."""
Kept = Mapping[str, Sequence[tuple[Sweep, NDArray[np.float64]]]]
"""By step: what takes part of its sweeps, and the standard deviation of Re and Im of ln Z at each point."""


@dataclass(frozen=True)
class Choices:
    """What a person chose; the default is what the model's own fitter does, from the values it is given."""

    free: tuple[str, ...] | None = None
    """Names of the handles that move, exactly; None: all that carry an uncertainty, and all of the effects'."""
    values: Mapping[str, float] = field(default_factory=dict[str, float])
    """Where handles begin, SI; those that are not named are where they were."""
    bands: Mapping[str, Bands] = field(default_factory=dict[str, Bands])
    """By step, Hz: what takes part. A step that is not named does with all its fitter takes, one without bands not."""
    effects: tuple[tuple[str, str], ...] = ()
    """Name and place, as in `lead-inductance`, `terminals`."""


class FitSetup(Protocol):
    """The recordings that take part, each with the model that is to describe it."""

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The recordings, without effects."""
        ...

    @property
    def priors(self) -> tuple[Prior, ...]:
        """What is known beforehand."""
        ...

    def places(self, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
        """Return the effects that the model can be extended by, all or those called `names`."""
        ...

    def with_effects(self, effects: Sequence[Candidate]) -> tuple[Recording, ...]:
        """Return the recordings, their models extended by these effects."""
        ...

    def coordinates(
        self, effects: Sequence[Candidate], values: Mapping[str, float], free: tuple[str, ...] | None
    ) -> Coordinates:
        """Return the coordinates of a fit from `values` in which those named `free` move; None: the usual ones."""
        ...


class Subject(Protocol):
    """The model of one fitter, and the recordings that it is for."""

    values: dict[str, float]
    """Where handles begin, by model parameter."""

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
        """By step, in gluing order; what the fitter has no model for is left out."""
        ...

    @property
    def noises(self) -> Mapping[str, Sequence[NDArray[np.float64]]]:
        """By step, for each sweep: standard deviation of Re and Im of ln Z at each point."""
        ...

    @property
    def usual(self) -> Bands:
        """What takes part of each step where no band is chosen."""
        ...

    @property
    def parts(self) -> Bands:
        """Between these limits each sweep is a recording with a misfit of its own."""
        ...

    @property
    def says(self) -> tuple[str, ...]:
        """What a person must know of where it begins."""
        ...

    def pose(self, kept: Kept) -> FitSetup:
        """Return the recordings of what takes part."""
        ...

    def answer(self, steps: Sequence[str], descent: Descent, seconds: float) -> FitResult:
        """Return the answer of a fit over these steps."""
        ...


def check_bands(choices: Choices, steps: Sequence[str]) -> None:
    """Raise FitError for bands of a step that was not recorded, or that are none."""
    for step, bands in choices.bands.items():
        if step not in steps:
            raise FitError(f"bands of step {step!r}: it was not recorded; {', '.join(steps)} was")
        for low, high in bands:
            if not 0 <= low < high:
                raise FitError(f"band {low / 1e6:g} to {high / 1e6:g} MHz of step {step!r}: the lower end comes first")


def within(sweep: Sweep, bands: Bands) -> NDArray[np.bool_]:
    """Return which points of a sweep lie in one of the bands, shape (N,)."""
    inside = [(sweep.frequency >= low) & (sweep.frequency <= high) for low, high in bands]
    return np.any(inside, axis=0) if inside else np.zeros(sweep.frequency.size, bool)


def began_with(values: Mapping[str, float], constants: Mapping[str, Constant]) -> dict[str, float]:
    """Return model parameters, those that a fit's `constants` tell where it has them."""
    return {name: _begun_with(name, value, constants) for name, value in values.items()}


def _begun_with(name: str, value: float, constants: Mapping[str, Constant]) -> float:
    bare, _, part = name.rpartition(".")
    if part in ("re", "im") and bare in constants:
        return constants[bare].re if part == "re" else constants[bare].im
    return constants[name].re if name in constants else value
