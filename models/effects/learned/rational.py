"""The rational passive form: a sum of resistances, masses, springs and relaxations, as a ladder of elements has it.

Every passive function of real poles is such a sum with sizes above zero (Foster), so that a sum stays passive whatever
its numbers are. Resonances, its complex poles, have sums of their own (`several`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.arrays import Complexes, Reals
from ...base.errors import PzctlError
from ...base.names import among
from .corrections import CONSTANTS, Place, Quantity
from .laws import Law, Values, laws
from .several import numbered

MOST_TERMS = 5
"""Largest number of terms in one sum."""
_JOINT = "+"
_ADDED = ("resistance", "inertance", "compliance", "debye")
_OF_CONSTANTS = ("debye", "debye-falling")


def terms(quantity: Quantity) -> tuple[Law, ...]:
    """Return the laws of which a rational form of a quantity is the sum; none for a load or a reading."""
    known = {law.name: law for law in laws(quantity)}
    if quantity in CONSTANTS:
        return tuple(known[name] for name in _OF_CONSTANTS if name in known)
    if "debye" not in known:
        return ()
    return (*(known[name] for name in _ADDED), replace(known["debye"], name="rise", of=_risen, says=_RISEN))


def _risen(x: Reals, values: Values) -> Complexes:
    """Return what a resistance with an inertance across it does: nothing at low frequency, all of it at high."""
    return np.asarray(values["size"] / (1 + values["at"] / (1j * x)), np.complex128)


_RISEN = "{size} that appears from {at} on"


def rational(parts: Sequence[Law]) -> Law:
    """Return the sum of laws; parameters of the second are `size_2`, `at_2`."""
    names = [{knob.name: numbered(knob.name, k) for knob in law.parameters} for k, law in enumerate(parts, 1)]
    pairs = list(zip(parts, names, strict=True))

    def own(values: Values, of: dict[str, str]) -> Values:
        return {old: values[new] for old, new in of.items()}

    def total(x: Reals, values: Values) -> Complexes:
        return np.asarray(sum(law.of(x, own(values, of)) for law, of in pairs), np.complex128)

    def taken(values: Values) -> complex:
        return sum((law.taken(own(values, of)) for law, of in pairs if law.taken is not None), 0j)

    says = [law.says.format(**{old: f"{{{new}}}" for old, new in of.items()}) for law, of in pairs]
    knobs = tuple(replace(knob, name=of[knob.name]) for law, of in pairs for knob in law.parameters)
    name = _JOINT.join(law.name for law in parts)
    complete = taken if all(law.taken is not None for law in parts) else None
    return Law(name, knobs, total, f"{', '.join(says[:-1])} and {says[-1]}", complete)


def sum_named(place: Place, name: str) -> Law:
    """Return the sum with this name that a place may have. Raises PzctlError."""
    known = {law.name: law for law in terms(place.quantity)}
    names = terms_of(name)
    for one in names:
        if one not in known:
            raise PzctlError(
                f"{place.where}: {one!r} in the law {name!r} is no part of a sum; {among(one, list(known))}"
            )
    if len(names) > MOST_TERMS:
        raise PzctlError(f"{place.where}: the law {name!r} has {len(names)} parts; at most {MOST_TERMS} are allowed")
    return rational([known[one] for one in names])


def is_rational(name: str) -> bool:
    """Return whether this is the name of a sum."""
    return _JOINT in name


def terms_of(name: str) -> list[str]:
    """Return the names of the terms of a sum, or the name of a single law."""
    return name.split(_JOINT)
