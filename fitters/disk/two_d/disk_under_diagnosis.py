"""A fitted disk as the model of a diagnosis, and its fits together with effects at its terminals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.stack import Piezo, Stack
from ...engine.descent import descend
from ...engine.fitted_model import FittedModel
from ...engine.objective import Objective
from ...engine.parameters.assembly import stack_of
from ...engine.parameters.coordinates import Coordinates
from ...interface import Constant
from ..planar_result import PLANAR_UNITS, propagated
from .disk_fit import FittedDisk, constants_named
from .misfit_as_noise import at_level, judged, left_of
from .outside import Outside
from .reference import tensor_of
from .valley_search import COARSE, thinned

_TOLERANCE, _STILL, _MOST = 1e-5, 0.01, 12
_TOGETHER = 6
# Budget of descents with effects at the terminals, from a disk that is fitted already.


@dataclass(frozen=True, eq=False)
class DiskUnderDiagnosis(FittedModel):
    """The fitted disk, with the constants that follow from the ten."""

    layer: str = ""
    """Name of the ceramic."""

    def constants(
        self, steps: Sequence[str], values: Mapping[str, float], names: Sequence[str], covariance: Reals
    ) -> dict[str, Constant]:
        """Return the ten constants and all derived ones, sizes and density, with standard uncertainties."""
        found = super().constants(steps, values, names, covariance)
        own = self.descent.objective.coordinates.parameters
        at = [k for k, name in enumerate(names) if name in own]
        known, within = tuple(names[k] for k in at), covariance[np.ix_(at, at)]

        def make(values: Mapping[str, float]) -> dict[str, complex]:
            return constants_named(self.layer, tensor_of(values, self.layer))

        u = propagated(make, values, known, within)
        for name, value in make(values).items():
            if name not in found:
                unit = self.units[name.partition(".")[2]]
                found[name] = Constant(value.real, value.imag, *u[name], unit, free=u[name][0] > 0)
        return found


def diagnosable(found: FittedDisk) -> DiskUnderDiagnosis:
    """Return a fitted disk as the model of a diagnosis."""
    return DiskUnderDiagnosis(found.descent, plate_of(found), PLANAR_UNITS, layer=found.disk.layer.name)


def plate_of(found: FittedDisk) -> Stack:
    """Return the fitted disk as a plate, with its law of losses: it sets sizes, places and references of effects.

    By the fitted constants: by those of a library that are 5 % stiffer, a loss that goes as a power of frequency would
    be told at a frequency 2.5 % off the resonance.
    """
    plate = stack_of(found.disk.build, found.disk.build.step(found.disk.step))
    values, _ = found.descent.objective.coordinates.forward(found.descent.x)
    at, law = found.disk.layer.name, found.model.law
    own = tensor_of(values, at).thickness

    def fitted(one: Piezo) -> Piezo:
        return replace(
            one,
            thickness=values[f"{at}.thickness"],
            density=values[f"{at}.density"],
            c33D=own.c33D,
            h33=own.h33,
            eps33S=own.eps33S,
            c_law=law,
            eps_law=law,
        )

    return replace(plate, layers=tuple(fitted(one) if isinstance(one, Piezo) else one for one in plate.layers))


def thinner(found: FittedDisk, points: int = COARSE) -> FittedDisk:
    """Return the fit with a few hundred points of each sweep, for trials."""
    before = found.descent.objective
    few = before.with_recordings([thinned(one, points) for one in before.recordings])
    return replace(found, descent=replace(found.descent, objective=few))


def with_effects(found: FittedDisk, outside: Outside) -> FittedDisk:
    """Return the disk fitted together with effects at its terminals or in its laws, starting from one without."""
    before, bare = found.descent.objective, found.model
    values, _ = before.coordinates.forward(found.descent.x)
    coordinates = outside.extended(Coordinates(before.coordinates.blocks, values, before.coordinates.free))
    device = outside.around(bare, outside.start)
    recordings = [replace(one, model=device, misfit=0.0, correlation=1.0) for one in before.recordings]
    x, evaluations, last, settled = coordinates.x, found.descent.evaluations, math.inf, False
    for _ in range(_TOGETHER):
        recordings = [at_level(each, coordinates, x) for each in recordings]
        step = descend(Objective(recordings, coordinates, before.all_priors), x, _TOLERANCE, _MOST)
        evaluations, x = evaluations + step.evaluations, step.x
        left = left_of(recordings, coordinates, x)
        settled = left > (1 - _STILL) * last
        last = left
        if settled:
            break
    descent = judged(recordings, coordinates, before.all_priors, x, settled, evaluations)
    return replace(found, descent=descent)
