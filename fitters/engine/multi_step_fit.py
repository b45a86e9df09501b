"""Least squares over the gluing steps of a build, jointly or one by one: starts, descents, deepest minimum."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...models.base.arrays import Reals
from ...models.build import Build, LayerSpec
from ...models.effects.base.effect import TERMINALS
from ...models.sweep import Sweep
from ..interface import UNCOMPUTABLE, FitError, FitTask, Noise, TaskError
from .covariance import posterior
from .descent import Descent, approach, chi2_per_point, settle, thinned, with_model_discrepancy
from .distinct_recordings import refuse_given_twice
from .effect_valleys import deepest_valley
from .noise import noise_of
from .objective import Objective
from .parameters.assembly import (
    ELASTIC_CONSTANTS,
    PIEZO_CONSTANTS,
    ceramic_leader,
    coordinates_of,
    effects_of,
    layers_of,
    nominal_parameters,
    priors_of,
    recordings_of,
    require_constants,
)
from .parameters.coordinates import Coordinates
from .physical_range import refuse_impossible
from .recording import Posterior, Prior, Recording, rms
from .refine import refined
from .start import disk_starts, distinct, spread_starts
from .swapped_steps import WRONG, refuse_swapped

_DESCENTS, _MOST_DESCENTS = 3, 12
_CLOSE = 10.0
# chi2 per point below which the final descent needs no reweighting.
_NEAR, _LOST = 0.01, 0.05
# Rms of ln Z: below the first, all points together lead to the minimum; above the second, the search goes on, because
# missing physics never leaves that much but a wrong minimum does.
_OTHER_Z, _OTHER_C = (0.4, 2.0, 4.0), (0.7, 1.0, 1.4)
# Factors of impedance and speed that lead from one material to another: loaded epoxies lie between 1 and 10 MRayl.


@dataclass(frozen=True, eq=False)
class Solution:
    """The deepest minimum found over all steps."""

    build: Build
    noises: Mapping[str, Noise]
    """Noise by step."""
    descent: Descent
    begun: Mapping[str, float]
    """Start values of the model parameters in the fit of each layer."""
    evaluations: int
    seconds: float
    recordings: tuple[Recording, ...] = ()
    """Recordings of all steps, if the last descent covers only the last step."""
    carried: tuple[Descent, ...] = ()
    """Descents of earlier steps whose constants were then frozen."""

    @property
    def judged(self) -> Objective:
        """The objective over all recordings, whatever the last descent covered."""
        objective = self.descent.objective
        return Objective(self.recordings, objective.coordinates, objective.priors) if self.recordings else objective


def check_task(task: FitTask) -> tuple[Build, dict[str, tuple[Sweep, ...]]]:
    """Return the build and its sweeps in gluing order.

    Raises FitError if task, build and sweeps do not match, TaskError also if one recording is given twice.
    """
    if task.build is None:
        raise TaskError(
            "a stack can only be fitted with a build file: give --build (`pzctl new` writes one), or fit an unknown "
            "device by --fitter bvd, which needs none"
        )
    known = [step.name for step in task.build.steps]
    for step in task.sweeps:
        if step not in known:
            raise TaskError(f"step {step!r} is not in build {task.build.name!r}, which has {', '.join(known)}")
    there = {step: task.sweeps[step] for step in known if task.sweeps.get(step)}
    if not there:
        raise FitError(f"no recording of any step of build {task.build.name!r} was given")
    refuse_given_twice(there)
    require_constants(task.build, known if task.build.effects else there)
    refuse_impossible(task.build, layers_of(task.build, there))
    coordinates_of(task.build, there, nominal_parameters(task.build), task.free)
    return task.build, there


def refuse_effects(build: Build, fitter: str, *, outside: bool = False) -> None:
    """Raise TaskError if the build states effects that the fitter's model lacks: any, or those inside of a device.

    `outside`: whether it has those outside.
    """
    refused = [one for one in build.effects if not (outside and one.where == TERMINALS)]
    if refused:
        names = ", ".join(f"{one.effect} at {one.where}" for one in refused)
        raise TaskError(f"{fitter} cannot model the effects of build {build.name!r} ({names}); fit it with mason")


def solve(task: FitTask, progress: Callable[[str], None]) -> Solution:
    """Fit all steps jointly; each new step starts from the result of the earlier ones. Raises FitError."""
    began = time.perf_counter()
    build, sweeps = check_task(task)
    noise_by_step = {step: noise_of(of_step) for step, of_step in sweeps.items()}
    noises = {step: noise for step, (noise, _) in noise_by_step.items()}
    stepwise = _StepwiseFit(build, task)
    weighting: Literal["log", "thesis"] = "thesis" if task.options.objective == "thesis" else "log"
    for step, of_step in sweeps.items():
        progress(f"fitting {step}")
        here = recordings_of(build, step, of_step, noise_by_step[step][1])
        ended = stepwise.tried(step, [replace(recording, weighting=weighting) for recording in here])
        if ended is not None or stepwise.left > WRONG:
            refuse_swapped(sweeps, step, np.inf if ended else stepwise.left, lambda other: _left_by(task, other))
        if ended is not None:
            raise FitError(
                f"the fit of step {step!r} ended where there is no such device ({ended}); check that its recording is "
                "of this step, and the layers of the build"
            ) from ended
    if stepwise.descent is None:
        raise FitError(f"no recording of any step of build {build.name!r} was given")
    whole = () if task.options.procedure == "joint" else tuple(stepwise.recordings)
    seconds = time.perf_counter() - began
    return Solution(
        build, noises, stepwise.descent, stepwise.begun, stepwise.evaluations, seconds, whole, tuple(stepwise.frozen)
    )


def _left_by(task: FitTask, sweeps: Mapping[str, tuple[Sweep, ...]]) -> float:
    """Return the RMS log error that a fit of other recordings leaves; infinite if it fails."""
    try:
        solution = solve(replace(task, sweeps=sweeps, free=None), lambda _: None)
        return rms(*solution.judged.log_ratios(solution.descent.x))
    except UNCOMPUTABLE:
        return np.inf


class _StepwiseFit:
    """State of a fit that proceeds step by step: the results so far, which are starts and priors of the next step."""

    def __init__(self, build: Build, task: FitTask) -> None:
        self.build, self.free, self.procedure = build, task.free, task.options.procedure
        self.values = nominal_parameters(build)
        self.begun = dict(self.values)
        self.recordings: list[Recording] = []
        self.frozen: list[Descent] = []
        self.evaluations = 0
        self.descent: Descent | None = None

    @property
    def left(self) -> float:
        """RMS log error of the last fit; infinite if there is none."""
        return np.inf if self.descent is None else _rms(self.descent.objective, self.descent.x)

    def tried(self, step: str, here: Sequence[Recording]) -> Exception | None:
        """Fit one more step; return the error if the fit ended where it cannot be computed. Raises FitError."""
        try:
            self.go(step, here)
        except FitError:
            raise
        except UNCOMPUTABLE as error:
            return error
        return None

    def go(self, step: str, here: Sequence[Recording]) -> None:
        """Fit one more step. Raises FitError."""
        before = [recording.step for recording in self.recordings]
        new = _new_layers(self.build, before, step)
        fitted = layers_of(self.build, before)
        starts = [self._coordinates((*before, step), start) for start in _start_values(new, fitted, here, self.values)]
        earlier = self.recordings if self.procedure == "joint" else []
        priors = self._priors(before, step)
        self.descent, tried = _best_descent(earlier, here, starts, priors)
        self.evaluations += len(starts) + tried
        if _rms(self.descent.objective, self.descent.x) > _LOST:
            self._try_other_material(new[-1:], earlier, here, priors)
        self.descent = deepest_valley(self.descent, effects_of(self.build, (*before, step)))
        self.recordings = [*self.recordings[: len(before) - len(earlier)], *self.descent.objective.recordings]
        first, _ = self.descent.objective.coordinates.forward(self.descent.start)
        self.begun |= {name: value for name, value in first.items() if name.split(".")[0] in {n.name for n in new}}
        self.values |= self.descent.objective.coordinates.forward(self.descent.x)[0]

    def _try_other_material(
        self,
        outermost: Sequence[LayerSpec],
        earlier: Sequence[Recording],
        here: Sequence[Recording],
        priors: Sequence[Prior | Posterior],
    ) -> None:
        """Search as if the outermost layer were of any material; keep a minimum that describes the recordings."""
        starts = [start for layer in outermost for start in _other_material(layer, self.values)]
        if not starts:
            return
        steps = dict.fromkeys(recording.step for recording in (*self.recordings, *here))
        doubted = {f"{layer.name}.{name}" for layer in outermost for name in ELASTIC_CONSTANTS}
        others = [prior for prior in priors if not isinstance(prior, Prior) or prior.parameter not in doubted]
        found, tried = _best_descent(earlier, here, [self._coordinates(tuple(steps), s) for s in starts], others)
        objective = found.objective
        elsewhere = settle(objective.recordings, objective.coordinates, priors, found.x)
        self.evaluations += len(starts) + tried + elsewhere.evaluations
        if self.descent is None or _rms(objective, elsewhere.x) < min(
            _LOST, _rms(self.descent.objective, self.descent.x)
        ):
            self.descent = replace(elsewhere, start=found.start)

    def _coordinates(self, steps: Sequence[str], start: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of the next fit; in a frozen procedure, without those of earlier fits."""
        whole = coordinates_of(self.build, steps, start, self._free_in(steps)).held_at(self.values)
        if self.procedure != "frozen" or self.descent is None:
            return whole
        return whole.without(*(name for descent in self._passed for name in descent.objective.coordinates.free))

    def _free_in(self, steps: Sequence[str]) -> tuple[str, ...] | None:
        """Return the constants to free that exist in these steps; later layers get theirs later."""
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
        """Return the priors of this step, without those that an earlier fit has already used."""
        known: list[Prior | Posterior] = list(priors_of(self.build, (*before, step)))
        if self.procedure == "joint" or self.descent is None:
            return known
        used = {prior.parameter for prior in priors_of(self.build, before)}
        fresh = [prior for prior in known if isinstance(prior, Prior) and prior.parameter not in used]
        if self.procedure == "frozen":
            self.frozen.append(self.descent)
            return list(fresh)
        return [*fresh, posterior(self.descent)]


def _new_layers(build: Build, earlier: Sequence[str], step: str) -> tuple[LayerSpec, ...]:
    before = {layer.name for layer in layers_of(build, earlier)}
    return tuple(layer for layer in layers_of(build, [step]) if layer.name not in before)


def _start_values(
    new: Sequence[LayerSpec],
    fitted: Sequence[LayerSpec],
    recordings: Sequence[Recording],
    values: dict[str, float],
) -> list[dict[str, float]]:
    """Return starting values for a step that adds the layers `new` to those that are `fitted`.

    A bare piezo disk starts from its own resonances. Glued layers start from their nominal values and from one and a
    half uncertainties around them, the stiffness of a ceramic among other layers too, unless an earlier layer of the
    same material has been fitted; everything else starts from the result of the earlier steps.
    """
    if len(new) == 1 and new[0].kind == "piezo" and not fitted:
        disk = ceramic_leader(new[0]) or new[0].name
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
    for layer in new:
        own = layer.values["c33D"] if layer.kind == "piezo" and ceramic_leader(layer) is None else None
        if own is None:
            continue
        alike = next((one.name for one in fitted if layer.material and one.material == layer.material), None)
        if alike is not None:
            parts = (f"{name}.{part}" for name in PIEZO_CONSTANTS for part in ("re", "im"))
            values = values | {f"{layer.name}.{part}": values[f"{alike}.{part}"] for part in parts}
        elif own.u > 0 and own.bounds is None:
            uncertain[f"{layer.name}.c33D.re"] = own.u
    return [values | spread for spread in spread_starts(values, uncertain, list(uncertain))]


def _other_material(layer: LayerSpec, values: dict[str, float]) -> list[dict[str, float]]:
    """Return starts for the case that a layer is of another material than the build says; none if it may not be."""
    if layer.kind != "elastic" or layer.values["z"].u == 0 or layer.values["z"].same_as is not None:
        return []
    z, c = f"{layer.name}.z", f"{layer.name}.c"
    speeds = _OTHER_C if layer.values["c"].u > 0 and layer.values["c"].same_as is None else (1.0,)
    return [values | {z: k * values[z], c: j * values[c]} for k in _OTHER_Z for j in speeds]


def _best_descent(
    earlier: Sequence[Recording],
    new: Sequence[Recording],
    starts: Sequence[Coordinates],
    priors: Sequence[Prior | Posterior],
) -> tuple[Descent, int]:
    """Settle from the most promising starts until one describes the new recordings.

    Return the deepest minimum and the number of evaluations.
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
    """Settle all recordings, first on a few points of each if the start is not near.

    `begun` is the objective over a few points of the new recordings.
    """
    start, x, evaluations = begun.coordinates, begun.coordinates.x, 0
    if _rms_at_start(begun) > _NEAR:
        few = (*map(thinned, earlier), *_cautious(begun.recordings, start))
        near = approach(few, start, priors, x)
        # Forward and back: a load that has diverged to zero restarts from a small value.
        x, evaluations = start.inverse(start.forward(near.x)[0]), near.evaluations
    whole = Objective((*earlier, *new), start, priors)
    judged = [
        recording if chi2_per_point(recording, ratio) < _CLOSE else with_model_discrepancy(recording, ratio)
        for recording, ratio in zip(whole.recordings, whole.log_ratios(x), strict=True)
    ]
    there = settle(judged, start, priors, x)
    return replace(there, start=start.x, evaluations=evaluations + there.evaluations)


def _cautious(recordings: Sequence[Recording], start: Coordinates) -> list[Recording]:
    """Return the recordings with all misfit of the start counted as noise."""
    misfits = Objective(recordings, start, ()).log_ratios(start.x)
    return [
        replace(with_model_discrepancy(r, ratio), correlation=1.0) for r, ratio in zip(recordings, misfits, strict=True)
    ]


def _rms(objective: Objective, x: Reals) -> float:
    return rms(*objective.log_ratios(x))


def _rms_at_start(objective: Objective) -> float:
    return _rms(objective, objective.coordinates.x)
