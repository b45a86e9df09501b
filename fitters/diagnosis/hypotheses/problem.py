"""The fit to which effects can be added: recordings, their devices, and the free parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....models.effects import Device, Effect, EffectParameter
from ...engine.fitted_model import Diagnosable, FittedModel
from ...engine.multi_step_fit import Solution, solve
from ...engine.objective import Objective
from ...engine.parameters.assembly import library_losses, priors_of
from ...engine.parameters.coordinates import Block, Coordinates, between, hardly_negative, linear
from ...engine.recording import Posterior, Prior, Recording
from ...error_model.local_error_kinds import LocalError
from ...interface import FitTask
from ..data_quality.colour_limit import colour_limit
from ..data_quality.pole_fit import Frame, PoleFit, fit_poles
from ..decision_rules import SHARP
from .conditions import as_devices
from .held_out import BANDS, Masks, held_out
from .model_under_diagnosis import LayeredModel, ModelUnderDiagnosis

_LEAST = 1e-5
"""Smallest size at which a fit can start, relative to the typical one."""


@dataclass(frozen=True)
class Candidate:
    """An effect at one place, in some steps of a build."""

    effect: Effect
    where: str
    steps: tuple[str, ...]
    """Steps whose recordings show it, in gluing order."""
    effect_parameters: tuple[EffectParameter, ...]

    def __hash__(self) -> int:
        return hash((self.effect.key, self.where, self.steps))  # its parameters follow from these

    @property
    def step(self) -> str:
        """The step in which it first appears."""
        return self.steps[0]

    @property
    def prefix(self) -> str:
        """Common prefix of its parameters' names."""
        return f"{self.effect.key}@{self.where}."

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(self.prefix + knob.name for knob in self.effect_parameters)

    @property
    def sizes(self) -> tuple[tuple[str, EffectParameter], ...]:
        """Names of its sizes among the parameters, and their parameters."""
        return tuple(zip(self.parameters, self.effect_parameters, strict=True))[: self.effect.sizes]

    @property
    def resonance_parameters(self) -> tuple[str, ...]:
        """Names of the parameters that are resonance frequencies of its own: frequencies of an effect that has a Q."""
        others = zip(self.parameters[1:], self.effect_parameters[1:], strict=True)
        sharp = any(knob.name == "q" for knob in self.effect_parameters)
        return tuple(name for name, knob in others if sharp and knob.unit == "Hz")

    @property
    def resonates(self) -> bool:
        """Whether it is one resonance that may be sharp: a line in the residual."""
        sharp = any(knob.name == "q" and knob.upper > SHARP for knob in self.effect_parameters)
        return sharp and len(self.resonance_parameters) == 1

    def taking(self, other: "Candidate", values: Mapping[str, float]) -> dict[str, float]:
        """Return its parameters with the values of the same effect at another place, as far as that has them."""
        own = {knob.name for knob in other.effect_parameters}
        return {
            name: values[other.prefix + knob.name]
            for name, knob in zip(self.parameters, self.effect_parameters, strict=True)
            if knob.name in own
        }

    def blocks(self, values: Mapping[str, float]) -> tuple[Block, ...]:
        """Return the coordinates of its parameters within their physical limits, for a fit that starts at `values`."""
        return tuple(
            _block(name, knob, values.get(name, knob.null), first=knob is self.effect_parameters[0])
            for name, knob in zip(self.parameters, self.effect_parameters, strict=True)
        )


@dataclass(frozen=True, eq=False)
class Problem:
    """The recordings with their devices, priors and start values."""

    model: ModelUnderDiagnosis
    recordings: tuple[Recording, ...]
    """Each with a `Device` as its model."""
    priors: tuple[Prior | Posterior, ...]
    values: Mapping[str, float]
    """Start values of the fits."""
    proof: Masks = ()
    """Held-out points of every recording, as masks."""
    local: tuple[LocalError, ...] = ()
    """Weak lines and switches of the range that are part of the error model."""
    causal: tuple[PoleFit, ...] = ()
    """What any causal linear device could do, of each recording."""
    losses: tuple[Prior, ...] = ()
    """What is known of the materials' losses."""

    @property
    def points(self) -> int:
        """Number of points of all recordings."""
        return sum(recording.sweep.frequency.size for recording in self.recordings)

    @property
    def steps(self) -> tuple[str, ...]:
        """The recorded steps, in gluing order."""
        return tuple(dict.fromkeys(recording.step for recording in self.recordings))

    @classmethod
    def of(cls, solution: Solution, free: tuple[str, ...] | None, hold_out: str = BANDS) -> "Problem":
        """Return the problem of a joint fit, with devices under the conditions of their sweeps in place of stacks.

        Raises FitError if the recordings contain no data of the kind to be held out (see `held_out`).
        """
        objective = solution.descent.objective
        recordings, causal = _limited(as_devices(objective.recordings))
        values, _ = objective.coordinates.forward(solution.descent.x)
        steps = tuple(dict.fromkeys(recording.step for recording in recordings))
        return cls(
            LayeredModel(solution.build, free),
            recordings,
            priors_of(solution.build, steps),
            values,
            held_out(recordings, hold_out),
            causal=causal,
            losses=library_losses(solution.build, steps),
        )

    @classmethod
    def posed(
        cls, task: FitTask, progress: Callable[[str], None], fitter: Diagnosable | None = None, hold_out: str = BANDS
    ) -> "Problem":
        """Return the problem of a task, fitted without effects: of its stacks, or of the `fitter`'s model.

        Raises FitError.
        """
        if fitter is None:
            return cls.of(solve(task, progress), task.free, hold_out)
        return cls.of_model(fitter.fitted_model(task, progress), hold_out)

    @classmethod
    def of_model(cls, found: FittedModel, hold_out: str = BANDS) -> "Problem":
        """Return the problem of a model other than a stack, as a fitter has fitted it. Raises FitError."""
        objective = found.descent.objective
        recordings, causal = _limited(as_devices(objective.recordings, found.scale))
        values, _ = objective.coordinates.forward(found.descent.x)
        proof = held_out(recordings, hold_out)
        return cls(found, recordings, objective.all_priors, values, proof, causal=causal)

    def bare_coordinates(self, values: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of a fit without effects, starting at `values`."""
        return self.model.coordinates(self.steps, values)

    def coordinates(self, effects: Sequence[Candidate], values: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of a fit with these effects, starting at or near `values`."""
        values = self.model.restart(values)
        base = self.bare_coordinates(values)
        blocks = [*base.blocks, *(block for effect in effects for block in effect.blocks(values))]
        names = [name for effect in effects for name in effect.parameters]
        null = {effect.prefix + knob.name: knob.null for effect in effects for knob in effect.effect_parameters}
        return Coordinates(tuple(blocks), {**null, **values}, (*base.free, *names))

    def with_effects(self, effects: Sequence[Candidate]) -> tuple[Recording, ...]:
        """Return the recordings with their devices extended by these effects."""
        return tuple(_extended(recording, effects) for recording in self.recordings)

    def objective(self, effects: Sequence[Candidate], values: Mapping[str, float]) -> Objective:
        """Return the objective of a fit with these effects and the present weights."""
        coordinates = self.coordinates(effects, values)
        return Objective(self.with_effects(effects), coordinates, self.priors, slopes_later=bool(effects))

    def without(self, held: Sequence[NDArray[np.bool_]]) -> "Problem":
        """Return the problem without the `held` points, given as one mask per recording.

        They stay in their sweep, because they define its timing, but have no weight.
        """
        parts = [
            replace(recording, noise=np.where(mask, np.inf, recording.noise))
            for recording, mask in zip(self.recordings, held, strict=True)
        ]
        return replace(self, recordings=tuple(parts))


def _block(name: str, knob: EffectParameter, start: float, first: bool) -> Block:
    if knob.from_nothing:
        # in units of the start value, so that small effects are found as well as typical ones
        return hardly_negative(
            name, float(np.clip(start, _LEAST * knob.typical, knob.typical)) if start > 0 else knob.typical
        )
    if not first and np.isfinite(knob.upper):
        return between(name, knob.lower, knob.upper)
    return linear(name, knob.typical)


def _limited(recordings: Sequence[Recording]) -> tuple[tuple[Recording, ...], tuple[PoleFit, ...]]:
    """Return recordings with the largest correlation that their noise can have, and the pole fits that tell it."""
    fits = tuple(fit_poles(Frame.of(one.sweep, one.noise, np.isfinite(one.noise))) for one in recordings)
    limited = (replace(one, colour_limit=colour_limit(fit)) for one, fit in zip(recordings, fits, strict=True))
    return tuple(limited), fits


def _extended(recording: Recording, effects: Sequence[Candidate]) -> Recording:
    device = recording.model
    for candidate in effects:
        if recording.step in candidate.steps and isinstance(device, Device):
            device = device.with_effect(candidate.effect, candidate.where)
    return replace(recording, model=device)
