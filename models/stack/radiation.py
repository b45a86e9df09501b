"""A face that radiates into a fluid as a rigid piston in a baffle (Rayleigh; Kinsler et al., Fundamentals, 7.5).

With x = 2 k a the specific impedance is z [R1(x) + j X1(x)], R1 = 1 - 2 J1(x)/x, X1 = 2 H1(x)/x (Bessel and Struve).
A face many wavelengths wide (x >> 1) sees the half-space; for a thin disk in water the difference is far below one per
cent at the thickness resonance, but decisive at the radial resonance.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from .loads import Load
from .loss_laws import ComplexLike, require_positive


def piston(x: Reals) -> Complexes:
    """Return R1 + j X1 for x = 2 k a > 0."""
    from scipy import special  # slow to load, and only for a face in a fluid

    square = -0.25 * x * x
    # below x = 1 the difference 1 - 2 J1(x)/x loses digits; there its series -sum square^k/(k! (k+1)!) has few terms
    series = sum(-(square**k) / (special.factorial(k) * special.factorial(k + 1)) for k in range(1, 9))
    resistance = np.where(x < 1, series, 1 - 2 * special.j1(x) / x)
    return np.add(resistance, 2j * special.struve(1, x) / x)


def piston_slope(x: Reals) -> Complexes:
    """Return d/dx of R1 + j X1."""
    from scipy import special

    reactance = 2 * special.struve(0, x) / x - 4 * special.struve(1, x) / x**2
    return np.add(2 * special.jv(2, x) / x, 1j * reactance)


@dataclass(frozen=True)
class Piston(Load):
    """A fluid before a round face that is not many wavelengths wide."""

    name: str
    z: float
    """Specific acoustic impedance rho c of the fluid, Rayl."""
    c: float
    """Speed of sound in the fluid, m/s."""
    radius: float
    """Radius of the face, m."""

    def __post_init__(self) -> None:
        require_positive(f"load {self.name!r}", z=self.z, c=self.c, radius=self.radius)

    def parameters(self) -> dict[str, float]:
        """Return `z` (Rayl), `c` (m/s) and `radius` (m)."""
        return {"z": self.z, "c": self.c, "radius": self.radius}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the piston with these parameters."""
        return replace(self, **values)

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific radiation impedance in Rayl, shape (N,)."""
        return self.z * piston(self._x(frequency))

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d impedance / d parameter, shape (N,)."""
        x = self._x(frequency)
        by_ln_x = self.z * x * piston_slope(x)
        return {"z": piston(x), "c": -by_ln_x / self.c, "radius": by_ln_x / self.radius}

    def _x(self, frequency: Frequencies) -> Reals:
        return 4 * np.pi * self.radius / self.c * frequency
