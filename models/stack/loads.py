"""What the outermost faces rest on, as a specific acoustic impedance over frequency."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from ..arrays import Frequencies
from .laws import ComplexLike, StackError
from .row import Joins


class Load(Joins, ABC):
    """Anything that answers the velocity of a face with a pressure."""

    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """Return every parameter by name, SI units."""

    @abstractmethod
    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the load with these parameters."""

    @abstractmethod
    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific acoustic impedance in Rayl at frequencies in Hz, shape (N,)."""

    @abstractmethod
    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d impedance / d parameter for each parameter."""


@dataclass(frozen=True)
class HalfSpace(Load):
    """A medium without end: what goes in does not come back."""

    name: str
    z: float
    """Specific acoustic impedance rho c, Rayl."""

    def __post_init__(self) -> None:
        if not 0 <= self.z < float("inf"):
            raise StackError(f"load {self.name!r}: z is {self.z:g} Rayl; allowed is zero or a positive finite number")

    def parameters(self) -> dict[str, float]:
        """Return `z`, Rayl."""
        return {"z": self.z}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the half-space with another `z`."""
        return replace(self, **values)

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return z at every frequency."""
        return complex(self.z)

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return 1."""
        return {"z": 1.0 + 0j}


VACUUM = HalfSpace("vacuum", 0.0)
"""A free face."""
AIR = HalfSpace("air", 413.3)
"""Air at 20 degrees C and 101.325 kPa: 1.204 kg/m3 times 343.2 m/s."""
