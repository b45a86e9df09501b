"""A device as changed by effects: parallel stacks, additional resonances, the path to the analyzer, the sweep itself.

Effects act in four stages, from the inside outwards. An effect of the layers changes the stacks (an additional layer,
different parts of the face); an additional resonance adds admittance; an effect of the terminals maps Z to what the
analyzer sees; an effect of the sweep maps that to what is recorded over time.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, Self, runtime_checkable

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ...base.copies import changed
from ...base.face_loads import HasFaces, Load
from ...base.model import Model
from ...stack import LossLaw, Stack, Strips
from ...stack.loss_laws import ComplexLike, LawKind
from .last_made import LastMade


@dataclass(frozen=True)
class Conditions:
    """Conditions of a sweep, for effects that depend on them."""

    direction: str = "up"
    """`up` or `down`."""
    level_V: float = 0.5
    """Oscillator level."""
    began: float = 0.0
    """Start time after the first sweep of this step, in durations of that sweep."""
    length: float = 1.0
    """Duration, in durations of the step's first sweep."""
    pace: float = 1.0
    """Hertz per second, relative to the step's first sweep."""
    points: tuple[float, ...] | None = None
    """Part of the sweep below each point, for a recording of which only some points are left; None: evenly spaced."""

    def passed(self, points: int) -> Reals:
        """Return which part of the sweep is below each of these points, from 0 to 1, shape (N,)."""
        return np.linspace(0.0, 1.0, points) if self.points is None else np.array(self.points)

    def elapsed(self, points: int) -> Reals:
        """Return the time of each point since the step's first sweep began, in durations of that sweep, shape (N,).

        In order of frequency: from beginning to end for an upward sweep, the other way round for a downward one.
        """
        part = self.passed(points)
        return self.began + self.length * (part if self.direction == "up" else 1 - part)

    def rate(self, frequency: Frequencies) -> Reals:
        """Return df/dt at each point over its mean, shape (N,): equal times for points that are not evenly spaced."""
        part = self.passed(frequency.size)
        rates = np.gradient(frequency, part)
        return np.asarray(rates / np.average(rates, weights=np.gradient(part)), np.float64)


PartSlope = tuple[float, Mapping[str, float]]
"""Derivatives by a parameter of an effect: of a part's fraction of the face, and of parameters of the stack there."""

_NONE: Mapping[str, float] = {}
_FIXED: PartSlope = (0.0, _NONE)


@dataclass(frozen=True)
class ParallelSection:
    """A part of the face, with the stack on it."""

    fraction: float
    stack: Stack
    """Stack over the whole area; `fraction` is its weight."""
    scale: Mapping[str, float] = field(default_factory=dict[str, float])
    """d (parameter of this stack) / d (parameter of the device), if it is not 1."""
    linked_parameters: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    """Parameters of this stack that change with one of the device, for a layer that an effect has cut in two."""
    strips: Strips | None = None
    """Distribution of a layer's thickness over this part."""
    by_effects: Mapping[str, PartSlope] = field(default_factory=dict[str, PartSlope])
    """Exact derivatives by parameters of effects that divide the face."""

    def share(self, part: float, slopes: Mapping[str, float] = _NONE) -> Self:
        """Return a part of this part; `slopes`: derivatives of `part` by parameters of the effect that divides it."""
        before = {name: (slope * part, moved) for name, (slope, moved) in self.by_effects.items()}
        own = {name: (self.fraction * slope, dict[str, float]()) for name, slope in slopes.items()}
        return changed(self, fraction=self.fraction * part, by_effects={**before, **own})

    def moving(self, slopes: Mapping[str, Mapping[str, float]]) -> Self:
        """Return the part with derivatives of parameters of its stack by parameters of an effect."""
        of_fraction = {name: self.by_effects.get(name, _FIXED)[0] for name in slopes}
        own = {name: (of_fraction[name], moved) for name, moved in slopes.items()}
        return changed(self, by_effects={**self.by_effects, **own})

    def moved_by(self, names: Sequence[str]) -> list[tuple[int, str, float]]:
        """Return (position in `names`, parameter of this part, its derivative) for all that `names` change."""
        own, of_strips = self.stack.names, () if self.strips is None else self.strips.moved_by
        return [
            (k, moved, self.scale.get(moved, 1.0))
            for k, name in enumerate(names)
            for moved in (name, *self.linked_parameters.get(name, ()))
            if moved in own or moved in of_strips
        ]

    @property
    def shaped_by(self) -> Collection[str]:
        """Parameters of effects that divide the face, and of the distribution of thickness."""
        return {*self.by_effects, *(() if self.strips is None else self.strips.moved_by)}

    def each_strip(self) -> "Sequence[ParallelSection]":
        """Return the strips as parts of their own."""
        if self.strips is None:
            return (self,)
        name = f"{self.strips.layer}.thickness"
        t, own = self.stack.parameters()[name], self.scale.get(name, 1.0)
        shaped = {key: derivatives() for key, derivatives in self.strips.moved_by.items()}
        made: list[ParallelSection] = []
        for k, (factor, fraction) in enumerate(zip(self.strips.factors, self.strips.fractions, strict=True)):
            of_shape = {key: (factors[k], fractions[k]) for key, (factors, fractions) in shaped.items()}
            part = self.share(float(fraction), {key: float(slope) for key, (_, slope) in of_shape.items()})
            slopes = {
                key: {one: slope * (float(factor) if one == name else 1.0) for one, slope in moved.items()}
                for key, (_, moved) in self.by_effects.items()
            }
            part = part.moving({**slopes, **{key: {name: t * float(slope)} for key, (slope, _) in of_shape.items()}})
            scale = {**self.scale, name: own * float(factor)}
            made.append(changed(part, stack=self.stack.replace({name: t * factor}), scale=scale, strips=None))
        return made

    def admittance(self, frequency: Frequencies) -> Complexes:
        """Return its share of the admittance, S, shape (N,)."""
        if self.strips is None:
            return self.fraction / self.stack.impedance(frequency)
        return self.fraction * self.strips.admittance(self.stack, frequency)

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Complexes, Complexes]:
        """Return the same, and d Y / d parameter of the device, shape (P, N); 0 for what does not change it."""
        by_effects = {k: self.by_effects[name] for k, name in enumerate(names) if name in self.by_effects}
        moved = self.moved_by(names)
        there = self.stack.names  # a void may have cut off what an effect has added
        moved += [(k, one, slope) for k, (_, of) in by_effects.items() for one, slope in of.items() if one in there]
        own = list(dict.fromkeys(name for _, name, _ in moved))
        if self.strips is None:
            Z, dlnZ = self.stack.jacobian(frequency, own)
            whole, slopes = 1 / Z, -dlnZ / Z
        else:
            whole, slopes = self.strips.jacobian(self.stack, frequency, own)
        by_name = np.zeros((len(names), frequency.size), np.complex128)
        rows = dict(zip(own, slopes, strict=True))
        for k, name, scale in moved:
            by_name[k] += self.fraction * scale * rows[name]
        for k, (of_fraction, _) in by_effects.items():
            by_name[k] += of_fraction * whole
        return self.fraction * whole, by_name


@runtime_checkable
class HasLaws(Protocol):
    """A model that is no stack, with laws of stiffness and permittivity that an effect may bend."""

    def with_law(self, layer: str, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Model:
        """Return the model with one law of this layer changed; itself if it has no such layer."""
        ...


@runtime_checkable
class HasLawSlopes(HasLaws, Protocol):
    """Such a model that knows its derivatives by its constants at each frequency, so that those by its laws follow."""

    def moved_by_laws(self, frequency: Frequencies, other: Model) -> Complexes:
        """Return ln Z of a model with slightly different laws less that of this one, to first order, shape (N,)."""
        ...


Terminal = Callable[[Complexes, Impedances], tuple[Impedances, Complexes]]
"""Maps (jw, Z) to the impedance seen from further out, and its derivative by Z; shapes (N,)."""

Shunt = Callable[[Complexes], Complexes]
"""Maps jw to an admittance in parallel with the device, siemens, shape (N,)."""


@dataclass(frozen=True)
class Assembly:
    """The device with its effects, ready to be evaluated."""

    parts: tuple[ParallelSection, ...]
    """None for a device that is no stack."""
    nominal: Stack
    """The stack to which the first effect was added; it defines the scales of effects, which no fit changes."""
    whole: Model | None = None
    """A device that is no stack: a disk, an equivalent circuit."""
    shunts: tuple[Shunt, ...] = ()
    terminals: tuple[Terminal, ...] = ()
    records: tuple["Record", ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    conjugated: bool = False
    """Whether the recorded Z has the sign of its reactance inverted."""
    _known: list[tuple[object, object, Frequencies, Complexes]] = field(
        default_factory=list[tuple[object, object, Frequencies, Complexes]], compare=False
    )
    """Cache of two admittances, keyed by (parts, whole, frequency), the last one used first.

    Reused by what acts outside, and by changes, each of which is that of another device relative to the same one.
    """
    _known_beside: list[tuple[object, Frequencies, Complexes]] = field(
        default_factory=list[tuple[object, Frequencies, Complexes]], compare=False
    )
    """One-entry cache of the admittance of all shunts, keyed by (shunts, frequency); reused for a drifting device."""
    _known_steady: list[tuple[tuple[object, ...], Impedances]] = field(
        default_factory=list[tuple[tuple[object, ...], Impedances]], compare=False
    )
    """Cache of two steady impedances, keyed by (parts, whole, shunts, terminals, frequency), the last one used first.

    Changes are relative to the same device, and what records a device asks for its steady impedance again.
    """

    @property
    def stack(self) -> Stack:
        """The stack on the largest part of the face."""
        return max(self.parts, key=lambda part: part.fraction).stack

    def each_stack(self, change: Callable[[Stack], Stack]) -> Self:
        """Return the assembly with every stack changed."""
        return changed(self, parts=tuple(changed(part, stack=change(part.stack)) for part in self.parts))

    def with_parts(self, parts: tuple[ParallelSection, ...]) -> Self:
        """Return the assembly with other parts, and a memory of its own."""
        return changed(self, parts=parts, _known=[], _known_steady=[])

    @property
    def shaped_by(self) -> frozenset[str]:
        """Parameters of effects by which `steady_jacobian` gives derivatives, too."""
        return frozenset(name for part in self.parts for name in part.shaped_by)

    def each_law(self, layer: str, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Self:
        """Return the assembly with one law of a layer changed, if the device is no stack (else see `each_stack`)."""
        if self.whole is None or not isinstance(self.whole, HasLaws):
            return self
        return changed(self, whole=self.whole.with_law(layer, kind, change))

    def on_face(self, where: str, load: Load) -> Self:
        """Return the assembly with a load on a face, if the device is no stack but has faces (else see `split`)."""
        if self.whole is None or not isinstance(self.whole, HasFaces):
            return self
        return changed(self, whole=self.whole.with_load(where, load))

    def split(self, change: Callable[[ParallelSection], Sequence[ParallelSection]]) -> Self:
        """Return the assembly with every part of the face divided into several."""
        return changed(self, parts=tuple(section for part in self.parts for section in change(part)))

    def scaled(self, factors: Mapping[str, float]) -> Self:
        """Return the assembly with these parameters of its stacks times factors, where a stack has them."""

        def scaled(part: ParallelSection) -> ParallelSection:
            now = part.stack.parameters()
            moved = {name: now[name] * factor for name, factor in factors.items() if name in now}
            scale = {name: part.scale.get(name, 1.0) * factors[name] for name in moved}
            return changed(part, stack=part.stack.replace(moved), scale={**part.scale, **scale})

        return changed(self, parts=tuple(map(scaled, self.parts)))

    def beside(self, shunt: Shunt) -> Self:
        """Return the assembly with an admittance in parallel with the device."""
        return changed(self, shunts=(*self.shunts, shunt))

    def behind(self, terminal: Terminal) -> Self:
        """Return the assembly as seen from further out."""
        return changed(self, terminals=(*self.terminals, terminal))

    def recorded(self, record: "Record") -> Self:
        """Return the assembly as a sweep of this kind records it."""
        return changed(self, records=(*self.records, record))

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return the recorded impedance, ohm, shape (N,)."""
        return self.while_recorded(frequency, self.steady(frequency))

    def while_recorded(self, frequency: Frequencies, steady: Impedances) -> Impedances:
        """Return the recorded impedance of a device whose steady impedance is known."""
        seen = steady
        for record in self.records:
            seen = seen * record.factor(self, frequency)
        return np.conj(seen) if self.conjugated else seen

    def slopes_recorded(self, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln Z / d parameter of the device as recorded, shape (P, N); `at_rest`: of the steady device."""
        return at_rest + sum(record.slopes(self, frequency, names, at_rest) for record in self.records)

    def as_recorded(self, moved: Self, frequency: Frequencies) -> Complexes | None:
        """Return what recording adds to the change of ln Z to a slightly different device, shape (N,); first order.

        None if that is recorded by a sweep of another kind.
        """
        if len(self.records) != len(moved.records):
            return None
        pairs = zip(self.records, moved.records, strict=True)
        nothing = np.zeros(frequency.size, np.complex128)
        return sum((own.change(self, other, moved, frequency) for own, other in pairs), nothing)

    def steady(self, frequency: Frequencies) -> Impedances:
        """Return the impedance in an infinitely slow sweep: all stages but the last, ohm, shape (N,)."""
        own = self.parts, self.whole, self.shunts, self.terminals, frequency
        known = next((Z for key, Z in self._known_steady if all(a is b for a, b in zip(key, own, strict=True))), None)
        steady = self._steady(frequency) if known is None else known
        if not frequency.flags.writeable:
            others = [one for one in self._known_steady if one[1] is not steady]
            self._known_steady[:] = [(own, steady), *others[:1]]
        return steady

    def _steady(self, frequency: Frequencies) -> Impedances:
        jw = j_omega(frequency)
        seen: Impedances = 1 / (self._beside(frequency, jw) + self._within(frequency))
        for terminal in self.terminals:
            seen, _ = terminal(jw, seen)
        return seen

    def _within(self, frequency: Frequencies) -> Complexes:
        """Return the admittance of the device without shunts, S, shape (N,)."""
        for parts, whole, where, known in self._known:
            if parts is self.parts and whole is self.whole and where is frequency:
                return self._kept(frequency, known)
        if self.whole is not None:
            return self._kept(frequency, 1 / self.whole.impedance(frequency))
        within = sum((part.admittance(frequency) for part in self.parts), np.zeros(frequency.size, np.complex128))
        return self._kept(frequency, within)

    def _kept(self, frequency: Frequencies, within: Complexes) -> Complexes:
        """Keep the device's admittance for what is asked next."""
        if not frequency.flags.writeable:  # a recording's: it stays what it is
            others = [one for one in self._known if one[3] is not within]
            self._known[:] = [(self.parts, self.whole, frequency, within), *others[:1]]
        return within

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
        """Return the same and d ln Z / d parameter of the device, shape (P, N); 0 for a name that no stack has."""
        within = np.zeros(frequency.size, np.complex128)
        slope = np.zeros((len(names), frequency.size), np.complex128)
        if self.whole is not None:
            own, by_name = self.whole.jacobian(frequency, names)
            within, slope = 1 / own, -by_name / own
        for part in self.parts:
            admittance, by_name = part.jacobian(frequency, names)
            within += admittance
            slope += by_name
        return self._seen(frequency, self._kept(frequency, within), slope)

    def _seen(self, frequency: Frequencies, within: Complexes, slope: Complexes) -> tuple[Impedances, Complexes]:
        """Return Z and d ln Z from the admittance of the device without shunts and its derivatives, shape (P, N)."""
        jw = j_omega(frequency)
        seen: Impedances = 1 / (self._beside(frequency, jw) + within)
        slope = slope * -(seen**2)
        for terminal in self.terminals:
            seen, through = terminal(jw, seen)
            slope *= through
        return seen, slope / seen

    def unevenness(self, frequency: Frequencies, layer: str, spread: float) -> Complexes:
        """Return the change of ln Z if a layer's thickness deviates by this relative standard deviation, shape (N,).

        It deviates by as much to either side on half of the face each. To first order in admittance; 0 for a device
        that is no stack or has no such layer, and where an effect states how the thickness is distributed.
        """
        change, name = np.zeros(frequency.size, np.complex128), f"{layer}.thickness"
        for part in self.parts:
            if (part.strips is not None and part.strips.layer == layer) or name not in part.stack.names:
                continue
            t = part.stack.parameters()[name]
            sides = (part.stack.replace({name: t * (1 + one)}) for one in (-spread, spread))
            uneven = sum((changed(part, stack=side).admittance(frequency) for side in sides), np.zeros_like(change))
            change += uneven / 2 - part.admittance(frequency)
        return self._seen(frequency, self._within(frequency), change[None])[1][0] if self.parts else change

    def moved_by_laws(self, frequency: Frequencies, other: Self) -> Complexes | None:
        """Return ln Z of the device with slightly different laws less that of this one, to first order, shape (N,).

        None if the device knows no derivatives by its laws.
        """
        if not isinstance(self.whole, HasLawSlopes) or other.whole is None:
            return None
        return self._moved(frequency, self.whole.moved_by_laws(frequency, other.whole))

    def moved_by_loads(self, frequency: Frequencies, other: Self) -> Complexes | None:
        """Return the same for slightly different loads of its faces; None if the device is a stack."""
        if not isinstance(self.whole, HasFaces) or other.whole is None:
            return None
        return self._moved(frequency, self.whole.moved_by_loads(frequency, other.whole))

    def _moved(self, frequency: Frequencies, of_whole: Complexes) -> Complexes:
        """Return the change of ln Z as seen if ln Z of the device itself changes by this little, shape (N,)."""
        within = self._within(frequency)
        return self._seen(frequency, within, -within * of_whole[None])[1][0]


@dataclass(frozen=True, eq=False)
class Record(ABC):
    """What a sweep makes of a device: its readings are the steady impedances times a factor."""

    _factors: LastMade[Complexes] = field(default_factory=LastMade[Complexes], init=False, repr=False)

    def factor(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the recorded impedance over the steady one, shape (N,)."""
        return self._factors.of(device, frequency, lambda: self.computed(device, frequency))

    @abstractmethod
    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the factor, shape (N,)."""

    @abstractmethod
    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter of the device's model; `at_rest` is that of the steady Z, shape (P, N)."""

    def change(self, device: Assembly, other: "Record", moved: Assembly, frequency: Frequencies) -> Complexes:
        """Return the change of ln factor, to first order, to that of a slightly different sweep or device, shape (N,).

        `other`: the record of the device that has `moved`.
        """
        return other.computed(moved, frequency) / self.factor(device, frequency) - 1


@dataclass(frozen=True, eq=False)
class Reading(Record):
    """A fault of the instrument, whatever the device is."""

    of: Callable[[Frequencies], ComplexLike]
    """Hz, shape (N,), to the factor."""

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the factor, shape (N,)."""
        return np.broadcast_to(np.asarray(self.of(frequency), np.complex128), frequency.shape)

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return zero."""
        return np.zeros_like(at_rest)
