"""Interfaces without thickness: limits of a layer much thinner than the wavelength.

A thin layer is its compliance t/c33 between two halves of its mass rho t. If one of the two dominates, it remains
alone: a soft glue line is a spring, an electrode on a free face is a mass.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from ..base.arrays import Complexes, Frequencies
from .layers import Gradient
from .loss_laws import ComplexLike, require_positive
from .row import Joins


@dataclass(frozen=True)
class Spring(Joins):
    """A compliant interface: the velocities of its two sides differ, the pressures do not."""

    name: str
    stiffness: float
    """Pressure per gap, c33'/t of the layer that it represents, Pa/m."""
    q: float = math.inf
    """Quality factor: stiffness (1 + j/q)."""

    def __post_init__(self) -> None:
        require_positive(f"spring {self.name!r}", stiffness=self.stiffness, q=self.q)

    def parameters(self) -> dict[str, float]:
        """Return `stiffness` (Pa/m) and `q`."""
        return {"stiffness": self.stiffness, "q": self.q}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the spring with these parameters."""
        return replace(self, **values)

    def gradients(self, frequency: Frequencies) -> Mapping[str, Gradient]:
        """Return for every parameter the quantity that it changes, and the derivative."""
        return {
            "stiffness": ("stiffness", 1 / self.stiffness),
            "q": ("stiffness", -1j / self.q**2 / complex(1.0, 1 / self.q)),
        }

    def section(self, jw: Complexes) -> "Gap":
        """Return the spring at angular frequencies jw (rad/s, times j), shape (N,)."""
        return Gap(jw / (self.stiffness * complex(1.0, 1 / self.q)))


@dataclass(frozen=True)
class Mass(Joins):
    """A heavy interface: the pressures of its two sides differ, the velocities do not."""

    name: str
    mass: float
    """Mass per area rho t, kg/m2; zero is allowed, as the start of a search for a missing electrode."""

    def __post_init__(self) -> None:
        if self.mass != 0:
            require_positive(f"mass {self.name!r}", mass=self.mass)

    def parameters(self) -> dict[str, float]:
        """Return `mass`, kg/m2."""
        return {"mass": self.mass}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the mass with these parameters."""
        return replace(self, **values)

    def gradients(self, frequency: Frequencies) -> Mapping[str, Gradient]:
        """Return the derivative of the mass by itself."""
        return {"mass": ("mass", 1.0)}

    def section(self, jw: Complexes) -> "Weight":
        """Return the mass at angular frequencies jw (rad/s, times j), shape (N,)."""
        return Weight(jw, jw * self.mass)


@dataclass(frozen=True, slots=True)
class Gap:
    """A spring at all frequencies."""

    y: Complexes
    """jw/stiffness: velocity difference per pressure, 1/Rayl, shape (N,)."""

    def input_impedance(self, load: ComplexLike) -> tuple[ComplexLike, ComplexLike]:
        """Return the impedance of one side in Rayl with `load` at the other, and the velocity ratio of the far side."""
        share = 1.0 / (1.0 + load * self.y)
        return load * share, share

    def transmission(self, share: ComplexLike) -> ComplexLike:
        """Return the far side's velocity per velocity of the near side."""
        return share

    def weights(self, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike) -> dict[str, ComplexLike]:
        """Return d Z_el / d ln stiffness, ohm m2."""
        return {"stiffness": F1 * F1 * self.y}


@dataclass(frozen=True, slots=True)
class Weight:
    """A mass at all frequencies."""

    jw: Complexes
    """j times the angular frequency, rad/s, shape (N,)."""
    z: Complexes
    """jw mass: pressure difference per velocity, Rayl, shape (N,)."""

    def input_impedance(self, load: ComplexLike) -> tuple[ComplexLike, ComplexLike]:
        """Return the impedance of one side in Rayl with `load` at the other, and 1, since both sides move alike."""
        return load + self.z, 1.0

    def transmission(self, share: ComplexLike) -> ComplexLike:
        """Return the far side's velocity per velocity of the near side."""
        return share

    def weights(self, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike) -> dict[str, ComplexLike]:
        """Return d Z_el / d mass, ohm m4/kg."""
        return {"mass": v1 * v1 * self.jw}
