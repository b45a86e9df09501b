"""A device as effects change it: stacks side by side, further resonances, the path to the analyzer, the sweep itself.

What an effect does falls into four stages, in the order in which the world has them. An effect of the layers changes
the stacks (a layer more, part of the face elsewhere); a further resonance adds admittance; an effect of the terminals
maps Z to what the analyzer sees; an effect of the sweep maps it to what was recorded while time went by.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ...stack import Stack, parallel_admittance


@dataclass(frozen=True)
class Conditions:
    """How a sweep ran, as far as effects of the sweep depend on it."""

    direction: str = "up"
    """`up` or `down`."""
    level_V: float = 0.5
    """Oscillator level."""
    began: float = 0.0
    """When it began after the first sweep of this step, in lengths of that one."""
    length: float = 1.0
    """How long it took, in lengths of the step's first sweep."""
    pace: float = 1.0
    """Hertz per second, in those of the step's first sweep."""

    def elapsed(self, points: int) -> Reals:
        """Return the time of each point since the first sweep of the step began, in lengths of that one, shape (N,).

        In rising frequency: from beginning to end for a sweep upwards, the other way round for one downwards.
        """
        part = np.linspace(0.0, 1.0, points)
        return self.began + self.length * (part if self.direction == "up" else part[::-1])


@dataclass(frozen=True)
class ParallelSection:
    """A share of the face and the stack that stands there."""

    fraction: float
    stack: Stack
    """Over the whole area; `fraction` says how much of it counts."""
    scale: Mapping[str, float] = field(default_factory=dict[str, float])
    """d (parameter of this stack) / d (parameter of the device) where it is not 1."""
    linked_parameters: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    """Parameters of this stack that move with one of the device: a layer that an effect has cut in two."""

    def moved_by(self, names: Sequence[str]) -> list[tuple[int, str, float]]:
        """Return (position in `names`, parameter of this stack, its derivative) for all that the names move here."""
        own = self.stack.parameters()
        return [
            (k, moved, self.scale.get(moved, 1.0))
            for k, name in enumerate(names)
            for moved in (name, *self.linked_parameters.get(name, ()))
            if moved in own
        ]


Terminal = Callable[[Complexes, Impedances], tuple[Impedances, Complexes]]
"""(jw, Z) to what is seen from further out, and its derivative by Z; shapes (N,)."""

Shunt = Callable[[Complexes], Complexes]
"""jw to an admittance that stands beside the device, siemens, shape (N,)."""


@dataclass(frozen=True)
class Assembly:
    """The device with its effects, ready to be evaluated."""

    parts: tuple[ParallelSection, ...]
    nominal: Stack
    """The stack to which the first effect was added: it gives effects their scales, which no fit moves."""
    shunts: tuple[Shunt, ...] = ()
    terminals: tuple[Terminal, ...] = ()
    records: tuple["Record", ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    conjugated: bool = False
    """Whether Z is written down with the sign of its reactance turned."""
    _known: list[tuple[object, object, Frequencies, Complexes]] = field(
        default_factory=list[tuple[object, object, Frequencies, Complexes]], compare=False
    )
    """The last admittance, and of which parts and shunts and where: what changes only further out has the same."""
    _known_beside: list[tuple[object, Frequencies, Complexes]] = field(
        default_factory=list[tuple[object, Frequencies, Complexes]], compare=False
    )
    """The last admittance of all shunts, and of which and where: a drifting device has the same."""

    @property
    def stack(self) -> Stack:
        """The stack on the largest part of the face."""
        return max(self.parts, key=lambda part: part.fraction).stack

    def each_stack(self, change: Callable[[Stack], Stack]) -> Self:
        """Return the assembly with every stack changed."""
        return replace(self, parts=tuple(replace(part, stack=change(part.stack)) for part in self.parts))

    def split(self, change: Callable[[ParallelSection], Sequence[ParallelSection]]) -> Self:
        """Return the assembly with every part of the face split into several."""
        return replace(self, parts=tuple(made for part in self.parts for made in change(part)))

    def beside(self, shunt: Shunt) -> Self:
        """Return the assembly with an admittance beside the device."""
        return replace(self, shunts=(*self.shunts, shunt))

    def behind(self, terminal: Terminal) -> Self:
        """Return the assembly as seen from further out."""
        return replace(self, terminals=(*self.terminals, terminal))

    def recorded(self, record: "Record") -> Self:
        """Return the assembly as a sweep of this kind records it."""
        return replace(self, records=(*self.records, record))

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return what is recorded, ohm, shape (N,)."""
        return self.while_recorded(frequency, self.steady(frequency))

    def while_recorded(self, frequency: Frequencies, steady: Impedances) -> Impedances:
        """Return what is recorded of a device whose steady impedance is known."""
        seen = steady
        for record in self.records:
            seen = record(self, frequency, seen)
        return np.conj(seen) if self.conjugated else seen

    def steady(self, frequency: Frequencies) -> Impedances:
        """Return what a sweep without end would record: all stages but the last, ohm, shape (N,)."""
        jw = j_omega(frequency)
        seen: Impedances = 1 / self._admittance(frequency, jw)
        for terminal in self.terminals:
            seen, _ = terminal(jw, seen)
        return seen

    def _admittance(self, frequency: Frequencies, jw: Complexes) -> Complexes:
        """Return the admittance behind the terminals, S, shape (N,)."""
        for parts, shunts, where, known in self._known:
            if parts is self.parts and shunts is self.shunts and where is frequency:
                return known
        admittance = self._beside(frequency, jw).copy()
        stacks, fractions = [part.stack for part in self.parts], [part.fraction for part in self.parts]
        admittance += parallel_admittance(stacks, fractions, frequency)
        if not frequency.flags.writeable:  # a recording's: it stays what it is
            self._known[:] = [(self.parts, self.shunts, frequency, admittance)]
        return admittance

    def _beside(self, frequency: Frequencies, jw: Complexes) -> Complexes:
        """Return the admittance of all shunts, S, shape (N,)."""
        for shunts, where, known in self._known_beside:
            if shunts is self.shunts and where is frequency:
                return known
        beside = sum((shunt(jw) for shunt in self.shunts), np.zeros_like(jw))
        if not frequency.flags.writeable:
            self._known_beside[:] = [(self.shunts, frequency, beside)]
        return beside

    def steady_jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return the same and d ln Z / d parameter of the stack, shape (P, N); 0 for a name no stack has."""
        jw = j_omega(frequency)
        admittance = self._beside(frequency, jw).copy()
        slope = np.zeros((len(names), frequency.size), np.complex128)
        for part in self.parts:
            moved = part.moved_by(names)
            Z, dlnZ = part.stack.jacobian(frequency, [name for _, name, _ in moved])
            admittance += part.fraction / Z
            for row, (k, _, scale) in zip(dlnZ, moved, strict=True):
                slope[k] -= part.fraction * scale / Z * row
        seen: Impedances = 1 / admittance
        slope *= -(seen**2)
        for terminal in self.terminals:
            seen, through = terminal(jw, seen)
            slope *= through
        return seen, slope / seen


Record = Callable[[Assembly, Frequencies, Impedances], Impedances]
"""(device, Hz, steady Z) to what is recorded while the sweep runs; shapes (N,)."""
