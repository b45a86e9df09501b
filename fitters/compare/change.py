"""A change: what may have happened between two recordings, with the sizes it has in nature."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...models.base.arrays import Frequencies, Impedances

Values = Mapping[str, float]
"""Sizes in SI units, by name."""
TERMINALS, DEVICE = "terminals", "device"


@dataclass(frozen=True)
class ChangeSize:
    """A size of a change: log-normal, or normal where it may have either sign."""

    name: str
    unit: str
    median: float
    """Of a signed one its mean."""
    spread: float
    """Standard deviation of its logarithm; of a signed one its own, in its unit."""
    signed: bool = False

    def value(self, x: float) -> float:
        """Return the size at a coordinate whose prior is a unit normal."""
        return self.median + self.spread * x if self.signed else float(self.median * np.exp(self.spread * x))

    def slope(self, x: float) -> float:
        """Return d size / d coordinate."""
        return self.spread if self.signed else self.spread * self.value(x)


class Change(Protocol):
    """What may have happened."""

    @property
    def effect(self) -> str:
        """Its name, the catalogue's where the catalogue has it."""
        ...

    @property
    def where(self) -> str:
        """`terminals`, `device`, or a place of the build."""
        ...

    @property
    def sizes(self) -> tuple[ChangeSize, ...]:
        """What it has for sizes; the first is what it is known by."""
        ...

    @property
    def odds(self) -> float:
        """Prior odds against nothing, beside other changes."""
        ...

    @property
    def says(self) -> str:
        """A sentence for people."""
        ...

    def apply(self, Z: Impedances, frequency: Frequencies, values: Values) -> Impedances:
        """Return what is seen in ohm, shape (N,), where Z was seen before."""
        ...
