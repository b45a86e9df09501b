"""What an effect is: one piece of physics that a model can leave out."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import ClassVar

from ...stack import Stack
from .assembly import Assembly

TERMINALS = "terminals"
SWEEP = "sweep"


class Stage(IntEnum):
    """Where in the world an effect acts, from within outwards.

    A device applies its effects in this order (of one stage: by name), so that it is the same device in whatever
    order they were found.
    """

    CONSTANTS = 0
    """The material of a layer."""
    LAYERS = 1
    """A layer, a mass or a load more."""
    SHARES = 2
    """Parts of the face that differ."""
    VOIDS = 3
    """Parts of the face that lose what lies beyond an interface, with all that was added there."""
    TERMINALS = 4
    """Beside the device and in its leads."""
    CABLE = 5
    """Between the leads and the analyzer."""
    ACQUISITION = 6
    """While the sweep runs, and when it is written down."""


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect."""

    name: str
    unit: str
    typical: float
    """A size that would matter on such a device: scale of steps and of what counts as small."""
    lower: float = 0.0
    upper: float = float("inf")
    """Physical limits; a mass or an inductance is not negative."""
    null: float = 0.0
    """The value at which the effect is absent; for a parameter other than the first, its value while absent."""
    scan: tuple[float, ...] = ()
    """Values to start from where the effect is too far from linear in this knob to find them (a delay, a share)."""
    prior: tuple[float, float] | None = None
    """How large it is in nature, before any recording: median and standard deviation of its logarithm, where it grows
    from nothing; else mean and standard deviation. None: three typical sizes within a factor of five (or around null).
    """
    setting: str = ""
    """The setting of a recording that says its null, where there is one."""

    @property
    def from_nothing(self) -> bool:
        """Whether it grows from nothing: it is never negative, and zero where there is none."""
        return self.lower == self.null == 0

    @property
    def expected(self) -> tuple[float, float]:
        """Median and standard deviation of the logarithm; of a knob that does not grow from nothing, mean and width."""
        if self.prior is not None:
            return self.prior
        return (3 * self.typical, 1.6) if self.from_nothing else (self.null, 3 * self.typical)


class Effect(ABC):
    """One piece of physics, as a nested extension: with all parameters at null the model is the one without it."""

    name: ClassVar[str]
    """As people and `pzctl diagnose` call it."""
    says: ClassVar[str]
    """A sentence for the technician who finds it; `{where}` stands for the place."""
    separates: ClassVar[str]
    """What extra measurement separates it from its look-alikes."""
    references: ClassVar[tuple[str, ...]]
    stage: ClassVar[Stage] = Stage.LAYERS
    sizes: ClassVar[int] = 1
    """How many of the first parameters are sizes: the effect is absent where all of them are null."""

    odds: ClassVar[float] = 1.0
    """How often it is met against a look-alike that a recording cannot tell from it: a judgement, and a mild one."""

    @abstractmethod
    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return where in this stack it may sit: `terminals`, `layer:NAME`, `interface:A|B`, `face:back` ..."""

    @abstractmethod
    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return its parameters at this place; the first is its size (the first `sizes` are).

        None for an effect that is there or not (`polarity`): no size, no derivative.
        """

    def shown(self, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
        """Return value and unit of each quantity shown to people, computed from the parameters `values`.

        For effects whose size enters squared: the parameter is the square, so that the derivative at null is not zero.
        """
        return {}

    @abstractmethod
    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the effect; `values` lie within the parameters' limits."""


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


FACES = ("face:back", "face:front")
