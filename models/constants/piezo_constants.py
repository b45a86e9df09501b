"""The constants of thickness and radial mode, complex, in all their forms. SI units, exp(+jwt).

A lossy stiffness is c (1 + j/Q), a lossy permittivity eps (1 - j tan d), a lossy compliance s (1 - j/Q).
Sources: IEEE Std 176-1987; thesis table 2.2 (Tjelde, NTNU 2012), with eq. (2.4) corrected: the relation between
eps33S and eps33T of a disk carries both couplings.
"""

import cmath
import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from .constitutive import ConstitutiveLaw

EPS0 = 8.8541878128e-12
"""Permittivity of free space, F/m (CODATA 2018)."""


@dataclass(frozen=True)
class Thickness:
    """Thickness mode of a wide plate: the only strain is S3, the lateral faces do not move."""

    c33D: complex
    """Stiffness at constant displacement, Pa."""
    h33: complex
    """Piezoelectric constant, V/m."""
    eps33S: complex
    """Permittivity at constant strain, F/m."""

    @classmethod
    def from_e_form(cls, c33E: complex, e33: complex, eps33S: complex) -> Self:
        """T = c33E S - e33 E, D = e33 S + eps33S E. Pa, C/m2, F/m."""
        return cls(c33E + e33**2 / eps33S, e33 / eps33S, eps33S)

    @classmethod
    def from_d_form(cls, s33E: complex, d33: complex, eps33X: complex) -> Self:
        """S = s33E T + d33 E, D = d33 T + eps33X E, all laterally clamped. 1/Pa, C/N, F/m."""
        return cls.from_e_form(1 / s33E, d33 / s33E, eps33X - d33**2 / s33E)

    @classmethod
    def from_g_form(cls, s33D: complex, g33: complex, eps33X: complex) -> Self:
        """S = s33D T + g33 D, E = -g33 T + D/eps33X, all laterally clamped. 1/Pa, V m/N, F/m."""
        return cls(1 / s33D, g33 / s33D, eps33X / (1 + g33**2 * eps33X / s33D))

    @classmethod
    def from_coupling(cls, c33D: complex, kt: complex, eps33S: complex) -> Self:
        """From kt, with h33 of the sign of kt."""
        return cls(c33D, kt * cmath.sqrt(c33D / eps33S), eps33S)

    @property
    def e33(self) -> complex:
        """C/m2."""
        return self.h33 * self.eps33S

    @property
    def c33E(self) -> complex:
        """Pa."""
        return self.c33D - self.h33**2 * self.eps33S

    @property
    def s33D(self) -> complex:
        """1/c33D, 1/Pa: laterally clamped, not the tensor's s33D."""
        return 1 / self.c33D

    @property
    def s33E(self) -> complex:
        """1/c33E, 1/Pa: laterally clamped, not the tensor's s33E."""
        return 1 / self.c33E

    @property
    def g33(self) -> complex:
        """h33/c33D, V m/N: laterally clamped."""
        return self.h33 / self.c33D

    @property
    def d33(self) -> complex:
        """e33/c33E, C/N: laterally clamped."""
        return self.e33 / self.c33E

    @property
    def eps33X(self) -> complex:
        """eps33S + e33^2/c33E, F/m: free along the axis, laterally clamped; the table 2.2 of the thesis says eps^T."""
        return self.eps33S + self.e33**2 / self.c33E

    @property
    def kt(self) -> complex:
        """Thickness coupling: kt^2 = h33^2 eps33S/c33D, with the sign of h33."""
        return self.h33 * cmath.sqrt(self.eps33S / self.c33D)

    @property
    def Qm(self) -> float:
        """c33D'/c33D''; infinite without loss."""
        return quality(self.c33D)

    @property
    def tan_delta(self) -> float:
        """-eps33S''/eps33S'."""
        return -self.eps33S.imag / self.eps33S.real

    @property
    def law(self) -> ConstitutiveLaw:
        """The law in its form strain_D, one stress and one field."""
        return ConstitutiveLaw("strain_D", *(np.array([[constant]]) for constant in (self.c33D, self.h33, self.eps33S)))

    def speed(self, density: float) -> complex:
        """Return sqrt(c33D/density) in m/s; density in kg/m3."""
        return cmath.sqrt(self.c33D / density)


@dataclass(frozen=True)
class Radial:
    """Radial mode of a thin disk, poled along its axis: the stresses are T1 and T2 in the plane, T3 = 0."""

    s11E: complex
    """1/Pa."""
    s12E: complex
    """1/Pa, negative."""
    d31: complex
    """C/N, negative."""
    eps33T: complex
    """F/m."""

    @classmethod
    def from_planar(cls, c11p: complex, sigma_p: complex, kp: complex, eps33T: complex) -> Self:
        """From stiffness, Poisson ratio and planar coupling `kp` (not `kp_IEEE`); d31 gets the sign of -kp."""
        s11E = 1 / (c11p * (1 - sigma_p**2))
        d31 = -kp * cmath.sqrt(eps33T * s11E * (1 - sigma_p) / 2)
        return cls(s11E, -sigma_p * s11E, d31, eps33T)

    @classmethod
    def from_sherrit(cls, c11p: complex, sigma_p: complex, kp_IEEE: complex, eps33p: complex) -> Self:
        """From the constants that the radial resonance itself shows (Sherrit et al., Ferroelectrics 119 (1991))."""
        eps33T = eps33p * (1 + 2 * kp_IEEE**2 / (1 + sigma_p))
        e31p = -kp_IEEE * cmath.sqrt(c11p * eps33p)
        s11E = 1 / (c11p * (1 - sigma_p**2))
        return cls(s11E, -sigma_p * s11E, e31p * s11E * (1 - sigma_p), eps33T)

    @classmethod
    def from_e_form(cls, c11p: complex, c12p: complex, e31p: complex, eps33p: complex) -> Self:
        """T1 = c11p S1 + c12p S2 - e31p E, D = e31p (S1 + S2) + eps33p E. Pa, Pa, C/m2, F/m."""
        sigma = c12p / c11p
        s11E = 1 / (c11p * (1 - sigma**2))
        d31 = e31p / (c11p + c12p)
        return cls(s11E, -sigma * s11E, d31, eps33p + 2 * e31p * d31)

    @classmethod
    def from_g_form(cls, s11D: complex, s12D: complex, g31: complex, eps33T: complex) -> Self:
        """S1 = s11D T1 + s12D T2 + g31 D, E = -g31 (T1 + T2) + D/eps33T. 1/Pa, 1/Pa, V m/N, F/m."""
        d31 = g31 * eps33T
        return cls(s11D + d31 * g31, s12D + d31 * g31, d31, eps33T)

    @classmethod
    def from_h_form(cls, c11pD: complex, c12pD: complex, h31p: complex, eps33p: complex) -> Self:
        """T1 = c11pD S1 + c12pD S2 - h31p D, E = -h31p (S1 + S2) + D/eps33p. Pa, Pa, V/m, F/m."""
        e31p = h31p * eps33p
        return cls.from_e_form(c11pD - e31p * h31p, c12pD - e31p * h31p, e31p, eps33p)

    @property
    def law(self) -> ConstitutiveLaw:
        """The law in its form stress_E, stresses T1 and T2 and one field."""
        s = np.array([[self.s11E, self.s12E], [self.s12E, self.s11E]])
        return ConstitutiveLaw("stress_E", s, np.array([[self.d31, self.d31]]), np.array([[self.eps33T]]))

    @property
    def sigma_p(self) -> complex:
        """Planar Poisson ratio -s12E/s11E."""
        return -self.s12E / self.s11E

    @property
    def c11p(self) -> complex:
        """s11E/(s11E^2 - s12E^2), Pa; not 1/s11E, with which the thesis's tables 4.8 and A.1 confuse it."""
        return self.s11E / ((self.s11E - self.s12E) * (self.s11E + self.s12E))

    @property
    def c12p(self) -> complex:
        """sigma_p c11p, Pa."""
        return self.sigma_p * self.c11p

    @property
    def e31p(self) -> complex:
        """d31/(s11E + s12E), C/m2."""
        return self.d31 / (self.s11E + self.s12E)

    @property
    def eps33p(self) -> complex:
        """Permittivity with the disk's plane clamped, its faces free: eps33T (1 - kp^2), F/m."""
        return self.eps33T - 2 * self.d31 * self.e31p

    @property
    def kp(self) -> complex:
        """Planar coupling of the data sheets: kp^2 = 2 d31^2/[eps33T (s11E + s12E)]; positive for negative d31."""
        return -self.d31 * cmath.sqrt(2 / (self.eps33T * (self.s11E + self.s12E)))

    @property
    def kp_IEEE(self) -> complex:
        """Sherrit's k^p: its square is e31p^2/(c11p eps33p) = (1 + sigma_p)/2 kp^2/(1 - kp^2). Not `kp`."""
        return -self.e31p / cmath.sqrt(self.c11p * self.eps33p)

    @property
    def g31(self) -> complex:
        """d31/eps33T, V m/N."""
        return self.d31 / self.eps33T

    @property
    def h31p(self) -> complex:
        """e31p/eps33p, V/m."""
        return self.e31p / self.eps33p

    @property
    def s11D(self) -> complex:
        """1/Pa."""
        return self.s11E - self.d31 * self.g31

    @property
    def s12D(self) -> complex:
        """1/Pa."""
        return self.s12E - self.d31 * self.g31

    @property
    def c11pD(self) -> complex:
        """Pa."""
        return self.c11p + self.e31p * self.h31p

    @property
    def c12pD(self) -> complex:
        """Pa."""
        return self.c12p + self.e31p * self.h31p

    @property
    def Qm(self) -> float:
        """c11p'/c11p''; infinite without loss."""
        return quality(self.c11p)


def quality(stiffness: complex) -> float:
    """Return the quality factor Re/Im of a stiffness; infinite without loss."""
    return stiffness.real / stiffness.imag if stiffness.imag else math.inf


def clamped_permittivity(eps33T: complex, kp: complex, kt: complex) -> complex:
    """Return eps33S = eps33T (1 - kp^2)(1 - kt^2), F/m.

    Exact for class 6mm; the thesis's (2.4) leaves out the planar factor (Pz27: 1403 instead of 914).
    """
    return eps33T * (1 - kp**2) * (1 - kt**2)
