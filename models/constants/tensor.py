"""All ten complex constants of a poled ceramic (class 6mm), and every matrix that follows from them.

Axis 3 is the poling direction; Voigt order 11 22 33 23 13 12.
"""

import sys
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..base.arrays import Complexes
from ..base.errors import PzctlError
from .constitutive import ConstitutiveLaw, convert
from .piezo_constants import Radial, Thickness

_SYMMETRY_TOLERANCE = 1e-9
"""Of the largest element of a matrix; below the least normal number there are no digits left to compare."""


class TensorError(PzctlError):
    """Matrices that do not belong to a poled ceramic."""


@dataclass(frozen=True)
class Tensor6mm:
    """The constants of a poled ceramic at constant field and strain; complex, SI."""

    c11E: complex
    """Pa."""
    c12E: complex
    """Pa."""
    c13E: complex
    """Pa."""
    c33E: complex
    """Pa."""
    c44E: complex
    """Pa."""
    e31: complex
    """C/m2."""
    e33: complex
    """C/m2."""
    e15: complex
    """C/m2."""
    eps11S: complex
    """F/m."""
    eps33S: complex
    """F/m."""

    @property
    def c66E(self) -> complex:
        """Pa: (c11E - c12E)/2, because the ceramic is isotropic about its axis."""
        return (self.c11E - self.c12E) / 2

    @property
    def law(self) -> ConstitutiveLaw:
        """The full law, form strain_E: cE (6, 6), e (3, 6), epsS (3, 3)."""
        c = np.zeros((6, 6), complex)
        c[0, 0] = c[1, 1] = self.c11E
        c[0, 1] = c[1, 0] = self.c12E
        c[:2, 2] = c[2, :2] = self.c13E
        c[2, 2] = self.c33E
        c[3, 3] = c[4, 4] = self.c44E
        c[5, 5] = self.c66E
        e = np.zeros((3, 6), complex)
        e[2, :2], e[2, 2] = self.e31, self.e33
        e[0, 4] = e[1, 3] = self.e15
        return ConstitutiveLaw("strain_E", c, e, np.diag([self.eps11S, self.eps11S, self.eps33S]).astype(complex))

    @classmethod
    def from_law(cls, law: ConstitutiveLaw) -> Self:
        """Return the constants of a full law in any form. Raises TensorError if it does not have the symmetry 6mm."""
        at = convert(law, "strain_E")
        c, e, eps = at.elastic, at.piezo, at.dielectric
        made = cls(c[0, 0], c[0, 1], c[0, 2], c[2, 2], c[3, 3], e[2, 0], e[2, 2], e[0, 4], eps[0, 0], eps[2, 2])
        for name, given, own in (
            ("stiffness", c, made.law.elastic),
            ("piezoelectric", e, made.law.piezo),
            ("permittivity", eps, made.law.dielectric),
        ):
            size = float(np.abs(given).max())
            worst = float(np.abs(given - own).max())
            if worst > _SYMMETRY_TOLERANCE * max(size, sys.float_info.min):
                raise TensorError(
                    f"full tensor: the {name} matrix departs from the symmetry 6mm by {worst / size:.2g} of its "
                    f"largest element; at most {_SYMMETRY_TOLERANCE:g} is allowed"
                )
        return made

    @property
    def cE(self) -> Complexes:
        """Pa, shape (6, 6)."""
        return self.law.elastic

    @property
    def cD(self) -> Complexes:
        """Pa, shape (6, 6)."""
        return convert(self.law, "strain_D").elastic

    @property
    def sE(self) -> Complexes:
        """1/Pa, shape (6, 6)."""
        return convert(self.law, "stress_E").elastic

    @property
    def sD(self) -> Complexes:
        """1/Pa, shape (6, 6)."""
        return convert(self.law, "stress_D").elastic

    @property
    def e(self) -> Complexes:
        """C/m2, shape (3, 6)."""
        return self.law.piezo

    @property
    def d(self) -> Complexes:
        """C/N, shape (3, 6)."""
        return convert(self.law, "stress_E").piezo

    @property
    def g(self) -> Complexes:
        """V m/N, shape (3, 6)."""
        return convert(self.law, "stress_D").piezo

    @property
    def h(self) -> Complexes:
        """V/m, shape (3, 6)."""
        return convert(self.law, "strain_D").piezo

    @property
    def epsS(self) -> Complexes:
        """F/m, shape (3, 3)."""
        return self.law.dielectric

    @property
    def epsT(self) -> Complexes:
        """F/m, shape (3, 3)."""
        return convert(self.law, "stress_E").dielectric

    @property
    def thickness(self) -> Thickness:
        """Constants of the thickness mode of a wide plate (no lateral strain)."""
        return Thickness.from_e_form(self.c33E, self.e33, self.eps33S)

    @property
    def radial(self) -> Radial:
        """Constants of the radial mode of a thin disk (no stress along the axis)."""
        at = convert(self.law, "stress_E")
        s, d, eps = at.elastic, at.piezo, at.dielectric
        return Radial(complex(s[0, 0]), complex(s[0, 1]), complex(d[2, 0]), complex(eps[2, 2]))
