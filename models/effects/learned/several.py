"""Several resonances at one place as one law: their sum, each with its own size, frequency and Q."""

from dataclasses import replace

import numpy as np

from ...base.arrays import Complexes, Reals
from ..base.effect import EffectParameter
from .corrections import Quantity
from .laws import Law, Values, laws

MOST = 4
"""Largest number of resonances in one law."""
_IN_WORDS = {2: "two", 3: "three", 4: "four"}


def several(law: Law, count: int) -> Law:
    """Return the sum of `count` laws of the same form; parameters of the second are `size_2`, `at_2`, `q_2`."""
    if count == 1:
        return law
    parts = [_numbered(law.parameters, k) for k in range(1, count + 1)]

    def of(x: Reals, values: Values) -> Complexes:
        own = ({old.name: values[new.name] for old, new in zip(law.parameters, part, strict=True)} for part in parts)
        return np.asarray(sum((law.of(x, one) for one in own), np.zeros(x.size, np.complex128)), np.complex128)

    said = [_said(law, part) for part in parts]
    name = f"{_IN_WORDS[count]}-{law.name.replace('resonance', 'resonances')}"
    return Law(name, tuple(knob for part in parts for knob in part), of, f"{', '.join(said[:-1])} and {said[-1]}")


def numbered(name: str, k: int) -> str:
    """Return the name of a parameter of resonance number `k`: `at`, `at_2`."""
    return name if k == 1 else f"{name}_{k}"


def _numbered(parameters: tuple[EffectParameter, ...], k: int) -> tuple[EffectParameter, ...]:
    return tuple(replace(knob, name=numbered(knob.name, k)) for knob in parameters)


def _said(law: Law, part: tuple[EffectParameter, ...]) -> str:
    says = law.says
    for old, new in zip(law.parameters, part, strict=True):
        says = says.replace(f"{{{old.name}}}", f"{{{new.name}}}")
    return says


def resonant(law: Law) -> bool:
    """Return whether a law is a resonance, of which a place can have several."""
    return {"at", "q"} <= {knob.name for knob in law.parameters}


def laws_of_several(quantity: Quantity) -> tuple[Law, ...]:
    """Return the laws of two and more resonances for a quantity."""
    return tuple(several(law, count) for law in laws(quantity) if resonant(law) for count in range(2, MOST + 1))
