"""Definition of an effect: one piece of physics that a model may lack."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from itertools import pairwise
from typing import ClassVar

from ...base.face_loads import HasFaces, Load
from ...base.model import Model
from ...base.names import numbered
from ...stack import Stack
from .assembly import Assembly, HasLaws

TERMINALS = "terminals"
SWEEP = "sweep"


class Stage(IntEnum):
    """Stage at which an effect acts, from the inside outwards.

    A device applies its effects in this order (within a stage: by name), so that the result does not depend on the
    order in which they were found.
    """

    CONSTANTS = 0
    """The material of a layer."""
    LAYERS = 1
    """An additional layer, mass or load."""
    SHARES = 2
    """Parts of the face that differ."""
    VOIDS = 3
    """Parts of the face that lose everything beyond an interface, including what other effects added there."""
    TERMINALS = 4
    """In parallel with the device and in its leads."""
    CABLE = 5
    """Between the leads and the analyzer."""
    ACQUISITION = 6
    """During the sweep, and when it is recorded."""


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect."""

    name: str
    unit: str
    typical: float
    """A size that would matter in such a device; sets the scale of steps and of negligible sizes."""
    lower: float = 0.0
    upper: float = float("inf")
    """Physical limits; a mass or an inductance is not negative."""
    null: float = 0.0
    """The value at which the effect is absent; for a parameter other than the first, its value while absent."""
    scan: tuple[float, ...] = ()
    """Start values for a strongly nonlinear parameter (a delay, a fraction); for a further size, values with which the
    other sizes are tried."""
    prior: tuple[float, float] | None = None
    """Prior size in nature: median and standard deviation of its logarithm if it starts from nothing, else mean and
    standard deviation. None: three typical sizes within a factor of five (or around null).
    """
    fraction: bool = False
    """Whether all values between the limits are equally likely, zero included."""
    in_proportion: bool = False
    """Whether its usual size is in proportion to the first parameter's: a shorter lead has less resistance, too."""
    absent: float = 0.1
    """Prior probability that it is zero though the effect is there, if it is one of several sizes or in proportion to
    one: a resonance is driven by the voltage, by the strain, or by both, and a compensation may have taken off the
    resistance of a lead."""
    delay: bool = False
    """Whether it is the delay of an echo in s, of which the first parameter is the amplitude."""
    ripples: bool = False
    """Whether what it does ripples over frequency, faster or slower: a fit has a minimum for each number of ripples."""
    varies: bool = False
    """Whether it may change smoothly with frequency, though its formula does not say so, apart from the effect's size:
    a dot of solder is not everywhere as high, and a connector is no cable."""
    needs_prior: bool = False
    """Whether little but its prior tells it from other parameters of the effect: a fit by hand, which has no priors,
    leaves it at null."""
    setting: str = ""
    """The setting of a recording that gives its null value, if there is one."""

    @property
    def from_nothing(self) -> bool:
        """Whether it starts from nothing: it is never negative, and zero if the effect is absent."""
        return self.lower == self.null == 0

    @property
    def expected(self) -> tuple[float, float]:
        """Median and standard deviation of the logarithm; for a fraction or either sign, mean and deviation."""
        if self.prior is not None:
            return self.prior
        if self.fraction:
            return (self.lower + self.upper) / 2, (self.upper - self.lower) / 2
        return (3 * self.typical, 1.6) if self.from_nothing else (self.null, 3 * self.typical)


class Effect(ABC):
    """One piece of physics, as a nested model: with all parameters at null the effect is absent."""

    name: str
    """Name for people and for `pzctl diagnose`."""
    says: str
    """A sentence for the technician; `{where}` is replaced by the place."""
    separates: ClassVar[str]
    """Additional measurement that distinguishes it from its look-alikes."""
    references: ClassVar[tuple[str, ...]]
    stage: Stage = Stage.LAYERS
    number: int = 1
    """Which of the effects of its name at its place it is: a layer may have several resonances, or learned laws."""
    several: ClassVar[bool] = False
    """Whether several of it can be at one place, each with parameters of its own."""
    sizes: ClassVar[int] = 1
    """Number of leading parameters that are sizes: the effect is absent if all of them are null."""

    odds: ClassVar[float] = 1.0
    """Frequency of occurrence relative to an indistinguishable look-alike: a judgement, and a mild one."""
    implies: ClassVar[frozenset[str]] = frozenset()
    """Names of effects of which it is a kind: what is said of them is true of it, too. A short cable is a lead."""
    divides: ClassVar[bool] = False
    """Whether it divides the face into many strips."""
    formula_errs: ClassVar[bool] = True
    """Whether a device may deviate smoothly from its formula; not if the formula was chosen to describe the device."""

    errs_roughly: ClassVar[bool] = True
    """Whether it may also deviate from one line's width of frequency to the next, as what is distributed over the face
    or in the thickness does near resonances. Circuits at the terminals, laws of a material and loads of a whole face
    are smooth: constants absorb most of what these do, and a rough error of all that would explain anything."""

    errs_in_time: ClassVar[bool] = False
    """Whether its formula is a course in time, from which a device may deviate smoothly in time, not in frequency."""

    only_named: ClassVar[bool] = False
    """Whether a diagnosis looks for it only if it is named (`--effects`): usual errors, or more frequent effects,
    describe nearly the same."""

    from_later_step: ClassVar[bool] = False
    """Whether it is a change since the first step, which therefore does not have it."""

    stays: ClassVar[bool] = False
    """Whether it stays on a front that the next step glues onto: its place is that interface, and before, the front."""

    of_laws: ClassVar[bool] = False
    """Whether it bends a law of a layer's stiffness or permittivity, which models other than stacks have, too."""

    lies_on_faces: ClassVar[type[Load] | None] = None
    """What it is on a face of a model that is no stack (`HasFaces`); None if only stacks have it."""

    @property
    def physics(self) -> str:
        """The physics in words, for the list of effects."""
        words = " ".join((self.__doc__ or "").split())
        return f"{words} Looked for only if it is named (`--effects`)." if self.only_named else words

    @property
    def key(self) -> str:
        """Its name in the names of parameters: `learned`, and `learned-2` for the second at its place."""
        return numbered(self.name, self.number)

    def another(self, number: int) -> "Effect":
        """Return that of its name with this number at the same place; always the same object."""
        return self if number == self.number else _another(self, number)

    @property
    def law_name(self) -> str:
        """What tells it from other effects at a place; the same for a law that has been given another name."""
        return self.name

    @property
    def outside(self) -> bool:
        """Whether it needs no stack, only an impedance: any model can have it."""
        return self.stage in (Stage.TERMINALS, Stage.CABLE)

    def possible_in(self, model: Model) -> bool:
        """Return whether a model can have it: a stack any, another what is outside of it, on its faces, in its laws."""
        if self.outside or isinstance(model, Stack):
            return True
        return (self.of_laws and isinstance(model, HasLaws)) or len(self._faces_of(model)) > 0

    def _faces_of(self, model: Model) -> Sequence[str]:
        """Return the faces of a model that is no stack on which it may lie."""
        if self.lies_on_faces is None or not isinstance(model, HasFaces):
            return ()
        return model.faces_for(self.lies_on_faces)

    def looked_for_in(self, model: Model, nominal: Stack) -> tuple[str, ...]:
        """Return the places at which a diagnosis looks for it in a model; `nominal`: the model, or a plate like it."""
        if not self.possible_in(model):
            return ()
        there = self.looked_for(nominal)
        if isinstance(model, Stack) or self.lies_on_faces is None:
            return there
        faces = self._faces_of(model)
        return tuple(where for where in there if where in faces)

    @abstractmethod
    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return its possible places in this stack: `terminals`, `layer:NAME`, `interface:A|B`, `face:back` ..."""

    def looked_for(self, stack: Stack) -> tuple[str, ...]:
        """Return the places at which a diagnosis looks for it: none where it only changes what the build states."""
        return self.places(stack)

    def is_in(self, stack: Stack, where: str) -> bool:
        """Return whether a stack has this place, or for an effect that stays the front that will become it."""
        return where in self.places(stack) or (self.stays and is_bare_front(stack, where))

    @abstractmethod
    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return its parameters at this place; the first is its size (the first `sizes` are).

        Empty for an effect that is either present or not (`polarity`): it has no size and no derivative.
        """

    def parameters_in(self, model: Model, nominal: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the same for a model, which may let an effect act in more ways than a plate (`nominal`) does."""
        return self.effect_parameters(nominal, where)

    def sentence(self, where: str, sizes: Mapping[str, tuple[float, float, str]]) -> str:
        """Return the sentence for the technician; `sizes`: value, standard uncertainty and unit of each parameter."""
        return self.says.format(where=where)

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return value and unit of each quantity shown to people, computed from the parameters `values`.

        For effects whose size enters squared: the parameter is the square, so that its derivative at null is not zero.
        """
        return {}

    def added_losses(self, where: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return what it adds to the imaginary part of constants where these are stated, relative to their real parts.

        For each constant (`disk.eps33S`) that it adds to: what is left is the material's own loss.
        """
        return {}

    @abstractmethod
    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the effect; `values` lie within the parameters' limits."""


@cache
def _another(effect: Effect, number: int) -> Effect:
    made = copy(effect)
    made.number = number
    return made


def layer_at(where: str) -> str:
    """Return NAME of `layer:NAME`."""
    return where.removeprefix("layer:")


def interface_at(where: str) -> tuple[str, str]:
    """Return (A, B) of `interface:A|B`; A is behind B."""
    behind, _, before = where.removeprefix("interface:").partition("|")
    return behind, before


def interfaces(stack: Stack) -> tuple[str, ...]:
    """Return every interface between two layers, back to front."""
    names = [layer.name for layer in stack.layers]
    return tuple(f"interface:{a}|{b}" for a, b in pairwise(names))


def is_bare_front(stack: Stack, where: str) -> bool:
    """Return whether the front of a stack is the rear side of this interface, with nothing on it yet."""
    behind, before = interface_at(where)
    return stack.layers[-1].name == behind and before not in [layer.name for layer in stack.layers]
