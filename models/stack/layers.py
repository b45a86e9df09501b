"""Elements of a stack: piezoelectric and elastic layers."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from ..base.arrays import Frequencies
from .loss_laws import CONSTANT, ComplexLike, LossLaw, StackError, law_with, require_positive
from .row import Joins

Gradient: TypeAlias = tuple[str, ComplexLike]
"""The quantity that a parameter p changes (a key of the section's `weights`), and d ln(quantity) / dp.

`h33` and `mass` may be zero; for them it is d(quantity) / dp, and the weight matches that.
"""


@dataclass(frozen=True)
class Elastic(Joins):
    """A passive layer: matching layer, glue, electrode, backing."""

    name: str
    thickness: float
    """m."""
    z: float
    """Specific acoustic impedance rho c, Rayl."""
    c: float
    """Speed sqrt(c33'/rho), m/s."""
    q: float = math.inf
    """Quality factor: c33 = z c (1 + j/q)."""
    law: LossLaw = CONSTANT
    """Continuation of c33 from the law's reference frequency."""

    def __post_init__(self) -> None:
        require_positive(f"layer {self.name!r}", thickness=self.thickness, z=self.z, c=self.c, q=self.q)

    @property
    def c33(self) -> complex:
        """Stiffness z c (1 + j/q) at the reference of the loss law, Pa."""
        return self.z * self.c * complex(1.0, 1 / self.q)

    @property
    def density(self) -> float:
        """Density z/c, kg/m3."""
        return self.z / self.c

    def parameters(self) -> dict[str, float]:
        """Return `thickness` (m), `z` (Rayl), `c` (m/s), `q`, and `q.exponent` if the law has one."""
        own = {"thickness": self.thickness, "z": self.z, "c": self.c, "q": self.q}
        return own | {f"q.{key}": value for key, value in self.law.parameters().items()}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the layer with these parameters."""
        return type(self)(  # dataclasses.replace takes as long as the arithmetic of a hundred points
            self.name,
            values.get("thickness", self.thickness),
            values.get("z", self.z),
            values.get("c", self.c),
            values.get("q", self.q),
            law_with(self.law, values, "q."),
        )

    def wave(self, frequency: Frequencies) -> tuple[ComplexLike, ComplexLike]:
        """Return the characteristic impedance (Rayl) and the travel time t/v (s) of a wave through the layer."""
        return _wave(self.density, self.law.over(self.c33, frequency), self.thickness)

    def gradients(self, frequency: Frequencies) -> Mapping[str, Gradient]:
        """Return for every parameter the quantity that it changes, and the derivative."""
        stiffness = self.law.log_derivatives(self.c33, frequency)
        own: dict[str, Gradient] = {
            "thickness": ("theta", 1 / self.thickness),
            "z": ("Zc", 1 / self.z),
            "c": ("theta", -1 / self.c),
            "q": ("stiffness", stiffness["im"] * (-self.z * self.c / self.q**2)),
        }
        return own | {f"q.{key}": ("stiffness", stiffness[key]) for key in self.law.parameters()}


@dataclass(frozen=True)
class Piezo(Joins):
    """A piezoelectric layer, electroded on both faces, in thickness-extensional motion."""

    name: str
    thickness: float
    """m."""
    density: float
    """kg/m3."""
    c33D: complex
    """Stiffness at constant D, Pa; im > 0 is loss."""
    h33: complex
    """V/m; zero for a dead (depoled) layer."""
    eps33S: complex
    """Clamped permittivity, F/m; im < 0 is loss."""
    polarity: int = 1
    """+1, or -1 if the layer is poled against the direction of the terminal current through it."""
    c_law: LossLaw = CONSTANT
    """Continuation of c33D from the law's reference frequency."""
    h_law: LossLaw = CONSTANT
    """The same for h33."""
    eps_law: LossLaw = CONSTANT
    """The same for eps33S."""

    def __post_init__(self) -> None:
        parts = {"c33D_re": self.c33D.real, "eps33S_re": self.eps33S.real}
        require_positive(f"layer {self.name!r}", thickness=self.thickness, density=self.density, **parts)
        for constant, (value, _) in self._constants().items():
            if not cmath.isfinite(value):
                raise StackError(f"layer {self.name!r}: {constant} is {value:g}; a finite number is needed")
        if self.polarity not in (1, -1):
            raise StackError(f"layer {self.name!r}: polarity is {self.polarity}; allowed is 1 or -1")

    def parameters(self) -> dict[str, float]:
        """Return `thickness density c33D.re c33D.im h33.re h33.im eps33S.re eps33S.im`, and the laws' exponents."""
        own = {"thickness": self.thickness, "density": self.density}
        for constant, (value, law) in self._constants().items():
            own |= {f"{constant}.re": value.real, f"{constant}.im": value.imag}
            own |= {f"{constant}.{key}": exponent for key, exponent in law.parameters().items()}
        return own

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the layer with these parameters."""

        def new(constant: str, old: complex) -> complex:
            return complex(values.get(f"{constant}.re", old.real), values.get(f"{constant}.im", old.imag))

        return type(self)(
            self.name,
            thickness=values.get("thickness", self.thickness),
            density=values.get("density", self.density),
            c33D=new("c33D", self.c33D),
            h33=new("h33", self.h33),
            eps33S=new("eps33S", self.eps33S),
            polarity=self.polarity,
            c_law=law_with(self.c_law, values, "c33D."),
            h_law=law_with(self.h_law, values, "h33."),
            eps_law=law_with(self.eps_law, values, "eps33S."),
        )

    def wave(self, frequency: Frequencies) -> tuple[ComplexLike, ComplexLike]:
        """Return the characteristic impedance (Rayl) and the travel time t/v (s) of a wave through the layer."""
        return _wave(self.density, self.c_law.over(self.c33D, frequency), self.thickness)

    def field_per_strain(self, frequency: Frequencies) -> ComplexLike:
        """Return h33 with its polarity, V/m."""
        return self.polarity * self.h_law.over(self.h33, frequency)

    def clamped_elastance(self, frequency: Frequencies) -> ComplexLike:
        """Return t/eps33S, the inverse of the clamped capacitance of one square metre, m2/F."""
        return self.thickness / self.eps_law.over(self.eps33S, frequency)

    def gradients(self, frequency: Frequencies) -> Mapping[str, Gradient]:
        """Return for every parameter the quantity that it changes, and the derivative."""
        own: dict[str, Gradient] = {
            "thickness": ("thickness", 1 / self.thickness),
            "density": ("density", 1 / self.density),
        }
        for key, size in self.c_law.log_derivatives(self.c33D, frequency).items():
            own[f"c33D.{key}"] = ("stiffness", size)
        for key, size in self.h_law.derivatives(self.h33, frequency).items():
            own[f"h33.{key}"] = ("h33", self.polarity * size)
        for key, size in self.eps_law.log_derivatives(self.eps33S, frequency).items():
            own[f"eps33S.{key}"] = ("eps33S", size)
        return own

    def _constants(self) -> dict[str, tuple[complex, LossLaw]]:
        return {
            "c33D": (self.c33D, self.c_law),
            "h33": (self.h33, self.h_law),
            "eps33S": (self.eps33S, self.eps_law),
        }


def _wave(density: float, c33: ComplexLike, thickness: float) -> tuple[ComplexLike, ComplexLike]:
    """Return sqrt(rho c33) in Rayl and t sqrt(rho/c33) in s; both have a positive real part."""
    root: ComplexLike = cmath.sqrt(c33) if isinstance(c33, complex) else np.sqrt(c33, dtype=np.complex128)
    return math.sqrt(density) * root, thickness * math.sqrt(density) / root
