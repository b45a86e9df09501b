"""A disk of finite diameter with a dot of solder on a face: where a search can begin.

A dot has a satellite at every resonance of the disk. Constants are therefore found first as if the points that differ
most did not count, then dots of many sizes are tried there, and the most promising are followed together with the
constants: with broadened resonances, whose valleys are wide, then with those of the recording.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from ....models.effects import EffectParameter, find_effect
from ...disk.two_d.broadened import LOSS, broadened, less_lossy
from ...disk.two_d.disk_fit import FittedDisk, robustly_fitted
from ...disk.two_d.disk_under_diagnosis import plate_of, with_effects
from ...disk.two_d.robust_search import POINTS, followed_robustly, loss_of
from ...disk.two_d.valley_search import thinned
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Recording
from ...interface import UNCOMPUTABLE, FitTask
from ..hypotheses.problem import Candidate
from .disk_with_wires import DiskBeside, outside_of

_DOT = "local-mass"
_DEVIATIONS = tuple(np.linspace(-2, 1, 7).tolist())
"""Part of the face that dots of the scan cover, in standard deviations of its logarithm."""
_EVERY, _SCALE = 2, 0.1
"""Every which of the masses that the effect scans is tried; scale of the loss by which dots are compared."""
_WIDE = ((0.3, 8, 6), (0.1, 3, 12), (0.03, 1, 12), (0.01, 1, 12))
_NARROW = ((0.03, 1, 9), (0.01, 1, 12), (0.003, 1, 12))
"""Budget: successive scales of the loss, the number of dots followed, and the steps from each, with broadened
resonances and with those of the recording."""
_LEAST = 2e-3
"""Loss tangent that a dot keeps at least when that of the broadening is taken away."""


@dataclass(frozen=True, eq=False)
class _Dotted:
    """A disk with a dot on its front, where no descent has ended yet."""

    found: FittedDisk
    dot: Candidate

    def objective(self, values: Mapping[str, float], *, wide: bool) -> Objective:
        """Return the objective with the dot's parameters free from `values`, a quick model, and few points."""
        outside, own = outside_of(self.found, [self.dot], values), self.found.descent.objective
        constants, _ = own.coordinates.forward(self.found.descent.x)
        device = outside.around(replace(self.found.model, rough=True), values)
        recordings = [replace(one, model=device) for one in self.seen(wide=wide)]
        coordinates = outside.extended(Coordinates(own.coordinates.blocks, constants, own.coordinates.free))
        return Objective(recordings, coordinates, (*own.priors, *own.posteriors))

    def seen(self, *, wide: bool) -> list[Recording]:
        """Return the recordings, of few points; `wide`: with broadened resonances."""
        own = self.found.descent.objective.recordings
        return [thinned(one, POINTS) for one in (map(broadened, own) if wide else own)]

    def at(self, values: Mapping[str, float]) -> FittedDisk:
        """Return the disk without the dot, with these constants."""
        descent = self.found.descent
        return replace(self.found, descent=replace(descent, x=descent.objective.coordinates.inverse(values)))


def with_dot(task: FitTask, progress: Callable[[str], None], jobs: int) -> DiskBeside | None:
    """Return the disk fitted with a dot on its front; None if there is no such fit."""
    progress("fitting the disk in two dimensions as if its sharpest lines did not count")
    try:
        found = robustly_fitted(task, progress, jobs)
        effect, where = find_effect(_DOT), found.model.open_faces[0]
        knobs = effect.parameters_in(found.model, plate_of(found), where)
        one = _Dotted(found, Candidate(effect, where, (found.disk.step,), knobs))
        return DiskBeside(found, _followed(one, progress, jobs), (one.dot,))
    except UNCOMPUTABLE:
        return None


def _followed(one: _Dotted, progress: Callable[[str], None], jobs: int) -> FittedDisk:
    """Return the disk fitted with the dot that explains most. Raises one of UNCOMPUTABLE if none can be fitted."""
    progress("trying dots on a face of the disk")
    sizes, seen = _sizes(one.dot), one.seen(wide=True)
    losses = on_cores([partial(_loss, one, seen, values) for values in sizes], jobs)
    best = [sizes[k] for _, k in sorted(zip(losses, range(len(sizes)), strict=True))]
    progress("following dots on a face of the disk")
    (values, *_) = _along(one.objective(best[0], wide=True), _WIDE, best, jobs)
    values = less_lossy(values, one.found.disk.layer.name)
    loss = one.dot.prefix + "loss"
    values[loss] = max(values[loss] - LOSS, _LEAST)
    near = replace(one, found=one.at(values))
    (values, *_) = _along(near.objective(values, wide=False), _NARROW, [values], jobs)
    found = one.at(values)
    return with_effects(found, outside_of(found, [one.dot], {name: values[name] for name in one.dot.parameters}))


def _along(
    objective: Objective,
    stages: Sequence[tuple[float, int, int]],
    starts: Sequence[Mapping[str, float]],
    jobs: int,
) -> list[dict[str, float]]:
    """Return the values where descents lead to, those of least loss first; starts may say nothing of the constants."""
    coordinates = objective.coordinates
    constants, _ = coordinates.forward(coordinates.x)
    places = [coordinates.inverse({**constants, **values}) for values in starts]
    found = followed_robustly([(objective, *stage) for stage in stages], places, jobs)
    return [coordinates.forward(bottom.x)[0] for bottom in found]


def _sizes(dot: Candidate) -> list[dict[str, float]]:
    """Return dots that cover usual parts of the face, each with the masses and impedances that the effect scans."""
    usual, spread = dot.effect_parameters[0].expected
    parts = tuple(usual * float(np.exp(z * spread)) for z in _DEVIATIONS)
    others = (_scanned(knob) for knob in dot.effect_parameters[1:])
    return [dict(zip(dot.parameters, values, strict=True)) for values in product(parts, *others)]


def _scanned(knob: EffectParameter) -> tuple[float, ...]:
    return knob.scan[::_EVERY] or (knob.null,)


def _loss(one: _Dotted, seen: list[Recording], values: Mapping[str, float]) -> float:
    """Return the loss with a dot of this size; infinite if it cannot be computed."""
    found = one.found
    constants, _ = found.descent.objective.coordinates.forward(found.descent.x)
    own = {name: value for name, value in constants.items() if name in found.model.parameters()}
    device = outside_of(found, [one.dot], values).around(replace(found.model, rough=True).replace(own), values)
    try:
        return sum(loss_of(recording, device.impedance(recording.sweep.frequency), _SCALE) for recording in seen)
    except UNCOMPUTABLE:
        return float(np.inf)
