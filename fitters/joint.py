"""Joint least squares over the gluing steps of a build: starts, descents, the deepest place found."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from ..models.arrays import Reals
from ..models.build import Build, LayerSpec
from ..models.sweep import Sweep
from .assembly import coordinates_of, layers_of, nominal_parameters, priors_of, stack_of
from .interface import FitError, FitTask, Noise
from .noise import noise_of
from .objective import Objective, Recording
from .start import disk_starts, distinct, spread_starts

_DESCENTS = 3
_MAX_EVALUATIONS = 200
_ROUGH, _FINE = 1e-4, 1e-10
# Relative tolerances: enough to see which start leads deepest, and enough for the minimum that is reported.


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a local descent began and ended."""

    objective: Objective
    start: Reals
    x: Reals
    cost: float
    converged: bool


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
    """Return the build and its sweeps in gluing order. Raises FitError where they do not belong together."""
    if task.build is None:
        raise FitError("a stack can only be fitted with a build file; only `bvd` needs none")
    known = [step.name for step in task.build.steps]
    for step in task.sweeps:
        if step not in known:
            raise FitError(f"step {step!r} is not in build {task.build.name!r}, which has {', '.join(known)}")
    there = {step: task.sweeps[step] for step in known if task.sweeps.get(step)}
    if not there:
        raise FitError(f"no recording of any step of build {task.build.name!r} was given")
    return task.build, there


def solve(task: FitTask, progress: Callable[[str], None]) -> Solution:
    """Fit all steps jointly, each new step starting from where the earlier ones ended. Raises FitError."""
    began = time.perf_counter()
    build, sweeps = check_task(task)
    found = {step: noise_of(of_step) for step, of_step in sweeps.items()}
    noises = {step: noise for step, (noise, _) in found.items()}
    recordings: list[Recording] = []
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
        recordings += here
        descent, tried = _best_descent(build, recordings, task.free, starts)
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
    build: Build, recordings: Sequence[Recording], free: tuple[str, ...] | None, starts: Sequence[dict[str, float]]
) -> tuple[Descent, int]:
    """Go downhill from the most promising starts; return the deepest place and the number of evaluations.

    The loads join in only at the end: far from the minimum they would be driven to absurd values.
    """
    steps = [recording.step for recording in recordings]
    priors = priors_of(build, steps)
    everything = [coordinates_of(build, steps, start, free) for start in starts]
    objectives = [Objective(recordings, all_.without("back.z", "front.z"), priors) for all_ in everything]
    ranked = sorted(objectives, key=lambda o: float(np.sum(o.residual(o.coordinates.x) ** 2)))
    descents = [descend(objective, objective.coordinates.x, _ROUGH) for objective in ranked[:_DESCENTS]]
    best = min(descents, key=lambda descent: descent.cost)
    whole = Objective(recordings, everything[objectives.index(best.objective)], priors)
    values, _ = best.objective.coordinates.forward(best.x)
    last = descend(whole, whole.coordinates.inverse(values))
    start = whole.coordinates.inverse(best.objective.coordinates.forward(best.start)[0])
    return replace(last, start=start), sum(o.evaluations for o in (*objectives, whole))


def descend(objective: Objective, x: Reals, tolerance: float = _FINE) -> Descent:
    """Go downhill from `x` by trust-region least squares with the exact Jacobian."""
    if x.size == 0:
        return Descent(objective, x, x, float(np.sum(objective.residual(x) ** 2)) / 2, converged=True)
    found = least_squares(
        objective.residual,
        x,
        jac=objective.jacobian,
        x_scale="jac",
        xtol=tolerance,
        ftol=tolerance,
        gtol=tolerance,
        max_nfev=_MAX_EVALUATIONS,
    )
    return Descent(objective, x, np.asarray(found.x), float(found.cost), bool(found.status > 0))
