"""A piezoelectric layer whose constants change while the sweep runs."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Complexes, Frequencies, Reals
from ...stack import Piezo, Stack
from .assembly import Assembly, ParallelSection, Record
from .modified_laws import Factor

Course = Callable[[Reals], Reals]
"""Maps times since the step's first sweep began, in durations of that sweep, shape (N,), to a relative change, (N,)."""
_LAWS: Mapping[str, str] = {"stiffness": "c_law", "permittivity": "eps_law", "coupling": "h_law"}


@dataclass(frozen=True, eq=False)
class Drifting(Record):
    """Every point is that of a device at its own instant: constants that depend on frequency in this sweep."""

    layer: str
    courses: Mapping[str, Course]
    """By constant: `stiffness`, `permittivity`, `coupling`."""

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return Z as recorded over Z, shape (N,)."""
        steady = device.steady(frequency)
        return self._moved(device, frequency).steady(frequency) / steady

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter, shape (P, N)."""
        return self._moved(device, frequency).steady_jacobian(frequency, names)[1] - at_rest

    def relative(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the sum of the relative changes at each point, shape (N,)."""
        elapsed = device.conditions.elapsed(frequency.size)
        return np.asarray(sum(course(elapsed) for course in self.courses.values()), np.complex128)

    def _moved(self, device: Assembly, frequency: Frequencies) -> Assembly:
        """Return the device with what its constants are at each point."""
        elapsed = device.conditions.elapsed(frequency.size)
        factors = {_LAWS[name]: np.asarray(1 + course(elapsed), np.complex128) for name, course in self.courses.items()}
        return at_each_point(device, self.layer, factors)


def at_each_point(device: Assembly, layer: str, factors: Mapping[str, Complexes]) -> Assembly:
    """Return the device with laws of a piezoelectric layer (`c_law` ...) times these factors, shape (N,)."""
    stiffness = f"{layer}.c33D.re"

    def moved(part: ParallelSection) -> ParallelSection:
        # a layer that an effect has cut in two changes as a whole
        own = {name.partition(".")[0] for _, name, _ in part.moved_by([stiffness])}
        return replace(part, stack=_with_factors(part.stack, own, factors))

    return device.with_parts(tuple(map(moved, device.parts)))


def _with_factors(stack: Stack, names: Collection[str], factors: Mapping[str, Complexes]) -> Stack:
    """Return a stack whose piezoelectric layers of these names have laws times these factors, shape (N,)."""
    layers = (
        replace(layer, **{law: Factor(getattr(layer, law), factor) for law, factor in factors.items()})
        if isinstance(layer, Piezo) and layer.name in names
        else layer
        for layer in stack.layers
    )
    return replace(stack, layers=tuple(layers))
