"""The radial mode of a thin round disk, electroded on both faces: plane stress, everything complex.

With a the radius, J(eta) = eta J0(eta)/J1(eta), eta = w a sqrt(density/c11p):

    Y = jw (pi a^2/t) eps33p [1 + 2 kp_IEEE^2/(J(eta) - 1 + sigma_p)]

(IEEE Std 176-1987; Sherrit et al., Ferroelectrics 119 (1991).) Finite thickness slows the radial waves: eta becomes
eta [1 + psi (t/D)^2 (eta^2/6 + 1/4)], psi = (c13E/c33E)^2. That moves the resonances as second-order plate theory
does while (t/D)^2 eta^2 is small against 1; the antiresonances it moves about twice too far.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from .arrays import Complexes, Frequencies, j_omega
from .bessel import RadialResonance
from .causal import continued
from .errors import PzctlError
from .stack.laws import CONSTANT, LossLaw, law_with

_CONSTANTS = ("s11E", "s12E", "d31")


class RadialError(PzctlError):
    """A disk that cannot exist."""


@dataclass(frozen=True, eq=False)
class _Motion:
    """The numbers on the way from constants to admittance, each of shape (N,)."""

    s11: Complexes
    sigma: Complexes
    plus: Complexes
    """s11E + s12E."""
    minus: Complexes
    eta: Complexes
    bend: Complexes
    """(t/D)^2 (eta^2/6 + 1/4): times psi, the relative change of eta by finite thickness."""
    by_d31: Complexes
    """jw (area/t) 4 d31 (1 + sigma)/(s11E + s12E): d strength / d d31."""
    strength: Complexes
    """jw (area/t) 2 d31^2 (1 + sigma)/(s11E + s12E), siemens."""
    resonance: RadialResonance


@dataclass(frozen=True)
class RadialArm:
    """What radial motion adds to the admittance of a disk whose plane is clamped.

    Y_m = jw (area/t) 2 d31^2 (1 + sigma_p)/(s11E + s12E)/(J - 1 + sigma_p). Raises RadialError where a size is not
    positive or the elastic energy would be negative.
    """

    name: str
    """Of the layer: parameters are called `name.s11E.re` and so on."""
    area: float
    """m2."""
    thickness: float
    """m."""
    density: float
    """kg/m3."""
    s11E: complex
    """1/Pa."""
    s12E: complex
    """1/Pa."""
    d31: complex
    """C/N."""
    psi: float = 0.0
    """(c13E/c33E)^2, about 0.4 to 0.7; 0 is a disk of vanishing thickness."""
    laws: Mapping[str, LossLaw] = field(default_factory=dict[str, LossLaw])
    """Loss law by constant's name; a constant that is not named keeps its value at all frequencies."""

    def __post_init__(self) -> None:
        for what in ("area", "thickness", "density"):
            value = getattr(self, what)
            if not (math.isfinite(value) and value > 0):
                raise RadialError(f"disk {self.name!r}: {what} is {value:g}; a positive number is needed")
        if not self.s11E.real > abs(self.s12E.real):
            raise RadialError(
                f"disk {self.name!r}: s11E is {self.s11E.real:g} and s12E {self.s12E.real:g} 1/Pa; "
                "s11E must be positive and larger in size than s12E"
            )

    def parameters(self) -> dict[str, float]:
        """Return `area`, `name.thickness`, `.density`, `.psi`, `.s11E.re`, `.s11E.im`, ... and the laws' exponents."""
        own = {"area": self.area}
        own |= {f"{self.name}.{what}": getattr(self, what) for what in ("thickness", "density", "psi")}
        for constant in _CONSTANTS:
            own |= self._constant_parameters(constant)
        return own

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the arm with these parameters; names it does not have are left aside."""
        return replace(self, **self._changes(values))

    def constants(self, frequency: Frequencies) -> dict[str, tuple[Complexes, Mapping[str, Complexes]]]:
        """Return s11E, s12E and d31 under their laws, shape (N,), each with d constant / d `re`, `im`, ..."""
        return {key: continued(self._law(key), getattr(self, key), frequency) for key in _CONSTANTS}

    def admittance(self, frequency: Frequencies) -> Complexes:
        """Return Y_m in siemens, shape (N,), at frequencies in Hz, shape (N,)."""
        motion = self._motion(frequency, {key: value for key, (value, _) in self.constants(frequency).items()})
        return motion.strength * motion.resonance.F

    def slopes(self, frequency: Frequencies) -> tuple[Complexes, dict[str, Complexes]]:
        """Return Y_m, as `admittance` does, and its derivative by every parameter, each of shape (N,), siemens."""
        constants = self.constants(frequency)
        m = self._motion(frequency, {key: value for key, (value, _) in constants.items()})
        Y = m.strength * m.resonance.F
        x = 1 + self.psi * m.bend
        by_effective = m.strength * m.resonance.by_log_eta
        by_eta = by_effective * (1 + self.psi * self._tau * m.eta**2 / (3 * x))
        by_tau = by_effective * (1 - 1 / x)
        by_sigma = Y / (1 + m.sigma) + m.strength * m.resonance.by_sigma
        by = {
            "s11E": -Y / m.plus - by_sigma * m.sigma / m.s11 + by_eta / 2 * (1 / m.plus + 1 / m.minus - 1 / m.s11),
            "s12E": -Y / m.plus - by_sigma / m.s11 + by_eta / 2 * (1 / m.plus - 1 / m.minus),
            "d31": m.by_d31 * m.resonance.F,
        }
        made: dict[str, Complexes] = {
            "area": (Y + by_eta / 2 - by_tau) / self.area,
            f"{self.name}.thickness": (-Y + 2 * by_tau) / self.thickness,
            f"{self.name}.density": by_eta / (2 * self.density),
            f"{self.name}.psi": by_effective * m.bend / x,
        }
        for key, slope in by.items():
            made |= {f"{self.name}.{key}.{part}": slope * size for part, size in constants[key][1].items()}
        return Y, made

    @property
    def _tau(self) -> float:
        """(t/D)^2."""
        return math.pi * self.thickness**2 / (4 * self.area)

    def _motion(self, frequency: Frequencies, constants: Mapping[str, Complexes]) -> _Motion:
        s11, s12, d31 = (constants[key] for key in ("s11E", "s12E", "d31"))
        sigma, plus, minus = -s12 / s11, s11 + s12, s11 - s12
        jw = j_omega(frequency)
        slowness = np.sqrt(self.density * plus * minus / s11)
        eta = -1j * jw * math.sqrt(self.area / math.pi) * slowness
        bend = self._tau * (eta**2 / 6 + 0.25)
        by_d31 = jw * self.area / self.thickness * 4 * d31 * (1 + sigma) / plus
        resonance = RadialResonance.at(eta * (1 + self.psi * bend), sigma)
        return _Motion(s11, sigma, plus, minus, eta, bend, by_d31, by_d31 * d31 / 2, resonance)

    def _law(self, constant: str) -> LossLaw:
        return self.laws.get(constant, CONSTANT)

    def _constant_parameters(self, constant: str) -> dict[str, float]:
        value, at = getattr(self, constant), f"{self.name}.{constant}"
        own = {f"{at}.re": value.real, f"{at}.im": value.imag}
        return own | {f"{at}.{key}": exponent for key, exponent in self._law(constant).parameters().items()}

    def _changes(self, values: Mapping[str, float]) -> dict[str, Any]:
        changes: dict[str, Any] = {"area": values.get("area", self.area)}
        for what in ("thickness", "density", "psi"):
            changes[what] = values.get(f"{self.name}.{what}", getattr(self, what))
        for constant in _CONSTANTS:
            old, at = getattr(self, constant), f"{self.name}.{constant}"
            changes[constant] = complex(values.get(f"{at}.re", old.real), values.get(f"{at}.im", old.imag))
        changes["laws"] = {key: law_with(law, values, f"{self.name}.{key}.") for key, law in self.laws.items()}
        return changes
