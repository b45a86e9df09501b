"""The radial mode of a thin round disk, electroded on both faces: plane stress, all constants complex.

With a the radius, J(eta) = eta J0(eta)/J1(eta), eta = w a sqrt(density/c11p):

    Y = jw (pi a^2/t) eps33p [1 + 2 kp_IEEE^2/(J(eta) - 1 + sigma_p)]

(IEEE Std 176-1987; Sherrit et al., Ferroelectrics 119 (1991).) Finite thickness: a disk with T3 = 0 also moves through
its thickness, by S3 = -alpha (S1 + S2) + d33f E with alpha = c13E/c33E and d33f = e33/c33E, and that motion has mass.
With its kinetic energy (mu/2) S3^2, mu = density w^2 t^2/12, Hamilton's principle gives the thin disk's equations with
the constants c11p - mu alpha^2, c12p - mu alpha^2, e31p - mu alpha d33f, eps33p + mu d33f^2: the plane compliance
s11E + s12E increases, s11E - s12E does not change. Only real numbers are added, so a passive disk stays passive.
Resonances move by -alpha^2 (t/D)^2 [eta^2/6 + (1 - sigma_p)/3 eta^2/(eta^2 - 1 + sigma_p^2)], the first antiresonance
by -0.6 alpha^2 (t/D)^2 (finite elements: 0.61 to 0.67). Valid for mu alpha^2 small compared with c11p: over the first
three modes of Pz27 the error of ln Z against a two-dimensional solution is 0.03 % at D/t = 40, 0.4 % at 20, 25 % at 10.

The leading neglected term is of the order (mu/c11p)^2, the fourth power of thickness over wavelength: the motion
through the thickness has a shape of its own. In two dimensions the squares of the frequencies of modes two to four lie
below those of this model by 0.6 to 1.2 alpha^2 (mu/c11p)^2 (eleven ceramics of the library, D/t 20 to 40), 4e-4 of the
square at the second mode of Pz27 at D/t = 20: `RadialArm.formula_error`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals, j_omega
from ..base.errors import PzctlError
from ..constants.causal import continued
from ..stack.loss_laws import CONSTANT, LossLaw, law_with
from .bessel import RadialResonance

_CONSTANTS = ("s11E", "s12E", "d31")


class RadialError(PzctlError):
    """A disk with impossible sizes or constants."""


@dataclass(frozen=True, eq=False)
class _Motion:
    """Intermediate results between constants and admittance, each of shape (N,)."""

    mu: Complexes
    """density w^2 t^2/12, Pa: inertia of the motion through the thickness."""
    q: Complexes
    """Plane compliance of the thin disk divided by that with this inertia."""
    s11: Complexes
    sigma: Complexes
    plus: Complexes
    """s11E + s12E, with the mass; so are s11, sigma and d31."""
    minus: Complexes
    d31: Complexes
    by_d31: Complexes
    """jw (area/t) 4 d31 (1 + sigma)/(s11E + s12E): d strength / d d31."""
    strength: Complexes
    """jw (area/t) 2 d31^2 (1 + sigma)/(s11E + s12E), siemens."""
    resonance: RadialResonance


@dataclass(frozen=True)
class RadialArm:
    """Admittance that radial motion adds to that of a disk clamped in its plane.

    Y_m = jw (area/t) 2 d31^2 (1 + sigma_p)/(s11E + s12E)/(J - 1 + sigma_p). Raises RadialError where a size is not
    positive or the elastic energy would be negative.
    """

    name: str
    """Name of the layer: parameters are called `name.s11E.re` and so on."""
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
    alpha: float = 0.0
    """c13E/c33E, 0.64 to 0.75 for the usual ceramics; 0 is a disk of vanishing thickness."""
    d33f: float = 0.0
    """e33/c33E, C/N: d33 of a disk clamped in its plane; 1.0e-10 to 1.5e-10 for the usual ceramics."""
    laws: Mapping[str, LossLaw] = field(default_factory=dict[str, LossLaw])
    """Loss law by name of the constant; other constants are the same at all frequencies."""

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
        """Return `area`, `name.thickness`, `.density`, `.alpha`, `.d33f`, `.s11E.re`, ..., and the laws' exponents."""
        own = {"area": self.area}
        own |= {f"{self.name}.{what}": getattr(self, what) for what in ("thickness", "density", "alpha", "d33f")}
        for constant in _CONSTANTS:
            own |= self._constant_parameters(constant)
        return own

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the arm with these parameters; unknown names are ignored."""
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
        by_eta = m.strength * m.resonance.by_log_eta
        by_d31 = m.by_d31 * m.resonance.F
        by_s11, by_s12 = self._by_compliances(m, Y, by_eta)
        by_plus, by_minus = (by_s11 + by_s12) / 2, (by_s11 - by_s12) / 2
        alpha, d33f, mu, plus = self.alpha, self.d33f, m.mu, m.plus
        by_mu = alpha * plus * (2 * alpha * plus * by_plus + (2 * alpha * m.d31 - d33f) * by_d31)
        thin_d31 = constants["d31"][0]
        by_thin_plus = (by_plus + mu * alpha * (2 * alpha * thin_d31 - d33f) * by_d31) / m.q**2
        by = {"s11E": by_thin_plus + by_minus, "s12E": by_thin_plus - by_minus, "d31": by_d31 / m.q}
        made: dict[str, Complexes] = {
            "area": (Y + by_eta / 2) / self.area,
            f"{self.name}.thickness": (2 * mu * by_mu - Y) / self.thickness,
            f"{self.name}.density": (by_eta / 2 + mu * by_mu) / self.density,
            f"{self.name}.alpha": mu * plus * (4 * alpha * (plus * by_plus + m.d31 * by_d31) - d33f * by_d31),
            f"{self.name}.d33f": -mu * alpha * plus * by_d31,
        }
        for key, slope in by.items():
            made |= {f"{self.name}.{key}.{part}": slope * size for part, size in constants[key][1].items()}
        return Y, made

    def formula_error(self, frequency: Frequencies) -> Reals:
        """Return alpha^2 |mu/c11p|^2, shape (N,): relative size of the leading neglected term of c11p."""
        s11, s12 = (value for value, _ in (self.constants(frequency)[key] for key in ("s11E", "s12E")))
        return np.abs(self.alpha * self.mass(frequency) * (s11**2 - s12**2) / s11) ** 2

    def mass(self, frequency: Frequencies) -> Complexes:
        """Return mu = density w^2 t^2/12 in Pa, shape (N,)."""
        return -self.density * (j_omega(frequency) * self.thickness) ** 2 / 12

    def _motion(self, frequency: Frequencies, constants: Mapping[str, Complexes]) -> _Motion:
        s11, s12, d31 = (constants[key] for key in ("s11E", "s12E", "d31"))
        mu, thin, minus = self.mass(frequency), s11 + s12, s11 - s12
        q = 1 - 2 * mu * self.alpha**2 * thin
        d31, plus = (d31 - mu * self.alpha * self.d33f * thin) / q, thin / q
        s11 = (plus + minus) / 2
        sigma = (minus - plus) / (minus + plus)
        jw = j_omega(frequency)
        eta = -1j * jw * math.sqrt(self.area / math.pi) * np.sqrt(self.density * plus * minus / s11)
        by_d31 = jw * self.area / self.thickness * 4 * d31 * (1 + sigma) / plus
        return _Motion(mu, q, s11, sigma, plus, minus, d31, by_d31, by_d31 * d31 / 2, RadialResonance.at(eta, sigma))

    def _by_compliances(self, m: _Motion, Y: Complexes, by_eta: Complexes) -> tuple[Complexes, Complexes]:
        """Return dY/d s11E and dY/d s12E of a thin disk of the constants in `m`."""
        by_sigma = Y / (1 + m.sigma) + m.strength * m.resonance.by_sigma
        by_s11 = -Y / m.plus - by_sigma * m.sigma / m.s11 + by_eta / 2 * (1 / m.plus + 1 / m.minus - 1 / m.s11)
        by_s12 = -Y / m.plus - by_sigma / m.s11 + by_eta / 2 * (1 / m.plus - 1 / m.minus)
        return by_s11, by_s12

    def _law(self, constant: str) -> LossLaw:
        return self.laws.get(constant, CONSTANT)

    def _constant_parameters(self, constant: str) -> dict[str, float]:
        value, at = getattr(self, constant), f"{self.name}.{constant}"
        own = {f"{at}.re": value.real, f"{at}.im": value.imag}
        return own | {f"{at}.{key}": exponent for key, exponent in self._law(constant).parameters().items()}

    def _changes(self, values: Mapping[str, float]) -> dict[str, Any]:
        changes: dict[str, Any] = {"area": values.get("area", self.area)}
        for what in ("thickness", "density", "alpha", "d33f"):
            changes[what] = values.get(f"{self.name}.{what}", getattr(self, what))
        for constant in _CONSTANTS:
            old, at = getattr(self, constant), f"{self.name}.{constant}"
            changes[constant] = complex(values.get(f"{at}.re", old.real), values.get(f"{at}.im", old.imag))
        changes["laws"] = {key: law_with(law, values, f"{self.name}.{key}.") for key, law in self.laws.items()}
        return changes
