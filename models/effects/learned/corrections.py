"""Places at which a function of frequency can correct a device.

Every correction is a dimensionless function g(f): a constant, or the reading of the instrument, becomes M (1 + g), and
an impedance or admittance g times its natural size is added to a path, a face or an interface.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances
from ...base.face_loads import FACES
from ...stack import Elastic, Piezo, Stack
from ...stack.layers import Gradient
from ...stack.loads import AnyLoad, Load
from ...stack.lumps import Gap, Weight
from ...stack.row import Joins
from ...stack.stack import Layer
from ..base.added_layer import with_layer_between
from ..base.assembly import Assembly, Reading
from ..base.effect import TERMINALS, Stage, interface_at, interfaces, layer_at
from ..base.modified_laws import Multiple, with_stiffness_law
from ..base.modified_loads import CorrectedLoad, SupportedLoad, is_backing
from ..base.scale import acoustic_impedance, reactance

OfSample = Literal[
    "stiffness", "permittivity", "coupling", "compliance", "inertia", "impedance", "load", "series", "shunt"
]
"""Quantities of a device and its leads, which a build can state."""
Quantity = OfSample | Literal["reading"]
Correction = Callable[[Frequencies], Complexes]
"""Maps Hz, shape (N,), to the dimensionless correction, shape (N,)."""

CONSTANTS = ("stiffness", "permittivity", "coupling")
"""Constants of a layer, which are corrected by a factor that is 1 at the reference.

The load of a face is corrected by a factor as well; the other quantities have an impedance or an admittance added.
"""
_SYMBOLS: Mapping[str, str] = {"stiffness": "c33D", "permittivity": "eps33S", "coupling": "h33"}


@dataclass(frozen=True)
class Place:
    """A quantity of a device that can be corrected."""

    where: str
    quantity: Quantity

    @property
    def stage(self) -> Stage:
        """The stage at which the correction acts."""
        if self.quantity in CONSTANTS:
            return Stage.CONSTANTS
        if self.quantity == "reading":
            return Stage.ACQUISITION
        return Stage.TERMINALS if self.where == TERMINALS else Stage.LAYERS

    @property
    def constant(self) -> str | None:
        """The constant that is corrected, as a fit names it (`disk.c33D`); None if it is no constant of a layer."""
        symbol = _SYMBOLS.get(self.quantity)
        return None if symbol is None else f"{layer_at(self.where)}.{symbol}"

    @property
    def says(self) -> str:
        """The quantity in words."""
        return _SAYS[self.quantity].format(where=self.where.partition(":")[2].replace("|", " and ") or self.where)


_SAYS: Mapping[Quantity, str] = {
    "stiffness": "the stiffness of {where}",
    "permittivity": "the permittivity of {where}",
    "coupling": "the piezoelectric coupling of {where}",
    "compliance": "the compliance between {where}",
    "inertia": "the mass between {where}",
    "impedance": "the acoustic load of the {where}",
    "load": "the backing at the {where}",
    "series": "the impedance in series with the device",
    "shunt": "the admittance across the device",
    "reading": "the reading of the instrument",
}


INSTRUMENT = Place("instrument", "reading")
"""The impedance that the instrument reads, whatever device it is: no place of a stack."""


def natural_size(stack: Stack, quantity: Quantity) -> tuple[float, str]:
    """Return the impedance or admittance that a correction of 1 adds, and its unit; 1 for a constant's factor."""
    sizes: Mapping[Quantity, tuple[float, str]] = {
        "series": (reactance(stack), "ohm"),
        "shunt": (1 / reactance(stack), "S"),
        "impedance": (acoustic_impedance(stack), "Rayl"),
        "inertia": (acoustic_impedance(stack), "Rayl"),
        "compliance": (1 / acoustic_impedance(stack), "1/Rayl"),
    }
    return sizes.get(quantity, (1.0, "1"))


def places(stack: Stack) -> tuple[Place, ...]:
    """Return every place of a stack at which a correction can act."""
    found: list[Place] = []
    for layer in stack.layers:
        if isinstance(layer, Piezo):
            found += [Place(f"layer:{layer.name}", quantity) for quantity in CONSTANTS]
        elif isinstance(layer, Elastic):
            found.append(Place(f"layer:{layer.name}", "stiffness"))
    for where in interfaces(stack):
        found += [Place(where, "compliance"), Place(where, "inertia")]
    found += [Place(where, "impedance") for where in FACES]
    found += [Place(where, "load") for where in FACES if is_backing(load_at(stack, where))]
    return (*found, Place(TERMINALS, "series"), Place(TERMINALS, "shunt"))


def load_at(stack: Stack, where: str) -> Load:
    """Return the load of `face:back` or `face:front`."""
    return stack.back if where == FACES[0] else stack.front


def corrected(assembly: Assembly, place: Place, g: Correction) -> Assembly:
    """Return the device with this correction."""
    if place.quantity == "reading":
        return assembly.recorded(Reading(lambda frequency: 1 + g(frequency)))
    if place.quantity == "series":
        z0 = reactance(assembly.nominal)
        return assembly.behind(lambda jw, Z: (Z + z0 * g(jw.imag / (2 * np.pi)), np.ones_like(Z)))
    if place.quantity == "shunt":
        return assembly.behind(_across(reactance(assembly.nominal), g))
    if place.where in FACES:
        return assembly.each_stack(partial(_with_load, place=place, size=acoustic_impedance(assembly.nominal), g=g))
    if place.quantity in CONSTANTS:
        return assembly.each_stack(lambda stack: _with_constant(stack, place, g))
    size = acoustic_impedance(assembly.nominal)
    _, before = interface_at(place.where)

    def joined(stack: Stack) -> Stack:
        if before not in {layer.name for layer in stack.layers}:
            return stack
        others = sum(isinstance(layer, CorrectedInterface) for layer in stack.layers)
        part = CorrectedInterface(place.quantity == "compliance", size, g, f"correction {others + 1}")
        return with_layer_between(stack, place.where, part)

    return assembly.each_stack(joined)


def _with_load(stack: Stack, place: Place, size: float, g: Correction) -> Stack:
    """Return a stack with one of its loads corrected by a factor, or with an impedance g times `size` in Rayl added."""
    load = load_at(stack, place.where)
    if place.quantity == "load":
        made: Load = CorrectedLoad(load, g)
    else:
        made = SupportedLoad(load, AnyLoad("correction", lambda f: np.asarray(size * g(f), np.complex128)))
    return replace(stack, **{place.where.partition(":")[2]: made})


def _across(z0: float, g: Correction) -> Callable[[Complexes, Impedances], tuple[Impedances, Complexes]]:
    def shunt(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
        share = 1 / (1 + Z * g(jw.imag / (2 * np.pi)) / z0)
        return Z * share, share**2

    return shunt


def _with_constant(stack: Stack, place: Place, g: Correction) -> Stack:
    name = layer_at(place.where)
    if place.quantity == "stiffness":
        return with_stiffness_law(stack, name, lambda law: CorrectedLaw(law, g))

    def corrected_layer(layer: Layer) -> Layer:
        if layer.name != name or not isinstance(layer, Piezo):
            return layer
        if place.quantity == "coupling":
            return replace(layer, h_law=CorrectedLaw(layer.h_law, g))
        return replace(layer, eps_law=CorrectedLaw(layer.eps_law, g))

    return replace(stack, layers=tuple(map(corrected_layer, stack.layers)))


@dataclass(frozen=True)
class CorrectedLaw(Multiple):
    """A law times 1 + g(f)."""

    g: Correction

    def factor_at(self, frequency: Frequencies) -> Complexes:
        """Return 1 + g, shape (N,)."""
        return 1 + self.g(frequency)


@dataclass(frozen=True)
class CorrectedInterface(Joins):
    """An interface without thickness that is compliant (`compliant`) or has mass, as a function of frequency."""

    compliant: bool
    size: float
    """Rayl."""
    g: Correction
    name: str

    def parameters(self) -> dict[str, float]:
        """Return nothing: the function's parameters belong to an effect."""
        return {}

    def replace(self, values: Mapping[str, float]) -> "CorrectedInterface":
        """Return the interface itself: it has no parameter."""
        return self

    def gradients(self, frequency: Frequencies) -> Mapping[str, Gradient]:
        """Return nothing."""
        return {}

    def section(self, jw: Complexes) -> Gap | Weight:
        """Return the interface at angular frequencies jw (rad/s, times j), shape (N,)."""
        g = self.g(jw.imag / (2 * np.pi))
        return Gap(g / self.size) if self.compliant else Weight(jw, self.size * g)
