"""Joint least squares over the gluing steps of a build: starts, descents, the deepest place found."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..models.arrays import Reals
from ..models.build import Build, LayerSpec
from ..models.sweep import Sweep
from .assembly import coordinates_of, layers_of, nominal_parameters, priors_of, stack_of
from .descent import Descent, settle, softened
from .interface import FitError, FitTask, Noise
from .noise import noise_of
from .objective import Objective, Recording
from .start import disk_starts, distinct, spread_starts

_DESCENTS = 3


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


def check_task(task: FitTask) -> tuple[Build, dict[str, tuple[Sweep, ...]]]:
    """Return the build and its sweeps in gluing order. Raises FitError where task, build and sweeps do not fit."""
    if task.build is None:
        raise FitError("a stack can only be fitted with a build file; only `bvd` needs none")
    known = [step.name for step in task.build.steps]
    for step in task.sweeps:
        if step not in known:
            raise FitError(f"step {step!r} is not in build {task.build.name!r}, which has {', '.join(known)}")
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
    recordings: tuple[Recording, ...] = ()
    values = nominal_parameters(build)
    begun = dict(values)
    evaluations = 0
    descent: Descent | None = None
    for step, of_step in sweeps.items():
        progress(f"fitting {step}")
        stack = stack_of(build, build.step(step))
        here = [Recording(step, sweep, stack, sigma) for sweep, sigma in zip(of_step, found[step][1], strict=True)]
        new = _new_layers(build, [recording.step for recording in recordings], step)
        starts = _start_values(new, here, values)
        descent, tried = _best_descent(build, recordings, here, task.free, starts)
        recordings = descent.objective.recordings
        evaluations += tried
        first, _ = descent.objective.coordinates.forward(descent.start)
        begun |= {name: value for name, value in first.items() if name.split(".")[0] in {n.name for n in new}}
        values |= descent.objective.coordinates.forward(descent.x)[0]
    if descent is None:
        raise FitError(f"no recording of any step of build {build.name!r} was given")
    return Solution(build, noises, descent, begun, evaluations, time.perf_counter() - began)


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
        guesses = disk_starts(widest, values[f"{disk}.thickness"], values[f"{disk}.density"], values["area"])
        return [values | guess.parameters(disk) for guess in distinct(guesses, _DESCENTS)]
    uncertain = {
        f"{layer.name}.{name}": layer.values[name].u
        for layer in new
        if layer.kind == "elastic"
        for name in (("z", "c") if layer.values["c"].u > 0 else ("thickness",))
        if layer.values[name].u > 0
    }
    return [values | spread for spread in spread_starts(values, uncertain, list(uncertain))]


def _best_descent(
    build: Build,
    earlier: Sequence[Recording],
    new: Sequence[Recording],
    free: tuple[str, ...] | None,
    starts: Sequence[dict[str, float]],
) -> tuple[Descent, int]:
    """Settle from the most promising starts until one describes the new recordings.

    Returns the deepest place found and the number of evaluations.
    """
    steps = [recording.step for recording in (*earlier, *new)]
    priors = priors_of(build, steps)
    ranked = sorted(
        (Objective(new, coordinates_of(build, steps, start, free), priors) for start in starts), key=_rms_at_start
    )
    tried: list[Descent] = []
    for objective in ranked[:_DESCENTS]:
        coordinates, misfits = objective.coordinates, objective.log_ratios(objective.coordinates.x)
        cautious = (replace(softened(r, ratio), correlation=1.0) for r, ratio in zip(new, misfits, strict=True))
        tried.append(settle((*earlier, *cautious), coordinates, priors, coordinates.x))
        if all(recording.misfit == 0 for recording in tried[-1].objective.recordings[len(earlier) :]):
            break
    best = min(tried, key=lambda descent: _rms(descent.objective, descent.x))
    return best, len(starts) + sum(descent.evaluations for descent in tried)


def _rms(objective: Objective, x: Reals) -> float:
    return float(np.sqrt(np.mean(np.concatenate([np.abs(ratio) ** 2 for ratio in objective.log_ratios(x)]))))


def _rms_at_start(objective: Objective) -> float:
    return _rms(objective, objective.coordinates.x)
