"""A disk of finite diameter with a dot of solder on a face: where a search can begin.

A dot has a satellite at every resonance of the disk and changes some points beyond recognition. With more damping it
changes little: where overtones merge, constants are found as if there were no dot. With half of that dots of many sizes
are tried, each with the constants that linear derivatives give beside it, and the most promising are followed together
with all constants while the damping is halved again and again: a line then moves by less than its own width.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.face_loads import Dot
from ....models.effects import EffectParameter, find_effect
from ....models.stack import CONSTANT, LossLaw
from ...disk.two_d.broadened import Broadening
from ...disk.two_d.disk_fit import FittedDisk, smoothly_fitted
from ...disk.two_d.disk_under_diagnosis import plate_of, with_effects
from ...disk.two_d.outside import Outside
from ...disk.two_d.valley_search import FEW, Bottom, bottom_near, distinct
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.coordinates import Block, Coordinates, positive
from ...engine.recording import Posterior
from ...interface import UNCOMPUTABLE, FitTask
from ..hypotheses.problem import Candidate
from .disk_with_wires import DiskBeside, outside_of

_DOT = "local-mass"
_DEVIATIONS = tuple(np.linspace(-2, 1, 7).tolist())
"""Part of the face that dots of the scan cover, in standard deviations of its logarithm."""
_EVERY = 3
"""Every which of the masses that the effect scans is tried: broad satellites need no more."""
_TRIED, _CLOSE = 0.1, 0.005
"""Loss tangent that is added where dots are tried, and the misfit of ln Z that counts as noise there."""
_STRIDE = 0.15
"""Largest change of a coordinate, most of which are logarithms, that linear derivatives may say."""
_STAGES = ((0.1, 0.01, 4, 8), (0.1, 0.003, 3, 9), (0.05, 0.003, 1, 12), (0.025, 0.003, 1, 12), (0.0125, 0.003, 1, 12))
"""Budget: added loss tangents down to that of a hard ceramic, the misfit that counts as noise, from the accuracy of the
quick model on, the number of dots followed, and the steps from each."""
_LAST = (0.01, 20)
"""Misfit that counts as noise, and steps, without added loss."""


@dataclass(frozen=True, eq=False)
class _Dotted:
    """A disk with a dot on its front, where no descent has ended yet."""

    found: FittedDisk
    dot: Candidate
    broad: tuple[Broadening, ...]

    def beside(self, damping: float, law: LossLaw, values: Mapping[str, float]) -> Objective:
        """Return the objective of the disk's constants beside a dot of this size; without any if `values` is empty."""
        own, outside = self.found.descent.objective, Outside()
        if values:
            outside = outside_of(self.found, [self.dot], values)
        return self._objective(damping, outside, own.coordinates, law, _CLOSE)

    def together(self, damping: float, law: LossLaw, misfit: float) -> Objective:
        """Return the objective of constants and dot, which are about as usual."""
        start = dict(zip(self.dot.parameters, _usual(self.dot), strict=True))
        first, *others = self.dot.parameters
        median, spread = self.dot.effect_parameters[0].expected
        blocks = (positive(first), *self.dot.blocks(start)[1:])
        pairs = zip(blocks[1:], self.dot.effect_parameters[1:], strict=True)
        middle, wide = np.array([_prior(block, knob) for block, knob in pairs]).T
        priors = (
            Posterior((first,), np.array([np.log(median)]), np.array([[1 / spread]])),
            Posterior(tuple(others), middle, np.diag(1 / wide)),
        )
        outside = replace(outside_of(self.found, [self.dot], start), blocks=blocks, priors=priors)
        before = self.found.descent
        constants, _ = before.objective.coordinates.forward(before.x)
        own = Coordinates(before.objective.coordinates.blocks, constants, before.objective.coordinates.free)
        return self._objective(damping, outside, outside.extended(own), law, misfit)

    def _objective(
        self, damping: float, outside: Outside, coordinates: Coordinates, law: LossLaw, misfit: float
    ) -> Objective:
        own = self.found.descent.objective
        device = outside.around(replace(self.found.model, law=law, rough=True, damping=damping), outside.start)
        seen = (replace(one.by(damping, FEW), model=device, misfit=misfit) for one in self.broad)
        return Objective(list(seen), coordinates, (*own.all_priors, *outside.priors))


def with_dot(task: FitTask, progress: Callable[[str], None], jobs: int) -> DiskBeside | None:
    """Return the disk fitted with a dot on its front; None if there is no such fit."""
    progress("fitting the disk in two dimensions as if its overtones merged")
    try:
        found = smoothly_fitted(task, progress, jobs)
        effect, where = find_effect(_DOT), found.model.faces_for(Dot)[0]
        knobs = effect.parameters_in(found.model, plate_of(found), where)
        broad = tuple(map(Broadening.of, found.descent.objective.recordings))
        one = _Dotted(found, Candidate(effect, where, (found.disk.step,), knobs), broad)
        law, values = _followed(one, progress, jobs)
        found = _at(found, law, values)
        dot = outside_of(found, [one.dot], {name: values[name] for name in one.dot.parameters})
        return DiskBeside(found, with_effects(found, dot), (one.dot,))
    except UNCOMPUTABLE:
        return None


def _followed(one: _Dotted, progress: Callable[[str], None], jobs: int) -> tuple[LossLaw, dict[str, float]]:
    """Return law and values with the dot that explains most. Raises one of UNCOMPUTABLE if none can be fitted."""
    progress("trying dots on a face of the disk")
    law = one.found.model.law
    places = _tried(one, law, jobs)
    progress("following dots on a face of the disk")
    for damping, misfit, count, most in _STAGES:
        objective = one.together(damping, law, misfit)
        places = [
            end.x for end in distinct(on_cores([partial(_end, objective, x, most) for x in places[:count]], jobs))
        ]
    misfit, most = _LAST
    laws = (law, CONSTANT)
    last = [one.together(0.0, each, misfit) for each in laws]
    ends = on_cores([partial(_end, objective, places[0], most) for objective in last], jobs)
    best = min(range(len(laws)), key=lambda k: ends[k].cost)
    return laws[best], last[best].coordinates.forward(ends[best].x)[0]


def _at(found: FittedDisk, law: LossLaw, values: Mapping[str, float]) -> FittedDisk:
    """Return the disk with this law and these constants."""
    own, model = found.descent.objective, replace(found.model, law=law)
    objective = own.with_recordings([replace(one, model=model) for one in own.recordings])
    descent = replace(found.descent, objective=objective, x=own.coordinates.inverse(values))
    return replace(found, model=model, descent=descent)


def _tried(one: _Dotted, law: LossLaw, jobs: int) -> list[Reals]:
    """Return constants with dots, those first that leave least."""
    bare = one.beside(_TRIED, law, {})
    slopes, coordinates = bare.jacobian(one.found.descent.x), one.together(_TRIED, law, 0.0).coordinates
    sizes = _sizes(one.dot)
    tried = on_cores([partial(_left, one, law, slopes, values) for values in sizes], jobs)
    made: list[Reals] = []
    for k in sorted(range(len(sizes)), key=lambda k: tried[k][0]):
        constants, _ = bare.coordinates.forward(tried[k][1])
        made.append(coordinates.inverse({**constants, **sizes[k]}))
    return made


def _left(one: _Dotted, law: LossLaw, slopes: Reals, values: Mapping[str, float]) -> tuple[float, Reals]:
    """Return what is left beside a dot, and the disk's coordinates there; infinity if it cannot be computed."""
    x = one.found.descent.x
    try:
        residual = one.beside(_TRIED, law, values).residual(x)
    except UNCOMPUTABLE:
        return float(np.inf), x
    step = np.linalg.lstsq(slopes, -residual)[0]
    return float(np.sum((residual + slopes @ step) ** 2)), x + step * min(1.0, _STRIDE / float(np.abs(step).max()))


def _end(objective: Objective, x: Reals, most: int) -> Bottom:
    """Return where a descent ends; where it began, at infinite cost, if it comes to where there is no such device."""
    try:
        return bottom_near(objective, x, most)
    except UNCOMPUTABLE:
        return Bottom(x, float(np.inf), 0)


def _prior(block: Block, knob: EffectParameter) -> tuple[float, float]:
    """Return mean and deviation of the coordinate of a parameter: what the effect scans is four deviations wide.

    Of a parameter that is not scanned, an eighth of what is possible: solder and its like.
    """
    scan = _scanned(knob)
    low, middle, high = block.inverse(np.array([min(scan), np.median(scan), max(scan)])).tolist()
    return middle, (high - low) / 4 or 0.5


def _usual(dot: Candidate) -> list[float]:
    """Return the usual value of each parameter."""
    first, *others = dot.effect_parameters
    return [first.expected[0], *(float(np.median(_scanned(knob))) for knob in others)]


def _sizes(dot: Candidate) -> list[dict[str, float]]:
    """Return dots that cover usual parts of the face, each with the masses and impedances that the effect scans."""
    usual, spread = dot.effect_parameters[0].expected
    parts = tuple(usual * float(np.exp(z * spread)) for z in _DEVIATIONS)
    others = (_scanned(knob) for knob in dot.effect_parameters[1:])
    return [dict(zip(dot.parameters, values, strict=True)) for values in product(parts, *others)]


def _scanned(knob: EffectParameter) -> tuple[float, ...]:
    return knob.scan[::_EVERY] or (knob.null,)
