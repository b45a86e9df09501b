"""Least squares over the gluing steps of a build, jointly or one by one: starts, descents, the deepest place found."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from ...models.base.arrays import Reals
from ...models.build import Build, LayerSpec
from ...models.sweep import Sweep
from ..interface import FitError, FitTask, Noise, TaskError
from .covariance import posterior
from .descent import Descent, approach, chi2_per_point, settle, thinned, with_model_discrepancy
from .noise import noise_of
from .objective import Objective
from .parameters.assembly import coordinates_of, layers_of, nominal_parameters, priors_of, recordings_of
from .parameters.coordinates import Coordinates
from .recording import Posterior, Prior, Recording, rms
from .refine import refined
from .start import disk_starts, distinct, spread_starts

_DESCENTS, _MOST_DESCENTS = 3, 12
_CLOSE = 10.0
# chi2 per point up to which a recording needs no caution on the last bit of the way.
_NEAR, _LOST = 0.01, 0.05
# RMS of ln Z: so near, all points at once lead to the minimum; so far, no physics left out of a model ends, but a wrong
# minimum does: the search goes on then.


@dataclass(frozen=True, eq=False)
class Solution:
    """The deepest minimum found over all steps."""

    build: Build
    noises: Mapping[str, Noise]
    """By step."""
    descent: Descent
    begun: Mapping[str, float]
    """Model parameters that the fit of each layer began with."""
    evaluations: int
    seconds: float
    recordings: tuple[Recording, ...] = ()
    """Those of all steps, where the last descent is over the last step alone."""
    carried: tuple[Descent, ...] = ()
    """Descents of earlier steps whose constants were frozen then."""

    @property
    def judged(self) -> Objective:
        """The objective over all recordings, whatever the last descent was over."""
        objective = self.descent.objective
        return Objective(self.recordings, objective.coordinates, objective.priors) if self.recordings else objective


def check_task(task: FitTask) -> tuple[Build, dict[str, tuple[Sweep, ...]]]:
    """Return the build and its sweeps in gluing order. Raises FitError where task, build and sweeps do not fit."""
    if task.build is None:
        raise TaskError("a stack can only be fitted with a build file; only `bvd` needs none")
    known = [step.name for step in task.build.steps]
    for step in task.sweeps:
        if step not in known:
            raise TaskError(f"step {step!r} is not in build {task.build.name!r}, which has {', '.join(known)}")
    there = {step: task.sweeps[step] for step in known if task.sweeps.get(step)}
    if not there:
        raise FitError(f"no recording of any step of build {task.build.name!r} was given")
    coordinates_of(task.build, there, nominal_parameters(task.build), task.free)
    return task.build, there


def solve(task: FitTask, progress: Callable[[str], None]) -> Solution:
    """Fit all steps jointly, each new step starting from where the earlier ones ended. Raises FitError."""
    began = time.perf_counter()
    build, sweeps = check_task(task)
    found = {step: noise_of(of_step) for step, of_step in sweeps.items()}
    noises = {step: noise for step, (noise, _) in found.items()}
    way = _StepwiseFit(build, task)
    weighting: Literal["log", "thesis"] = "thesis" if task.options.objective == "thesis" else "log"
    for step, of_step in sweeps.items():
        progress(f"fitting {step}")
        here = recordings_of(build, step, of_step, found[step][1])
        way.go(step, [replace(recording, weighting=weighting) for recording in here])
    if way.descent is None:
        raise FitError(f"no recording of any step of build {build.name!r} was given")
    whole = () if task.options.procedure == "joint" else tuple(way.recordings)
    seconds = time.perf_counter() - began
    return Solution(build, noises, way.descent, way.begun, way.evaluations, seconds, whole, tuple(way.frozen))


class _StepwiseFit:
    """The way through the gluing steps: what has been found so far, and what it says to the next step."""

    def __init__(self, build: Build, task: FitTask) -> None:
        self.build, self.free, self.procedure = build, task.free, task.options.procedure
        self.values = nominal_parameters(build)
        self.begun = dict(self.values)
        self.recordings: list[Recording] = []
        self.frozen: list[Descent] = []
        self.evaluations = 0
        self.descent: Descent | None = None

    def go(self, step: str, here: Sequence[Recording]) -> None:
        """Fit one more step. Raises FitError."""
        before = [recording.step for recording in self.recordings]
        new = _new_layers(self.build, before, step)
        starts = [self._coordinates((*before, step), start) for start in _start_values(new, here, self.values)]
        earlier = self.recordings if self.procedure == "joint" else []
        self.descent, tried = _best_descent(earlier, here, starts, self._priors(before, step))
        self.evaluations += len(starts) + tried
        self.recordings = [*self.recordings[: len(before) - len(earlier)], *self.descent.objective.recordings]
        first, _ = self.descent.objective.coordinates.forward(self.descent.start)
        self.begun |= {name: value for name, value in first.items() if name.split(".")[0] in {n.name for n in new}}
        self.values |= self.descent.objective.coordinates.forward(self.descent.x)[0]

    def _coordinates(self, steps: Sequence[str], start: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of the next fit; frozen are those that moved in an earlier one."""
        whole = coordinates_of(self.build, steps, start, self._free_in(steps)).held_at(self.values)
        if self.procedure != "frozen" or self.descent is None:
            return whole
        return whole.without(*(name for descent in self._passed for name in descent.objective.coordinates.free))

    def _free_in(self, steps: Sequence[str]) -> tuple[str, ...] | None:
        """Return those of the constants to be freed that these steps have; layers to come have theirs later."""
        if self.free is None:
            return None
        there = {layer.name for layer in layers_of(self.build, steps)}
        later = {layer.name for layer in self.build.layers} - there
        ground = {name: name.partition("@")[2] for name in self.free}
        return tuple(n for n in self.free if n.split(".")[0] not in later and (not ground[n] or ground[n] in steps))

    @property
    def _passed(self) -> list[Descent]:
        return [*self.frozen, self.descent] if self.descent is not None else self.frozen

    def _priors(self, before: Sequence[str], step: str) -> list[Prior | Posterior]:
        """Return what is known before this step; what an earlier fit has taken in already is not told twice."""
        known: list[Prior | Posterior] = list(priors_of(self.build, (*before, step)))
        if self.procedure == "joint" or self.descent is None:
            return known
        told = {prior.parameter for prior in priors_of(self.build, before)}
        fresh = [prior for prior in known if isinstance(prior, Prior) and prior.parameter not in told]
        if self.procedure == "frozen":
            self.frozen.append(self.descent)
            return list(fresh)
        return [*fresh, posterior(self.descent)]


def _new_layers(build: Build, earlier: Sequence[str], step: str) -> tuple[LayerSpec, ...]:
    before = {layer.name for layer in layers_of(build, earlier)}
    return tuple(layer for layer in layers_of(build, [step]) if layer.name not in before)


def _start_values(
    new: Sequence[LayerSpec], recordings: Sequence[Recording], values: dict[str, float]
) -> list[dict[str, float]]:
    """Return starting values for a step that adds the layers `new`.

    A bare piezo disk is guessed from its own resonances. Glued layers start from their nominal values and from one
    and a half uncertainties around them; the rest starts from where the earlier steps ended.
    """
    if len(new) == 1 and new[0].kind == "piezo":
        disk = new[0].name
        widest = max((r.sweep for r in recordings), key=lambda sweep: sweep.frequency[-1] / sweep.frequency[0])
        plate = (values[f"{disk}.thickness"], values[f"{disk}.density"], values["area"])
        best, *others = distinct(disk_starts(widest, *plate), _DESCENTS)
        return [values | guess.parameters(disk) for guess in (refined(best, widest, *plate), *others)]
    uncertain = {
        f"{layer.name}.{name}": layer.values[name].u
        for layer in new
        if layer.kind == "elastic"
        for name in (("z", "c") if layer.values["c"].u > 0 else ("thickness",))
        if layer.values[name].u > 0 and layer.values[name].same_as is None
    }
    return [values | spread for spread in spread_starts(values, uncertain, list(uncertain))]


def _best_descent(
    earlier: Sequence[Recording],
    new: Sequence[Recording],
    starts: Sequence[Coordinates],
    priors: Sequence[Prior | Posterior],
) -> tuple[Descent, int]:
    """Settle from the most promising starts until one describes the new recordings.

    Returns the deepest place found and the number of evaluations.
    """
    few = [thinned(recording) for recording in new]
    ranked = sorted((Objective(few, start, priors) for start in starts), key=_rms_at_start)
    tried: list[Descent] = []
    for k, begun in enumerate(ranked[:_MOST_DESCENTS]):
        if k >= _DESCENTS and min(_rms(descent.objective, descent.x) for descent in tried) < _LOST:
            break
        start = begun.coordinates
        tried.append(_by_few_points(earlier, new, begun, priors))
        if _rms(tried[-1].objective, tried[-1].x) > _LOST:
            tried.append(settle((*earlier, *_cautious(new, start)), start, priors, start.x))
        if all(recording.misfit == 0 for recording in tried[-1].objective.recordings[len(earlier) :]):
            break
    best = min(tried, key=lambda descent: _rms(descent.objective, descent.x))
    return best, sum(descent.evaluations for descent in tried)


def _by_few_points(
    earlier: Sequence[Recording], new: Sequence[Recording], begun: Objective, priors: Sequence[Prior | Posterior]
) -> Descent:
    """Let a few points of each recording show the way, where the start is not near, and settle all from there.

    `begun` is the objective of those few points of the new recordings.
    """
    start, x, evaluations = begun.coordinates, begun.coordinates.x, 0
    if _rms_at_start(begun) > _NEAR:
        few = (*map(thinned, earlier), *_cautious(begun.recordings, start))
        near = approach(few, start, priors, x)
        # There and back: a load that ran off to nothing on the way begins again from next to nothing.
        x, evaluations = start.inverse(start.forward(near.x)[0]), near.evaluations
    whole = Objective((*earlier, *new), start, priors)
    judged = [
        recording if chi2_per_point(recording, ratio) < _CLOSE else with_model_discrepancy(recording, ratio)
        for recording, ratio in zip(whole.recordings, whole.log_ratios(x), strict=True)
    ]
    there = settle(judged, start, priors, x)
    return replace(there, start=start.x, evaluations=evaluations + there.evaluations)


def _cautious(recordings: Sequence[Recording], start: Coordinates) -> list[Recording]:
    """Return the recordings softened by all that a start misses of them, as if that were noise."""
    misfits = Objective(recordings, start, ()).log_ratios(start.x)
    return [
        replace(with_model_discrepancy(r, ratio), correlation=1.0) for r, ratio in zip(recordings, misfits, strict=True)
    ]


def _rms(objective: Objective, x: Reals) -> float:
    return rms(*objective.log_ratios(x))


def _rms_at_start(objective: Objective) -> float:
    return _rms(objective, objective.coordinates.x)
