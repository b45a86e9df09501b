"""A fit that effects can be added to: the recordings of a build, their devices, and what is free."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....models.build import Build
from ....models.effects import Device, Effect, EffectParameter
from ...engine.multi_step_fit import Solution
from ...engine.objective import Objective
from ...engine.parameters.assembly import coordinates_of, nominal_parameters, priors_of
from ...engine.parameters.coordinates import Block, Coordinates, between, hardly_negative, linear
from ...engine.recording import Prior, Recording
from .conditions import as_devices
from .held_out import BANDS, Masks, held_out

_THIN = 1e-2
"""Part of a layer's nominal thickness from which a fit can still go either way."""
_LEAST = 1e-5
"""Part of a typical size that a fit can still be at home with."""


@dataclass(frozen=True)
class Candidate:
    """An effect at a place, in some steps of a build."""

    effect: Effect
    where: str
    steps: tuple[str, ...]
    """The steps whose recordings have it, in gluing order."""
    effect_parameters: tuple[EffectParameter, ...]

    @property
    def step(self) -> str:
        """The step with which it appears."""
        return self.steps[0]

    @property
    def prefix(self) -> str:
        """What its parameters' names begin with."""
        return f"{self.effect.name}@{self.where}."

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
        """Names of those parameters that say at which frequency something of its own is."""
        others = zip(self.parameters[1:], self.effect_parameters[1:], strict=True)
        return tuple(name for name, knob in others if knob.unit == "Hz")

    def blocks(self, values: Mapping[str, float]) -> tuple[Block, ...]:
        """Return the coordinates of its parameters, within what physics allows, for a fit that starts at `values`."""
        return tuple(
            _block(name, knob, values.get(name, knob.null), first=knob is self.effect_parameters[0])
            for name, knob in zip(self.parameters, self.effect_parameters, strict=True)
        )


@dataclass(frozen=True, eq=False)
class Problem:
    """Recordings with devices; `null` is the fit without any effect."""

    build: Build
    recordings: tuple[Recording, ...]
    """Each with a `Device` as its model."""
    priors: tuple[Prior, ...]
    values: Mapping[str, float]
    """Where fits start from."""
    free: tuple[str, ...] | None
    proof: Masks = ()
    """Which points of every recording take no part in the fits that are put to the proof."""

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps that were recorded, in gluing order."""
        return tuple(dict.fromkeys(recording.step for recording in self.recordings))

    @classmethod
    def of(cls, solution: Solution, free: tuple[str, ...] | None, hold_out: str = BANDS) -> "Problem":
        """Return the problem that a joint fit has solved, its stacks seen as devices under their sweep's conditions.

        Raises FitError where what is to be held out, `held_out` says what it may be, is not there.
        """
        objective = solution.descent.objective
        recordings = as_devices(objective.recordings)
        values, _ = objective.coordinates.forward(solution.descent.x)
        steps = tuple(dict.fromkeys(recording.step for recording in recordings))
        return cls(
            solution.build, recordings, priors_of(solution.build, steps), values, free, held_out(recordings, hold_out)
        )

    def coordinates(self, effects: Sequence[Candidate], values: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of a fit with these effects, starting at `values`.

        A layer that a wrong model has made vanish starts again from next to nothing: from 1e-100 m no fit comes back.
        """
        nominal = nominal_parameters(self.build)
        thin = {name: _THIN * nominal[name] for name in values if name.endswith(".thickness") and name in nominal}
        values = {**values, **{name: max(values[name], least) for name, least in thin.items()}}
        base = coordinates_of(self.build, self.steps, values, self.free)
        blocks = [*base.blocks, *(block for effect in effects for block in effect.blocks(values))]
        names = [name for effect in effects for name in effect.parameters]
        null = {effect.prefix + knob.name: knob.null for effect in effects for knob in effect.effect_parameters}
        return Coordinates(tuple(blocks), {**null, **values}, (*base.free, *names))

    def with_effects(self, effects: Sequence[Candidate]) -> tuple[Recording, ...]:
        """Return the recordings, their devices extended by these effects."""
        return tuple(_extended(recording, effects) for recording in self.recordings)

    def objective(self, effects: Sequence[Candidate], values: Mapping[str, float]) -> Objective:
        """Return the objective of a fit with these effects, weighted as the recordings are now."""
        coordinates = self.coordinates(effects, values)
        return Objective(self.with_effects(effects), coordinates, self.priors, slopes_later=bool(effects))

    def without(self, held: Sequence[NDArray[np.bool_]]) -> "Problem":
        """Return the problem in which the `held` points, one mask for each recording, take no part.

        They stay in their sweep, whose course in time they mark, but weigh nothing.
        """
        parts = [
            replace(recording, noise=np.where(mask, np.inf, recording.noise))
            for recording, mask in zip(self.recordings, held, strict=True)
        ]
        return replace(self, recordings=tuple(parts))


def _block(name: str, knob: EffectParameter, start: float, first: bool) -> Block:
    if knob.from_nothing:
        # of the size it starts from, so that small ones are found as well as typical ones
        return hardly_negative(
            name, float(np.clip(start, _LEAST * knob.typical, knob.typical)) if start > 0 else knob.typical
        )
    if not first and np.isfinite(knob.upper):
        return between(name, knob.lower, knob.upper)
    return linear(name, knob.typical)


def _extended(recording: Recording, effects: Sequence[Candidate]) -> Recording:
    device = recording.model
    for candidate in effects:
        if recording.step in candidate.steps and isinstance(device, Device):
            device = device.with_effect(candidate.effect, candidate.where)
    return replace(recording, model=device)
