"""Loads of the outermost faces, as specific acoustic impedances over frequency."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Frequencies
from .loss_laws import ComplexLike, StackError
from .row import Joins


class Load(Joins, ABC):
    """Any load that relates the pressure on a face to its velocity."""

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
    """An infinite medium without reflections."""

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
        return type(self)(self.name, **values) if values else self

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return z at every frequency."""
        return complex(self.z)

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return 1."""
        return {"z": 1.0 + 0j}


@dataclass(frozen=True)
class Support(Load):
    """A fixture, rubber pad or finger on a face: `resistance + stiffness (1 + j loss)/(jw) + jw mass`, per area."""

    name: str
    resistance: float = 0.0
    """Rayl."""
    stiffness: float = 0.0
    """Pa/m."""
    mass: float = 0.0
    """kg/m2."""
    loss: float = 0.0
    """Loss tangent of the stiffness."""

    def __post_init__(self) -> None:
        for key, value in self.parameters().items():
            if not 0 <= value < float("inf"):
                raise StackError(f"load {self.name!r}: {key} is {value:g}; allowed is zero or a positive finite number")

    def parameters(self) -> dict[str, float]:
        """Return `resistance` (Rayl), `stiffness` (Pa/m), `mass` (kg/m2) and `loss`."""
        return {"resistance": self.resistance, "stiffness": self.stiffness, "mass": self.mass, "loss": self.loss}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the support with these parameters."""
        return replace(self, **values)

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific impedance in Rayl, shape (N,)."""
        omega = 2 * np.pi * frequency
        spring = self.stiffness / omega
        return np.add(self.resistance + self.loss * spring, 1j * (omega * self.mass - spring))

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d impedance / d parameter, shape (N,) where it depends on frequency."""
        omega = 2 * np.pi * frequency
        return {
            "resistance": 1.0 + 0j,
            "stiffness": np.divide(self.loss - 1j, omega),
            "mass": np.multiply(1j, omega),
            "loss": np.asarray(self.stiffness / omega, np.complex128),
        }


@dataclass(frozen=True)
class ShearedLiquid(Load):
    """A viscous liquid that a face moving in its own plane drags along: (1 + j) sqrt(w rho eta / 2)."""

    name: str
    density_viscosity: float
    """rho eta, kg2 m-4 s-1."""

    def parameters(self) -> dict[str, float]:
        """Return `density_viscosity`."""
        return {"density_viscosity": self.density_viscosity}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the liquid with these parameters."""
        return replace(self, **values)

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific shear impedance in Rayl, shape (N,)."""
        return np.multiply(1 + 1j, np.sqrt(np.pi * frequency * self.density_viscosity))

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d impedance / d parameter, shape (N,); infinite without a liquid."""
        return {"density_viscosity": np.divide(self.impedance(frequency), 2 * self.density_viscosity)}


@dataclass(frozen=True)
class AnyLoad(Load):
    """Any specific acoustic impedance over frequency, given as a function: measured, or from another program."""

    name: str
    function: Callable[[Frequencies], Complexes]
    """Maps Hz, shape (N,), to Rayl, shape (N,)."""

    def parameters(self) -> dict[str, float]:
        """Return nothing: the function's parameters are not known here."""
        return {}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the load itself: it has no parameter."""
        return self

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the value of the function. Raises StackError if its shape is wrong or a value is not finite."""
        Z = np.asarray(self.function(frequency), np.complex128)
        if Z.shape != frequency.shape or not np.all(np.isfinite(Z)):
            raise StackError(
                f"load {self.name!r}: its function gave shape {Z.shape}, finite: {bool(np.all(np.isfinite(Z)))}; "
                f"a finite impedance for each of the {frequency.size} frequencies is needed"
            )
        return Z

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return nothing."""
        return {}


VACUUM = HalfSpace("vacuum", 0.0)
"""A free face."""
AIR = HalfSpace("air", 413.3)
"""Air at 20 degrees C and 101.325 kPa: 1.204 kg/m3 times 343.2 m/s."""
