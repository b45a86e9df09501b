"""Priors of a material's own losses, beside effects that add to them where the constants are stated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ....models.effects import Effect, EffectParameter
from ...engine.recording import Prior

_STEP = 1e-6
"""Relative step of differences."""


@dataclass(frozen=True)
class OwnLoss(Prior):
    """The imaginary part of a constant (`parameter`) without what an effect adds to it."""

    effect: Effect
    where: str
    knobs: Mapping[str, str]
    """The effect's parameters in the fit by their names in the effect."""

    @property
    def _constant(self) -> str:
        return self.parameter.removesuffix(".im")

    @property
    def needs(self) -> tuple[str, ...]:
        """Both parts of the constant, and the effect's parameters."""
        return (self.parameter, f"{self._constant}.re", *self.knobs.values())

    def predicted(self, values: Mapping[str, float]) -> float:
        """Return the material's own imaginary part."""
        own = {name: values[full] for name, full in self.knobs.items()}
        added = self.effect.added_losses(self.where, own)[self._constant]
        return values[self.parameter] - values[f"{self._constant}.re"] * added

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivatives of the own part by the constant's parts and the effect's parameters."""
        slopes = {self.parameter: 1.0}
        for name in self.needs[1:]:
            step = _STEP * (abs(values[name]) or 1.0)
            above, below = (self.predicted({**values, name: values[name] + way * step}) for way in (1, -1))
            slopes[name] = (above - below) / (2 * step)
        return slopes


class _Added(Protocol):
    """An effect at a place, with its parameters in a fit."""

    @property
    def effect(self) -> Effect: ...
    @property
    def where(self) -> str: ...
    @property
    def parameters(self) -> tuple[str, ...]: ...
    @property
    def effect_parameters(self) -> tuple[EffectParameter, ...]: ...


def priors_beside(priors: Sequence[Prior], added: Sequence[_Added]) -> tuple[Prior, ...]:
    """Return the priors beside these effects: those of losses are the material's own."""
    made = list(priors)
    for one in added:
        knobs = {knob.name: name for knob, name in zip(one.effect_parameters, one.parameters, strict=True)}
        absent = {knob.name: knob.null for knob in one.effect_parameters}
        lossy = {f"{constant}.im" for constant in one.effect.added_losses(one.where, absent)}
        made = [
            OwnLoss(prior.parameter, prior.mean, prior.u, one.effect, one.where, knobs)
            if prior.parameter in lossy
            else prior
            for prior in made
        ]
    return tuple(made)
