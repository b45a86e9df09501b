"""Specimens of the lab world: a ceramic with its own dispersion, the layers glued to it, the build file's values."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...waves import Complexes, Reals

AIR = 413.0
"""Rayl."""
EPS0 = 8.8541878128e-12
"""F/m."""

Kind = Literal["soft", "hard", "film", "composite"]


@dataclass(frozen=True)
class Ceramic:
    """A piezoelectric layer; its constants are those at `f0`, exp(+jwt).

    1/Q grows as f^loss_power; the permittivity falls as f^-slope; if `causal`, the stiffness follows from its loss
    by causality.
    """

    kind: Kind
    thickness: float
    """m."""
    density: float
    """kg/m3."""
    c33D: complex
    """Pa."""
    h33: complex
    """V/m."""
    eps33S: complex
    """F/m."""
    loss_power: float = 0.0
    slope: float = 0.0
    causal: bool = False

    @property
    def f0(self) -> float:
        """Antiresonance without load, Hz."""
        return float(np.sqrt(self.c33D.real / self.density)) / (2 * self.thickness)


@dataclass(frozen=True)
class LabLayer:
    """A glued layer or the glue between: m, Rayl, m/s; its stiffness is z c (1 + j/q), q at the ceramic's `f0`."""

    name: str
    thickness: float
    z: float
    c: float
    q: float
    glue: bool
    told: tuple[float, float, float, float]
    """Thickness, z, c, q as the build file states them."""
    u: tuple[float, float, float, float]
    """Standard uncertainties as the build file states them; zero where it states a number as exact."""
    loss_power: float = 0.0
    causal: bool = False


@dataclass(frozen=True)
class Told:
    """The build file's values for the ceramic: nominal values and their uncertainties."""

    material: str
    thickness: float
    """m."""
    thickness_u: float
    diameter: float
    """m."""
    diameter_u: float
    values: tuple[tuple[str, float, float, float], ...]
    """Key of build.toml, real part, imaginary part, uncertainty; empty: the library's values."""


@dataclass(frozen=True)
class LabDevice:
    """One transducer; its steps are `disk`, `ml1`, `ml2`, as many as there are."""

    name: str
    diameter: float
    """m."""
    ceramic: Ceramic
    layers: tuple[LabLayer, ...]
    back: float
    """Rayl, the load behind the ceramic."""
    front: float
    steps: tuple[str, ...]
    told: Told

    @property
    def area(self) -> float:
        """m2."""
        return float(np.pi) * self.diameter**2 / 4

    @property
    def C0(self) -> float:
        """Clamped capacitance, F."""
        return self.ceramic.eps33S.real * self.area / self.ceramic.thickness

    def layers_of(self, step: str) -> tuple[LabLayer, ...]:
        """Return the layers glued on in a step, back to front."""
        return self.layers[: 2 * self.steps.index(step)]


def lossy(x: Reals, value: complex, power: float, causal: bool) -> Complexes:
    """Return a lossy stiffness whose loss factor grows as x^power, x = f/f0, equal to `value` at x = 1.

    If causal, its real part follows from this loss: integrating power laws gives
    (x^n - 1)/tan(n pi/2), and (2/pi) ln x for n = 0 (Szabo, J. Acoust. Soc. Am. 96 (1994) 491).
    """
    eta = value.imag / value.real
    grown = x**power
    real = np.zeros_like(x)
    if causal:
        tiny = abs(power) < 1e-6
        real = 2 / np.pi * np.log(x) if tiny else (grown - 1) / np.tan(power * np.pi / 2)
    return np.asarray(value.real * (1 + eta * (real + 1j * grown)), np.complex128)
