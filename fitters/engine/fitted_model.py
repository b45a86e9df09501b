"""What a diagnosis needs of a fit, by whatever model: its minimum, and the scales on which effects matter."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from ...models.base.arrays import Reals
from ...models.effects import Device
from ...models.stack import Stack
from ..interface import Constant, FitTask
from .descent import Descent
from .objective import Objective
from .parameters.coordinates import Coordinates
from .recording import Posterior


@dataclass(frozen=True, eq=False)
class Seed:
    """Effects together with which a model was fitted: a search from the fit without them might not get there."""

    names: frozenset[tuple[str, str]]
    """Name and place of each, present in all steps."""
    values: Mapping[str, float]
    """Every parameter, those of the effects included."""


def without_effects(descent: Descent, names: Collection[str]) -> Descent:
    """Return a fit with the coordinates and priors of these effects taken away; its values stay where they are."""
    before = descent.objective
    values, _ = before.coordinates.forward(descent.x)

    def stays(name: str) -> bool:
        effect, at, _ = name.partition("@")
        return not at or effect not in names

    own = {name: value for name, value in values.items() if stays(name)}
    if len(own) == len(values):
        return descent
    blocks = tuple(block for block in before.coordinates.blocks if all(map(stays, block.parameters)))
    kept = Coordinates(blocks, own, tuple(filter(stays, before.coordinates.free)))
    priors = [
        one for one in before.all_priors if all(map(stays, one.names if isinstance(one, Posterior) else one.needs))
    ]
    bare = [
        replace(one, model=one.model.bare if isinstance(one.model, Device) else one.model) for one in before.recordings
    ]
    return replace(descent, objective=Objective(bare, kept, priors), start=kept.x, x=kept.x)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model fitted to recordings. The minimum holds its recordings, coordinates and priors."""

    descent: Descent
    scale: Stack
    """The device as a plate: it sets sizes and reference frequencies of effects (see `equivalent_plate`)."""
    units: Mapping[str, str]
    """Unit of each constant, by its name or by the part after the first dot (`s11E`, `C0`)."""
    seeds: tuple["Seed", ...] = ()
    """Where a search for effects begins, beside the fit without any."""

    def coordinates(self, steps: Sequence[str], values: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of the fit, starting at `values`."""
        own = self.descent.objective.coordinates
        return Coordinates(own.blocks, values, own.free)

    def restart(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return values from which a fit can start: these."""
        return values

    def as_stated(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the values: no build states a layer."""
        return values

    def constants(
        self, steps: Sequence[str], values: Mapping[str, float], names: Sequence[str], covariance: Reals
    ) -> dict[str, Constant]:
        """Return the constants with standard uncertainties; `covariance` is that of the parameters `names`."""
        u = dict(zip(names, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
        found: dict[str, Constant] = {}
        for name in self.descent.objective.coordinates.parameters:
            if name.endswith(".im"):
                continue
            full, im = name.removesuffix(".re"), name.removesuffix(".re") + ".im"
            unit = self.units.get(full) or self.units.get(full.partition(".")[2], "1")
            pair = (values[im], u.get(im, 0.0)) if name.endswith(".re") else (0.0, 0.0)
            found[full] = Constant(values[name], pair[0], u.get(name, 0.0), pair[1], unit, free=u.get(name, 0.0) > 0)
        return found


@runtime_checkable
class Diagnosable(Protocol):
    """A fitter whose model can be diagnosed."""

    name: str
    """As on the command line."""

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted model. Raises FitError as `fit` does."""
        ...
