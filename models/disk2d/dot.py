"""A round piece of an elastic solid on a face, a dot of solder or glue: what a stress on its base moves there.

Ritz's method in r and z: the displacements are sums of products of Legendre polynomials, symmetric about the axis, in a
body of height h (1 + d (1 - 2 s^2)) over a base of radius R, s = r/R; d is 0 for a cylinder, 1 for a paraboloid that
ends in a sharp rim. Free but for the stress on its base, the body has eigenfrequencies w_k (the first is 0: it moves as
a whole) and a base that answers unit stresses with P^T [X_k X_k^T / (w_k^2 (1 + j/q) - w^2)] P.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from ..base.arrays import Complexes, Frequencies, Reals, softened
from ..base.face_loads import Dot
from .footprint import rule, stresses

_MARGIN, _MOST = 4, 12
# Degree beyond one for each two radians of a shear wave, as of the layers of a stack in two dimensions, and the highest
# one: a dot of so many wavelengths only damps.
_DEPENDENT = 1e-12
# Sums of Ritz functions whose mass is less than this part of the largest are left out: rounding determines them.


@dataclass(frozen=True, eq=False)
class DotBody:
    """A dot over a base of radius R."""

    dot: Dot
    radius: float
    """R, m."""
    highest: float
    """Highest frequency asked of it, Hz."""
    count: int
    """Number of functions of pressure and of shear stress on its base."""

    def receptance(self, frequency: Frequencies) -> Complexes:
        """Return what unit stresses on the base move there, 2 pi left out, shape (N, K, K); m4/Pa.

        Stresses and the moments of displacements are those of `footprint.stresses`.
        """
        squared, base = self._modes
        w = 2 * np.pi * frequency
        turned = (1 + 1j / self.dot.q) * softened(self.dot.damping)
        answers = 1 / (squared * turned - (w**2)[:, None])
        return np.einsum("ki,nk,kl->nil", base, answers, base, optimize=True)

    @cached_property
    def _modes(self) -> tuple[Reals, Reals]:
        """Squared angular eigenfrequencies, shape (M,), and moments of the modes on the base, shape (M, K)."""
        stiffness, mass, base = self._matrices()
        own, turned = np.linalg.eigh(mass)
        kept = own > _DEPENDENT * own[-1]
        turned = turned[:, kept] / np.sqrt(own[kept])
        squared, modes = np.linalg.eigh(turned.T @ stiffness @ turned)
        return np.maximum(squared, 0.0), (turned @ modes).T @ base

    def _degree(self, length: float) -> int:
        return min(_MOST, math.ceil(phase(self.dot, length, self.highest) / 2) + _MARGIN)

    def _matrices(self) -> tuple[Reals, Reals, Reals]:
        """Stiffness and mass over the Ritz functions, and the moments of these on the base, 2 pi left out."""
        dot, R, h = self.dot, self.radius, self.dot.height
        own = _integrals(self._degree(R), self._degree(h), dot.dome, self.count)
        lame, shear = dot.lame
        in_plane = lame * own.dilated + 2 * shear * own.strained + shear * (R / h) ** 2 * own.slid_by_z
        axial = (R / h) ** 2 * (lame + 2 * shear) * own.stretched + shear * own.slid_by_s
        both = R / h * (lame * own.dilated_stretched + shear * own.slid_both)
        stiffness = h * np.block([[in_plane, both], [both.T, axial]])
        nothing = np.zeros_like(own.mass_s)
        mass = dot.density * R**2 * h * np.block([[own.mass_s, nothing], [nothing, own.mass_z]])
        none = np.zeros_like(own.base_z)
        return stiffness, mass, R**2 * np.block([[none, own.base_s], [own.base_z, none]])


def phase(dot: Dot, length: float, frequency: float) -> float:
    """Return a length in m in radians of a shear wave in the dot at a frequency in Hz."""
    shear = dot.speed * math.sqrt((1 - 2 * dot.poisson) / (2 - 2 * dot.poisson))
    return 2 * math.pi * frequency * length / shear


@dataclass(frozen=True, eq=False)
class _Integrals:
    """Integrals of Ritz functions u_s = s f and u_z = f over s ds dy, y = z/h."""

    dilated: Reals
    """Of the areal strains of u_s, products of their sums."""
    strained: Reals
    """The same, sums of their products."""
    stretched: Reals
    """Of du_z/dy."""
    dilated_stretched: Reals
    """Of the areal strain and du_z/dy."""
    slid_by_z: Reals
    """Of du_s/dy."""
    slid_by_s: Reals
    """Of du_z/ds."""
    slid_both: Reals
    """Of du_s/dy and du_z/ds."""
    mass_s: Reals
    mass_z: Reals
    base_s: Reals
    """Of u_s on the base and each function of the shear stress."""
    base_z: Reals
    """Of u_z on the base and each function of the pressure."""


@lru_cache(maxsize=32)
def _integrals(along_s: int, along_z: int, dome: float, count: int) -> _Integrals:
    """Return the integrals over functions of these numbers of polynomials of 2 s^2 - 1 and of the height.

    `count`: of functions of stress on the base.
    """
    points, weights = (np.asarray(one, np.float64) for one in leggauss(max(along_s, along_z) + 6))
    points, weights = (points + 1) / 2, weights / 2
    local = 1 + dome * (1 - 2 * points**2)
    s, y = np.repeat(points, points.size), np.outer(local, points).ravel()
    over = np.outer(weights * local * points, weights).ravel()
    x, top = 2 * s**2 - 1, 1 + dome
    at_s, at_z = _legendre(along_s, x), _legendre(along_z, 2 * y / top - 1)

    def products(first: Reals, second: Reals) -> Reals:
        return (first[:, None] * second[None, :]).reshape(along_s * along_z, -1)

    f, by_s, by_y = (
        products(at_s[0], at_z[0]),
        products(at_s[1] * 4 * s, at_z[0]),
        products(at_s[0], at_z[1] * 2 / top),
    )
    radial, around = by_s * s + f, f
    areal = radial + around
    below, under = rule(np.array([0.0, 1.0]))
    at_base = products(_legendre(along_s, 2 * below**2 - 1)[0], _legendre(along_z, np.full(below.size, -1.0))[0])
    at_base = at_base * under
    return _Integrals(
        dilated=(areal * over) @ areal.T,
        strained=(radial * over) @ radial.T + (around * over) @ around.T,
        stretched=(by_y * over) @ by_y.T,
        dilated_stretched=(areal * over) @ by_y.T,
        slid_by_z=(by_y * s**2 * over) @ by_y.T,
        slid_by_s=(by_s * over) @ by_s.T,
        slid_both=(by_y * s * over) @ by_s.T,
        mass_s=(f * s**2 * over) @ f.T,
        mass_z=(f * over) @ f.T,
        base_s=(at_base * below**2) @ stresses(below, count),
        base_z=at_base @ stresses(below, count),
    )


def _legendre(count: int, x: Reals) -> tuple[Reals, Reals]:
    """Return the first Legendre polynomials and their derivatives at x, shapes (count, P)."""
    values = np.asarray(legvander(x, count - 1), np.float64).T
    slopes = np.zeros_like(values)
    for k in range(1, count):  # P'(k) = P'(k - 2) + (2 k - 1) P(k - 1)
        slopes[k] = (slopes[k - 2] if k > 1 else 0.0) + (2 * k - 1) * values[k - 1]
    return values, slopes
