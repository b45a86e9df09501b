"""`learned`: a law found from a recording, at the place that it corrects."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...base.arrays import Complexes, Frequencies
from ...base.errors import PzctlError
from ...base.face_loads import FACES
from ...base.names import among
from ...base.uncertain_numbers import with_uncertainty
from ...stack import Stack
from ..base.assembly import Assembly
from ..base.effect import Effect, EffectParameter, Stage
from ..base.scale import WATER, resonance
from .corrections import CONSTANTS, Correction, Place, corrected, natural_size, places
from .laws import Law, laws
from .parts import SHARE, corrected_on_part, laws_of_parts, stage_of
from .rational import is_rational, sum_named, terms_of
from .several import laws_of_several, numbered

NAME = "learned"
_QUARTER = 0.24
"""Largest part of a period in which waves cross a layer: a little less than where it resonates."""
_INSIDE = 1.01
"""Smallest ratio of a start frequency to the limits of its band."""


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


class LearnedLaw(Effect):
    """A correction that follows one of the laws of `laws`."""

    name = NAME
    formula_errs = False
    says = "A correction of {where} that no effect of the catalogue lists was learned from the recording."
    separates = "a recording over a wider band, and of another sample: `--other-sample` tests the law on it"
    references = (
        "Jonscher, Dielectric Relaxation in Solids (1983): relaxations and power laws",
        "Szabo, J. Acoust. Soc. Am. 96 (1994) 491: causal power laws",
        "Gustavsen and Semlyen, IEEE Trans. Power Deliv. 14 (1999) 1052: passive rational forms",
    )

    def __init__(
        self,
        place: Place,
        law: Law,
        stack: Stack,
        reference: float = 0.0,
        band: tuple[float, float] = (0.0, float("inf")),
        number: int = 1,
    ) -> None:
        """Make the effect; `reference`: where the law has its size, Hz, 0 for the resonance of the stack.

        `number`: which of the learned laws at its place it is; the first acts innermost.

        `band`: the recorded band, Hz. A relaxation or resonance is looked for in it, because one beyond it cannot be
        told from a power law, a resistance or a change of the constants.
        """
        self.band, self.number = band, number
        self.place, self.law, self.stage = place, law, stage_of(place, law)
        self.reference = reference or resonance(stack)
        self.natural, self.unit = natural_size(stack, place.quantity)

    def in_stack(self, stack: Stack) -> "LearnedLaw":
        """Return the same law in another stack; it has its size at the same frequency there."""
        return LearnedLaw(self.place, self.law, stack, self.reference, number=self.number)

    @property
    def law_name(self) -> str:
        """What it corrects and the law of it."""
        return law_name(self.place, self.law)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return its place, if the stack has it."""
        return (self.place.where,) if self.place in places(stack) else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the parameters of the law in SI units."""
        return tuple(self._physical(knob) for knob in self.law.parameters)

    def _physical(self, knob: EffectParameter) -> EffectParameter:
        scale, unit = self._scale(knob.name)
        prior = None if knob.prior is None else (knob.prior[0] * scale, knob.prior[1])
        lower, upper, null = knob.lower * scale, knob.upper * scale, knob.null * scale
        if unit == "Hz":
            lower, upper = max(lower, self.band[0]), min(upper, self.band[1])
            null = min(max(null, _INSIDE * lower), upper / _INSIDE)
        if knob.name == "transit" and np.isfinite(self.band[1]):  # within the band, its resonance has a law of its own
            upper = min(upper, _QUARTER / self.band[1])
            lower, null = min(lower, upper / 10), min(null, upper / 2)
        return replace(knob, unit=unit, typical=knob.typical * scale, lower=lower, upper=upper, null=null, prior=prior)

    def _scale(self, name: str) -> tuple[float, str]:
        """Return the value of a parameter for which the law has 1, and its unit."""
        period = 1 / self.reference
        scales = {
            "size": (self.natural, self.unit),
            "at": (self.reference, "Hz"),
            "delay": (period, "s"),
            "transit": (period, "s"),
        }
        return scales.get(name.partition("_")[0], (1.0, "1"))

    def sentence(self, where: str, sizes: Mapping[str, tuple[float, float, str]]) -> str:
        """Return the sentence on the learned law, with its numbers."""
        return f"{in_words(self.place, self.law, sizes)}. No effect of the catalogue says so."

    def dimensionless(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the parameters in the law's units."""
        return {name: value / self._scale(name)[0] for name, value in values.items()}

    def physical(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return parameters in the law's units in SI units."""
        return {name: value * self._scale(name)[0] for name, value in values.items()}

    def correction(self, values: Mapping[str, float]) -> Correction:
        """Return the correction with these parameters as a function of frequency in Hz."""
        own, f0, of = self.dimensionless(values), self.reference, self.law.of
        return lambda frequency: of(np.asarray(frequency / f0, np.float64), own)

    def drawn(
        self, values: Mapping[str, float], device: Assembly, swept: Frequencies, most: int
    ) -> tuple[Frequencies, Complexes]:
        """Return the correction with these parameters at so many frequencies of its band."""
        frequency = np.geomspace(*self.band, most)
        return frequency, self.correction(values)(frequency)

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return what the correction is in the terms of a workshop."""
        return equivalents(self.place, self.law, self.reference, values)

    def added_losses(self, where: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the loss of the law at its reference, if it corrects a constant."""
        if self.place.constant is None or self.law.taken is None:
            return {}
        return {self.place.constant: self.law.taken(self.dimensionless(values)).imag}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the correction."""
        if all(values[knob.name] <= 0 for knob in self.law.parameters if knob.from_nothing):
            return assembly
        g = self.correction(values)
        if self.stage == Stage.SHARES:
            return corrected_on_part(assembly, self.place, g, values[SHARE])
        return corrected(assembly, self.place, g)


def law_name(place: Place, law: Law) -> str:
    """Return what a law corrects, and its own name: `permittivity-debye`, `series-resistance-and-inertance`."""
    return f"{place.quantity}-{'-and-'.join(terms_of(law.name))}"


def in_words(place: Place, law: Law, sizes: Mapping[str, tuple[float, float, str]]) -> str:
    """Return what a law says of a place, with its numbers, without a full stop."""
    numbers = {name: f"{with_uncertainty(value, u)}{_unit(unit)}" for name, (value, u, unit) in sizes.items()}
    says = law.says.format(**{knob.name: numbers.get(knob.name, "?") for knob in law.parameters})
    others = [f"{name.replace('_', ' ')} {numbers[name]}" for name in _IN_WORDS if name in numbers]
    verb = "" if place.quantity in CONSTANTS else "has "
    more = f" ({', '.join(others)})" if others else ""
    return f"{place.says[0].upper()}{place.says[1:]} {verb}{says}{more}"


_OVER_OMEGA, _TIMES_OMEGA, _INVERSE = "size over omega", "size times omega", "one over omega times size"
_EQUIVALENTS: Mapping[tuple[str, str], tuple[str, str, str]] = {
    ("series", "inertance"): ("inductance", "H", _OVER_OMEGA),
    ("series", "compliance"): ("capacitance", "F", _INVERSE),
    ("shunt", "inertance"): ("capacitance", "F", _OVER_OMEGA),
    ("shunt", "compliance"): ("inductance", "H", _INVERSE),
    ("impedance", "inertance"): ("mass", "kg/m2", _OVER_OMEGA),
    ("impedance", "part-inertance"): ("mass", "kg/m2", _OVER_OMEGA),
    ("impedance", "layer"): ("mass", "kg/m2", _OVER_OMEGA),
    ("impedance", "compliance"): ("stiffness", "Pa/m", _TIMES_OMEGA),
    ("inertia", "inertance"): ("mass", "kg/m2", _OVER_OMEGA),
    ("inertia", "layer"): ("mass", "kg/m2", _OVER_OMEGA),
    ("compliance", "inertance"): ("compliance", "m/Pa", _OVER_OMEGA),
}
"""Quantity and law: name and unit of what it is in the terms of a workshop, and how its size is converted."""
_DEPTH = "depth_in_water"
_IN_WORDS = ("inductance", "capacitance", "mass", "stiffness", "compliance", _DEPTH)


def equivalents(place: Place, law: Law, reference: float, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    """Return inductance, capacitance, mass, stiffness or depth in water that a correction is, with its unit.

    `values`: the law's parameters, SI units. An echo on a face comes from half its delay times the speed of sound.
    """
    if "delay" in values and place.where in FACES:
        return {_DEPTH: (WATER * values["delay"] / 2, "m")}
    omega, found = 2 * np.pi * reference, dict[str, tuple[float, str]]()
    for k, name in enumerate(terms_of(law.name), 1):
        size = values.get(numbered("size", k), 0.0)
        if (place.quantity, name) in _EQUIVALENTS and size > 0:
            says, unit, how = _EQUIVALENTS[place.quantity, name]
            converted = {_OVER_OMEGA: size / omega, _TIMES_OMEGA: size * omega, _INVERSE: 1 / (omega * size)}
            found[says] = converted[how], unit
    return found


def learned_law(place: Place, name: str, stack: Stack, reference: float = 0.0, number: int = 1) -> LearnedLaw:
    """Return the effect of a law at a place of a stack. Raises PzctlError for an unknown law."""
    return LearnedLaw(place, find_law(place, name), stack, reference, number=number)


def find_law(place: Place, name: str) -> Law:
    """Return a law that the quantity of a place may follow. Raises PzctlError."""
    known = {law.name: law for law in (*laws(place.quantity), *laws_of_parts(place.quantity))}
    several = {law.name: law for law in laws_of_several(place.quantity)}
    if name in several:
        return several[name]
    if is_rational(name):
        return sum_named(place, name)
    if name not in known:
        found = f"there is no law {name!r}" if name else "no law is named"
        raise PzctlError(f"{place.where}: {found} for {place.says}; {among(name, list(known))}")
    return known[name]
