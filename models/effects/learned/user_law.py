"""A learned law with a name of its own, as an effect of the user's catalogue: any sample can have it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...base.face_loads import FACES
from ...stack import Stack
from ..base.assembly import Assembly
from ..base.effect import Effect, EffectParameter
from ..base.scale import equivalent_plate
from . import corrections
from .corrections import Place
from .laws import Law
from .learned import NAME, LearnedLaw, equivalents, in_words, law_name
from .parts import stage_of

BETWEEN_SAMPLES = 0.7
"""Standard deviation of the logarithm of a size from sample to sample, a factor of two.

A judgement: the uncertainty with which a law is learned from one sample says nothing about the next one.
"""
_LIMITS = 2.0
"""Limits of the other parameters, in such standard deviations."""
_INSIDE = 1e-3
"""Smallest distance of a start value from the limits, as a part of their distance."""


def law_parameters(place: Place, law: Law, reference: float) -> tuple[EffectParameter, ...]:
    """Return the parameters of a law with their units and limits, for a place of any sample."""
    anything = _any_plate(reference)
    return LearnedLaw(place, law, anything, reference).effect_parameters(anything, place.where)


def _any_plate(reference: float) -> Stack:
    """Return a stack that sets typical sizes only, where nobody asks for them."""
    return equivalent_plate("plate", 1e-9, reference)


class UserLaw(Effect):
    """A law of the user's catalogue."""

    separates = LearnedLaw.separates
    references = LearnedLaw.references

    def __init__(
        self, name: str, place: Place, law: Law, reference: float, values: Mapping[str, tuple[float, float]]
    ) -> None:
        """Make the effect; `reference`: where the law has its size, Hz; `values`: value and uncertainty, SI units."""
        self.name, self.place, self.law, self.reference, self.values = name, place, law, reference, dict(values)
        self.stage = stage_of(place, law)
        self.says = f"{place.says[0].upper()}{place.says[1:]} follows the law {law.name} of your catalogue."

    @property
    def physics(self) -> str:
        """The law with the numbers with which it was learned."""
        units = {knob.name: knob.unit for knob in law_parameters(self.place, self.law, self.reference)}
        sizes = {name: (value, u, units[name]) for name, (value, u) in self.values.items()}
        return f"{in_words(self.place, self.law, sizes | self._element())}. Of your own catalogue."

    @property
    def stated(self) -> dict[str, str | float]:
        """The keys by which a build states it, beside its place and its parameters."""
        own: dict[str, str | float] = {"effect": NAME, "quantity": self.place.quantity, "law": self.law.name}
        return {**own, "reference_Hz": self.reference}

    @property
    def law_name(self) -> str:
        """What it corrects and the law of it."""
        return law_name(self.place, self.law)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return its own place; in a stack that has no layer or interface of that name, all of its kind."""
        alike = [one.where for one in corrections.places(stack) if one.quantity == self.place.quantity]
        if self.place.where in alike:
            return (self.place.where,)
        return () if self.place.where in FACES else tuple(alike)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the parameters of the law; the learned values are their priors, as wide as samples differ."""
        return tuple(map(self._known, self._at(where, stack).effect_parameters(stack, where)))

    def _known(self, knob: EffectParameter) -> EffectParameter:
        value, u = self.values[knob.name]
        spread = float(np.hypot(u / value, BETWEEN_SAMPLES))
        if knob.from_nothing:
            return replace(knob, prior=(value, spread))
        factor = float(np.exp(_LIMITS * spread))
        lower, upper = max(knob.lower, value / factor), min(knob.upper, value * factor)
        room = _INSIDE * (upper - lower)
        return replace(knob, lower=lower, upper=upper, null=float(np.clip(value, lower + room, upper - room)))

    def sentence(self, where: str, sizes: Mapping[str, tuple[float, float, str]]) -> str:
        """Return what the law says, with the numbers of this sample."""
        return f"{in_words(Place(where, self.place.quantity), self.law, sizes)}."

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return what the correction is in the terms of a workshop."""
        return equivalents(self.place, self.law, self.reference, values)

    def added_losses(self, where: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the loss of the law at its reference, if it corrects a constant."""
        return self._at(where, _any_plate(self.reference)).added_losses(where, values)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the correction."""
        return self._at(where, assembly.nominal).extend(assembly, where, values)

    def _at(self, where: str, stack: Stack) -> LearnedLaw:
        return LearnedLaw(Place(where, self.place.quantity), self.law, stack, self.reference)

    def _element(self) -> dict[str, tuple[float, float, str]]:
        values = {name: value for name, (value, _) in self.values.items()}
        more = [self.shown({**values, name: value + u}) for name, (value, u) in self.values.items()]
        return {
            name: (value, float(np.linalg.norm([one[name][0] - value for one in more])), unit)
            for name, (value, unit) in self.shown(values).items()
        }
