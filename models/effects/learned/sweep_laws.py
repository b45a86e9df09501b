"""Laws of a sweep: constants of a piezoelectric layer that change with time, or with the strain that the sweep drives.

They belong to what was recorded, not to the sample alone, so that no build states them.
"""

from collections.abc import Mapping

import numpy as np

from ...base.arrays import Complexes, Frequencies, Reals
from ...stack import Piezo, Stack
from ..base.assembly import Assembly
from ..base.drifting import Drifting
from ..base.effect import EffectParameter, Stage, layer_at
from ..base.softening import LOSS_AND_SOURCE, Softening
from .corrections import CONSTANTS, Place, Quantity
from .laws import Law, Values
from .learned import LearnedLaw

REFERENCE_STRAIN = 1e-5
"""Amplitude of the mean strain at which a softening has its size: half a volt drives a soft disk to about twice that at
its resonance."""
_CHANGE = EffectParameter("size", "1", typical=1e-3, lower=-0.2, upper=0.2, prior=(0.0, 3e-3))
"""Of the permittivity of a soft ceramic, half a kelvin."""


def _drifted(t: Reals, values: Values) -> Complexes:
    return np.asarray(values["size"] * t, np.complex128)


def _settled(t: Reals, values: Values) -> Complexes:
    return np.asarray(-values["size"] * np.expm1(-t / values["time"]), np.complex128)


def _softened(x: Reals, values: Values) -> Complexes:
    """Return the softening by strains `x` in units of the reference strain."""
    return np.asarray(-values["size"] * x ** values["exponent"] * (1 - 1j * values["loss"]), np.complex128)


IN_TIME = (
    Law("drift", (_CHANGE,), _drifted, "drifts by {size} in the duration of the first sweep"),
    Law(
        "settling",
        (_CHANGE, EffectParameter("time", "1", typical=1.0, lower=0.1, upper=10.0, null=1.0)),
        _settled,
        "settles by {size}, with a time constant of {time} durations of the first sweep",
    ),
)
"""Relative changes of a constant over the time since the step's first sweep began, in durations of that sweep."""
IN_STRAIN = (
    Law(
        "softening",
        (
            EffectParameter("size", "1", typical=1e-3, upper=0.3, prior=(3e-3, 1.6)),
            EffectParameter("exponent", "1", typical=0.5, lower=0.5, upper=3.0, null=1.0),
            *LOSS_AND_SOURCE,
        ),
        _softened,
        "falls by {size} at a strain of 1e-5, as the strain to the power {exponent}, with {loss} times as much loss",
    ),
)
"""Relative changes of a stiffness with the amplitude of the mean strain; by Rayleigh's law the exponent is 1."""


def laws_of_sweeps(quantity: Quantity) -> tuple[Law, ...]:
    """Return the laws of a sweep that a quantity may follow, simplest first."""
    if quantity not in CONSTANTS:
        return ()
    return (*IN_TIME, *IN_STRAIN) if quantity == "stiffness" else IN_TIME


def swept_places(stack: Stack) -> tuple[tuple[Place, Law], ...]:
    """Return every law of a sweep with its place; the strain is known of a single piezoelectric layer only."""
    piezos = [f"layer:{layer.name}" for layer in stack.layers if isinstance(layer, Piezo)]
    every = ((Place(where, name), law) for where in piezos for name in CONSTANTS for law in laws_of_sweeps(name))
    return tuple(one for one in every if len(piezos) == 1 or one[1] not in IN_STRAIN)


class SweepLaw(LearnedLaw):
    """A constant that changes by one of these laws."""

    separates = "sweep up and down, at several levels, and again when nothing changes any more"
    references = ("Hall, J. Mater. Sci. 36 (2001) 4575 (Rayleigh's law in ferroelectrics)",)

    def __init__(self, place: Place, law: Law, stack: Stack, number: int = 1) -> None:
        """Make the effect; `number`: which of the learned laws at its place it is."""
        super().__init__(place, law, stack, number=number)
        self.stage = Stage.ACQUISITION

    def in_stack(self, stack: Stack) -> "SweepLaw":
        """Return the same law in another stack."""
        return SweepLaw(self.place, self.law, stack, self.number)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the parameters of the law; they have no scale of the stack's."""
        return self.law.parameters

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by a sweep meanwhile."""
        return assembly.recorded(self._record(values)) if values["size"] != 0 else assembly

    def drawn(
        self, values: Mapping[str, float], device: Assembly, swept: Frequencies, most: int
    ) -> tuple[Frequencies, Complexes]:
        """Return the relative change of the constant at so many points of a sweep, at most."""
        at = np.unique(np.linspace(0, swept.size - 1, most).astype(int))
        return swept[at], self._record(values).relative(device, swept)[at]

    def _record(self, values: Mapping[str, float]) -> "Drifting | Softening":
        layer, own = layer_at(self.place.where), dict(values)
        if self.law in IN_STRAIN:
            power = own["exponent"]
            return Softening(layer, own["size"] / REFERENCE_STRAIN**power, own["loss"], own["source"], power)
        return Drifting(layer, {self.place.quantity: lambda t: np.real(self.law.of(t, own))})
