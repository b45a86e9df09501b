"""A fit as a person wants it: which constants are free, where they begin, which bands and which effects take part.

First one looks: the model's curve at chosen values, without fitting. Then one fits with exactly these choices: one
descent from exactly there, on the stack of `mason` with the chosen effects of the catalogue, all chosen steps jointly.
(C. Tjelde, thesis 2012, chapter 9, asks for this control.)
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..models.build import Build
from ..models.effects.effect import SWEEP
from ..models.sweep import Sweep
from .answer import least_squares_answer
from .assembly import PIEZO_CONSTANTS, nominal_parameters, priors_of, recordings_of
from .coordinates import Coordinates
from .covariance import estimate
from .descent import chi2_per_point, settle
from .diagnosis.candidates import candidates
from .diagnosis.conditions import as_devices
from .diagnosis.problem import Candidate, Problem
from .handles import Handle, handles_of, with_value
from .interface import Constant, Curve, FitError, FitResult, FitTask
from .joint import Solution, check_task
from .noise import noise_of
from .objective import LOADS, Objective

NAME = "by-hand"
_FEWEST = 20
"""Points of a sweep that a band must hold to say anything."""


Bands = tuple[tuple[float, float], ...]
"""From, to, in Hz."""


@dataclass(frozen=True)
class Choices:
    """What a person chose; the default is what the fitter `mason` does, from the values it is given."""

    free: tuple[str, ...] | None = None
    """Names of the handles that move, exactly; None: all that carry an uncertainty, and all of the effects'."""
    values: Mapping[str, float] = field(default_factory=dict[str, float])
    """Where handles begin, SI; those that are not named are where they were."""
    bands: Mapping[str, Bands] = field(default_factory=dict[str, Bands])
    """By step, Hz: what takes part. A step that is not named does with all it has, one without bands not at all."""
    effects: tuple[tuple[str, str], ...] = ()
    """Name and place, as in `lead-inductance`, `terminals`."""


@dataclass(frozen=True, eq=False)
class Look:
    """A model at chosen values, beside the measurement."""

    handles: tuple[Handle, ...]
    curves: tuple[Curve, ...]
    """Over whole sweeps; `start` and `fitted` are both the model."""
    chi2_per_dof: float
    """Misfit over the chosen bands, in units of the noise."""


class ByHand:
    """The recordings of a build, taken in hand. `begin`: model parameters to begin with, over the nominal ones."""

    def __init__(self, task: FitTask, begin: Mapping[str, float] | None = None) -> None:
        """Take the recordings in hand. Raises FitError where task, build and sweeps do not fit."""
        self._build, self._sweeps = check_task(task)
        self._begin = nominal_parameters(self._build) | dict(begin or {})
        self._noises = {step: noise_of(sweeps) for step, sweeps in self._sweeps.items()}

    @classmethod
    def after(cls, task: FitTask, result: FitResult) -> Self:
        """Return the recordings of `task` in hand, beginning where a fit ended.

        A result does not tell area and loads; they are fitted here, everything else being where the result has it.
        """
        there = cls(task, parameters_of(result.constants))
        free = tuple(one.name for one in there.look().handles if one.free and one.name in ("area", *LOADS))
        if free:
            _, choices = there.fit(Choices(free=free))
            there._begin |= {name: choices.values[name] for name in free}
        return there

    @property
    def build(self) -> Build:
        """The build."""
        return self._build

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps that were recorded, in gluing order."""
        return tuple(self._sweeps)

    def places(self) -> dict[str, tuple[str, ...]]:
        """Return every effect that can be chosen, and where it can sit."""
        found: dict[str, list[str]] = {}
        for one in candidates(self._problem(Choices(), whole=True)):
            if one.where not in found.setdefault(one.effect.name, []):
                found[one.effect.name].append(one.where)
        return {name: tuple(where) for name, where in found.items()}

    def look(self, choices: Choices = Choices()) -> Look:
        """Return the model at the chosen values. Raises FitError where a choice cannot be."""
        _, effects, coordinates = self._chosen(choices)
        curves, chi2 = self._curves(choices, effects, coordinates, coordinates.x)
        return Look(self._handles(choices, effects, coordinates, coordinates.x), curves, chi2)

    def fit(self, choices: Choices = Choices()) -> tuple[FitResult, Choices]:
        """Fit with exactly these choices; return the result, and the choices with every handle where it has come to.

        Raises FitError where a choice cannot be, or nothing is free.
        """
        began = time.perf_counter()
        problem, effects, coordinates = self._chosen(choices)
        if not coordinates.free:
            raise FitError("nothing is free: free at least one constant")
        descent = settle(problem.with_effects(effects), coordinates, problem.priors, coordinates.x)
        begun, _ = coordinates.forward(coordinates.x)
        noises = {step: self._noises[step][0] for step in problem.steps}
        seconds = time.perf_counter() - began
        solution = Solution(self._build, noises, descent, begun, descent.evaluations, seconds)
        answer = least_squares_answer(NAME, "1", solution)
        after, _ = self._curves(choices, effects, coordinates, descent.x)
        before, _ = self._curves(choices, effects, coordinates, coordinates.x)
        curves = tuple(replace(new, start=old.fitted) for new, old in zip(after, before, strict=True))
        sizes = _sizes(effects, coordinates, estimate(descent).covariance, descent.x)
        handles = self._handles(choices, effects, coordinates, descent.x)
        there = replace(choices, values={handle.name: handle.value for handle in handles})
        return replace(answer, constants={**answer.constants, **sizes}, curves=curves), there

    def _chosen(self, choices: Choices) -> tuple[Problem, tuple[Candidate, ...], Coordinates]:
        problem = self._problem(choices)
        effects = _effects(problem, choices)
        if any(one.where == SWEEP for one in effects) and any(choices.bands.values()):
            raise FitError("an effect of the sweep acts while the whole sweep runs: take it or the bands away")
        values = dict(problem.values)
        for one in effects:
            for k, (name, knob) in enumerate(zip(one.parameters, one.knobs, strict=True)):
                values[name] = knob.null if k else knob.typical  # so that one sees what it does
        for name, value in choices.values.items():
            values = with_value(name, float(value), values)
        whole = problem.coordinates(effects, values)
        free = whole.free if choices.free is None else choices.free
        strange = [name for name in free if name not in whole.names]
        if strange:
            raise FitError(f"cannot free {strange[0]!r}: there are {', '.join(whole.names)}")
        return problem, effects, Coordinates(whole.blocks, values, tuple(free))

    def _problem(self, choices: Choices, *, whole: bool = False) -> Problem:
        """Return the recordings of the chosen bands; `whole`: of all frequencies of the chosen steps."""
        _check_bands(choices, self.steps)
        recordings = [
            recording
            for step, sweeps in self._sweeps.items()
            if choices.bands.get(step, True)
            for recording in recordings_of(self._build, step, *self._cut(choices, step, sweeps, whole))
        ]
        if not recordings:
            raise FitError(f"no band holds {_FEWEST} points of any sweep; wider bands are needed")
        steps = tuple(dict.fromkeys(recording.step for recording in recordings))
        return Problem(self._build, as_devices(recordings), priors_of(self._build, steps), self._begin, None)

    def _cut(
        self, choices: Choices, step: str, sweeps: Sequence[Sweep], whole: bool
    ) -> tuple[list[Sweep], list[NDArray[np.float64]]]:
        """Return the sweeps of a step and their noise within its bands; what is too short is left out."""
        kept: list[Sweep] = []
        noise: list[NDArray[np.float64]] = []
        for sweep, sigma in zip(sweeps, self._noises[step][1], strict=True):
            mask = np.ones(sweep.frequency.size, bool) if whole else _within(sweep, choices.bands.get(step))
            if mask.sum() >= min(_FEWEST, mask.size):
                kept.append(replace(sweep, frequency=sweep.frequency[mask], impedance=sweep.impedance[mask]))
                noise.append(sigma[mask])
        return kept, noise

    def _curves(
        self, choices: Choices, effects: Sequence[Candidate], coordinates: Coordinates, x: NDArray[np.float64]
    ) -> tuple[tuple[Curve, ...], float]:
        """Return the model over whole sweeps, and its misfit within the bands."""
        recordings = self._problem(choices, whole=True).with_effects(effects)
        objective = Objective(recordings, coordinates, ())
        curves: list[Curve] = []
        total = points = 0.0
        for recording, model, ratio in zip(recordings, objective.models(x), objective.log_ratios(x), strict=True):
            sweep, mask = recording.sweep, _within(recording.sweep, choices.bands.get(recording.step))
            Z = model.impedance(sweep.frequency)
            curves.append(Curve(recording.step, sweep.frequency, sweep.impedance, Z, Z))
            if mask.any():
                inside = replace(recording, noise=recording.noise[mask])
                total += float(mask.sum()) * chi2_per_point(inside, ratio[mask])
                points += float(mask.sum())
        return tuple(curves), total / max(points, 1.0)

    def _handles(
        self, choices: Choices, effects: Sequence[Candidate], coordinates: Coordinates, x: NDArray[np.float64]
    ) -> tuple[Handle, ...]:
        values, _ = coordinates.forward(x)
        priors = self._problem(choices).priors
        return handles_of(coordinates.names, values, priors, effects, coordinates.free)


def parameters_of(constants: Mapping[str, Constant]) -> dict[str, float]:
    """Return the model parameters of fitted constants."""
    values: dict[str, float] = {}
    for name, constant in constants.items():
        if name.rpartition(".")[2] in PIEZO_CONSTANTS:
            values |= {f"{name}.re": constant.re, f"{name}.im": constant.im}
        else:
            values[name] = constant.re
    return values


def _check_bands(choices: Choices, steps: Sequence[str]) -> None:
    for step, bands in choices.bands.items():
        if step not in steps:
            raise FitError(f"bands of step {step!r}: it was not recorded; {', '.join(steps)} was")
        for low, high in bands:
            if not 0 <= low < high:
                raise FitError(f"band {low / 1e6:g} to {high / 1e6:g} MHz of step {step!r}: the lower end comes first")


def _within(sweep: Sweep, bands: Bands | None) -> NDArray[np.bool_]:
    if bands is None:
        return np.ones(sweep.frequency.size, bool)
    inside = [(sweep.frequency >= low) & (sweep.frequency <= high) for low, high in bands]
    return np.any(inside, axis=0) if inside else np.zeros(sweep.frequency.size, bool)


def _effects(problem: Problem, choices: Choices) -> tuple[Candidate, ...]:
    """Return the chosen effects, each in all the steps that can have it."""
    there = candidates(problem, {name for name, _ in choices.effects})
    found: list[Candidate] = []
    for name, where in choices.effects:
        one = next((c for c in there if (c.effect.name, c.where) == (name, where)), None)
        if one is None:
            places = ", ".join(dict.fromkeys(c.where for c in there if c.effect.name == name)) or "no place here"
            raise FitError(f"effect {name!r} cannot sit at {where!r}: there is {places}")
        found.append(one)
    return tuple(found)


def _sizes(
    effects: Sequence[Candidate], coordinates: Coordinates, covariance: NDArray[np.float64], x: NDArray[np.float64]
) -> dict[str, Constant]:
    """Return the effects' knobs as constants."""
    values, _ = coordinates.forward(x)
    u = dict(zip(coordinates.parameters, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
    return {
        name: Constant(values[name], 0.0, u[name], 0.0, knob.unit, free=name in coordinates.free)
        for one in effects
        for name, knob in zip(one.parameters, one.knobs, strict=True)
    }
