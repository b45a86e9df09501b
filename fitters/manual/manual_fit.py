"""Manual fit: a person chooses the free constants, their start values, the bands and the effects.

`look` computes the model's curve at chosen values, without fitting. `fit` fits with exactly these choices: one descent
from exactly there, on the model of `mason` (all chosen steps jointly), of `radial` or of `disk`, with the chosen
effects of the catalogue. (E. S. Tjelde, thesis 2012, chapter 9, asks for this control.)
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.build import Build
from ...models.effects import Device, EffectParameter
from ...models.effects.base.effect import SWEEP
from ...models.sweep import Sweep
from ..diagnosis.hypotheses.problem import Candidate
from ..engine.covariance import estimate
from ..engine.descent import settle
from ..engine.objective import LOADS, Objective
from ..engine.parameters.coordinates import Coordinates
from ..engine.recording import Recording
from ..error_model.instrument_share import chi2_beside_instrument
from ..interface import Constant, Curve, FitError, FitResult, FitTask
from .adjustables import Adjustable, handles_of, with_value
from .disk_manual_fit import disk_in_hand, radial_in_hand
from .manual_choices import Bands, Choices, FitSetup, Subject, began_with, check_bands, within
from .stack_manual_fit import StackManualFit

__all__ = ["Choices", "ManualFit", "ModelPreview", "models_for"]

_EVERYWHERE: Bands = ((0.0, np.inf),)
_USUAL = Choices()
_FEWEST = 20
"""Fewest points of a sweep that a band must contain."""
_SMALLEST, _LARGEST = 1e-30, 1e30
"""Limits of |Z|, as of a recording, ohm."""
_SUBJECTS: dict[str, Callable[[FitTask], Subject]] = {
    StackManualFit.fitter: StackManualFit,
    "radial": radial_in_hand,
    "disk": disk_in_hand,
}


def models_for(build: Build, step: str) -> tuple[str, ...]:
    """Return the fitters that support a manual fit of a step. Raises KeyError for an unknown step."""
    kinds = [build.layer(name).kind for name in build.step(step).layers]
    disk = kinds == ["piezo"] and build.diameter is not None and build.hole_diameter is None
    return tuple(_SUBJECTS) if disk else (StackManualFit.fitter,)


@dataclass(frozen=True, eq=False)
class ModelPreview:
    """A model at chosen values, beside the measurement."""

    handles: tuple[Adjustable, ...]
    curves: tuple[Curve, ...]
    """Curves over whole sweeps; `start` and `fitted` are both the model."""
    chi2_per_dof: float
    """Misfit over the chosen bands, in units of the noise, without the part that the analyzer's error accounts for."""
    says: tuple[str, ...] = ()
    """Sentences about the start values for the user."""


class ManualFit:
    """Manual fit of the recordings of a build with the model of one fitter."""

    def __init__(self, task: FitTask, fitter: str = StackManualFit.fitter) -> None:
        """Prepare the recordings, with nominal start values or those from their peaks.

        Raises FitError if there is no such model, or task, build and sweeps do not match.
        """
        if fitter not in _SUBJECTS:
            raise FitError(f"nothing can be taken in hand with {fitter!r}: there are {', '.join(_SUBJECTS)}")
        self._subject = _SUBJECTS[fitter](task)

    @classmethod
    def after(cls, task: FitTask, result: FitResult) -> Self:
        """Return a manual fit of `task` with the model of the fitter of `result`, starting from that result.

        If the result does not contain area and loads, they are fitted here with everything else held. Raises FitError.
        """
        manual_fit = cls(task, result.fitter)
        subject = manual_fit._subject
        subject.values = began_with(subject.values, result.constants)
        untold = {"area", *LOADS} - set(result.constants)
        free = tuple(
            adjustable.name for adjustable in manual_fit.look().handles if adjustable.free and adjustable.name in untold
        )
        if free:
            _, choices = manual_fit.fit(Choices(free=free))
            subject.values |= {name: choices.values[name] for name in free}
        return manual_fit

    @property
    def build(self) -> Build:
        """The build."""
        return self._subject.build

    @property
    def fitter(self) -> str:
        """Name of the fitter whose model this is."""
        return self._subject.fitter

    @property
    def sweeps(self) -> Mapping[str, tuple[Sweep, ...]]:
        """The recordings, by step in gluing order."""
        return self._subject.sweeps

    @property
    def steps(self) -> tuple[str, ...]:
        """The recorded steps, in gluing order."""
        return tuple(self.sweeps)

    def places(self) -> dict[str, tuple[str, ...]]:
        """Return every selectable effect, with its possible places."""
        places: dict[str, list[str]] = {}
        for candidate in self._posed(Choices(), whole=True).places():
            if candidate.where not in places.setdefault(candidate.effect.name, []):
                places[candidate.effect.name].append(candidate.where)
        return {name: tuple(where) for name, where in places.items()}

    def look(self, choices: Choices = _USUAL) -> ModelPreview:
        """Return the model at the chosen values. Raises FitError for an impossible choice."""
        posed, effects, coordinates = self._chosen(choices)
        curves, chi2 = self._curves(choices, effects, coordinates, coordinates.x)
        return ModelPreview(_handles(posed, effects, coordinates, coordinates.x), curves, chi2, self._subject.says)

    def fit(self, choices: Choices = _USUAL) -> tuple[FitResult, Choices]:
        """Fit with exactly these choices; return the result, and the choices updated to the fitted values.

        Raises FitError for an impossible choice, or if nothing is free.
        """
        began = time.perf_counter()
        posed, effects, coordinates = self._chosen(choices)
        if not coordinates.free:
            raise FitError("nothing is free: free at least one constant")
        before, _ = self._curves(choices, effects, coordinates, coordinates.x)
        descent = settle(posed.with_effects(effects), coordinates, posed.priors, coordinates.x)
        steps = tuple(dict.fromkeys(recording.step for recording in posed.recordings))
        answer = self._subject.answer(steps, descent, time.perf_counter() - began)
        after, chi2 = self._curves(choices, effects, coordinates, descent.x)
        curves = tuple(replace(new, start=old.fitted) for new, old in zip(after, before, strict=True))
        sizes = _sizes(effects, coordinates, estimate(descent).covariance, descent.x)
        handles = _handles(posed, effects, coordinates, descent.x)
        there = replace(choices, values={handle.name: handle.value for handle in handles})
        return replace(answer, constants={**answer.constants, **sizes}, curves=curves, chi2_per_dof=chi2), there

    def _chosen(self, choices: Choices) -> tuple[FitSetup, tuple[Candidate, ...], Coordinates]:
        posed = self._posed(choices)
        effects = _effects(posed, choices)
        if any(candidate.where == SWEEP for candidate in effects) and any(choices.bands.values()):
            raise FitError("an effect of the sweep needs the whole sweep: remove the effect or the bands")
        values = dict(self._subject.values)
        for candidate in effects:
            for k, (name, knob) in enumerate(zip(candidate.parameters, candidate.effect_parameters, strict=True)):
                values[name] = knob.null if k else knob.typical  # so that one sees what it does
        known = self._posed(Choices(), whole=True).coordinates(effects, values, None).names
        for name, value in choices.values.items():
            if name not in known:
                raise FitError(f"{name!r} cannot be moved: there are {', '.join(known)}")
            values = with_value(name, float(value), values)
        coordinates = posed.coordinates(effects, values, choices.free)
        strange = [name for name in choices.free or () if name not in coordinates.names]
        if strange:
            raise FitError(f"cannot free {strange[0]!r}: there are {', '.join(coordinates.names)}")
        return posed, effects, coordinates

    def _posed(self, choices: Choices, *, whole: bool = False) -> FitSetup:
        """Return the fit of the chosen bands; with `whole`, of all frequencies of the chosen steps."""
        check_bands(choices, self.steps)
        bands = {step: chosen for step in self.steps if (chosen := self._bands(choices, step))}
        parts = _EVERYWHERE if whole else self._subject.parts
        kept = {step: self._cut(step, _EVERYWHERE if whole else chosen, parts) for step, chosen in bands.items()}
        kept = {step: pairs for step, pairs in kept.items() if pairs}
        if not kept:
            wanted = ", ".join(
                f"{low / 1e6:.3g} to {high / 1e6:.3g} MHz" for limits in bands.values() for low, high in limits
            )
            raise FitError(f"no band holds {_FEWEST} points of any sweep: {wanted or 'none'}; wider bands are needed")
        return self._subject.pose(kept)

    def _bands(self, choices: Choices, step: str) -> Bands:
        return choices.bands.get(step, self._subject.usual)

    def _cut(self, step: str, bands: Bands, parts: Bands) -> list[tuple[Sweep, NDArray[np.float64]]]:
        """Return the sweeps of a step and their noise within its bands, part by part; omit parts that are too short."""
        kept: list[tuple[Sweep, NDArray[np.float64]]] = []
        for part in parts:
            for sweep, sigma in zip(self.sweeps[step], self._subject.noises[step], strict=True):
                mask = within(sweep, bands) & within(sweep, (part,))
                if mask.sum() >= min(_FEWEST, mask.size):
                    kept.append((sweep.at(mask), sigma[mask]))
        return kept

    def _curves(
        self, choices: Choices, effects: Sequence[Candidate], coordinates: Coordinates, x: NDArray[np.float64]
    ) -> tuple[tuple[Curve, ...], float]:
        """Return the model over whole sweeps, and its misfit within the bands. Raises FitError."""
        recordings = self._posed(choices, whole=True).with_effects(effects)
        objective = Objective(recordings, coordinates, ())
        curves: list[Curve] = []
        chosen: list[Recording] = []
        for recording, model in zip(recordings, objective.models(x), strict=True):
            sweep, mask = recording.sweep, within(recording.sweep, self._bands(choices, recording.step))
            Z = model.impedance(sweep.frequency)
            size = np.abs(Z)
            if not ((size >= _SMALLEST) & (size <= _LARGEST)).all():  # not, because of nan
                raise FitError(
                    f"at these values the model's |Z| is not from {_SMALLEST:g} to {_LARGEST:g} ohm; move them towards "
                    "those of the build"
                )
            curves.append(Curve(recording.step, sweep.frequency, sweep.impedance, Z, Z))
            chosen.append(replace(recording, noise=np.where(mask, recording.noise, np.inf)))
        return tuple(curves), chi2_beside_instrument(chosen, objective.log_ratios(x), len(coordinates.free))


def _handles(
    posed: FitSetup, effects: Sequence[Candidate], coordinates: Coordinates, x: NDArray[np.float64]
) -> tuple[Adjustable, ...]:
    values, _ = coordinates.forward(x)
    return handles_of(coordinates.names, values, posed.priors, _effect_parameters(posed, effects), coordinates.free)


def _effect_parameters(posed: FitSetup, effects: Sequence[Candidate]) -> dict[str, EffectParameter]:
    """Return the parameters of chosen effects, and of those that the build states, by full name."""
    found: dict[str, EffectParameter] = {}
    devices = (recording.model for recording in posed.recordings)
    for device in (one for one in devices if isinstance(one, Device)):
        for one in device.added:
            knobs = one.effect.parameters_in(device.bare, device.reference, one.where)
            found |= {one.prefix + knob.name: knob for knob in knobs}
    for chosen in effects:
        found |= dict(zip(chosen.parameters, chosen.effect_parameters, strict=True))
    return found


def _effects(posed: FitSetup, choices: Choices) -> tuple[Candidate, ...]:
    """Return the chosen effects, each in all steps in which it can occur."""
    there = posed.places({name for name, _ in choices.effects})
    selected: list[Candidate] = []
    for name, where in choices.effects:
        candidate = next((c for c in there if (c.effect.name, c.where) == (name, where)), None)
        if candidate is None:
            places = ", ".join(dict.fromkeys(c.where for c in there if c.effect.name == name)) or "none"
            raise FitError(f"effect {name!r} cannot be at {where!r}; possible places: {places}")
        if candidate in selected:
            raise FitError(f"effect {name!r} at {where!r} is chosen twice; choose it once")
        selected.append(candidate)
    return tuple(map(_without_priors, selected))


def _without_priors(candidate: Candidate) -> Candidate:
    """Return a candidate without the parameters that only their priors tell from others."""
    told = tuple(knob for knob in candidate.effect_parameters if not knob.needs_prior)
    return replace(candidate, effect_parameters=told)


def _sizes(
    effects: Sequence[Candidate], coordinates: Coordinates, covariance: NDArray[np.float64], x: NDArray[np.float64]
) -> dict[str, Constant]:
    """Return the effects' parameters as constants."""
    values, _ = coordinates.forward(x)
    u = dict(zip(coordinates.parameters, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
    return {
        name: Constant(values[name], 0.0, u[name], 0.0, knob.unit, free=name in coordinates.free)
        for candidate in effects
        for name, knob in zip(candidate.parameters, candidate.effect_parameters, strict=True)
    }
