"""The acoustic line: a wave in one layer, seen from one face with a load at the other.

All quantities are per area: pressure F (Pa, compressive), velocity v (m/s, towards the front), specific acoustic
impedance F/v (Rayl). A layer of characteristic impedance Zc and phase `theta = gamma t` (gamma = jw/v) enters only
through `D = 1 - exp(-theta)`, computed without cancellation, and `b = (1 - exp(-2 theta))/2 = D (1 - D/2)`. With
`q = (Z_L - Zc) b` and `share = Zc/(Zc + q)` the input impedance for a load Z_L is

    Z = (Z_L - q) share        and the far face's velocity is exp(-theta) share times the near face's.

This is Z = Zc (Z_L cosh + Zc sinh)/(Zc cosh + Z_L sinh) without tan and its poles: nothing overflows for a thick
lossy backing (exp(-theta) -> 0), and no digit is lost for a glue line at 40 Hz (D -> theta).
"""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Complexes, Reals
from .loss_laws import ComplexLike


def one_minus_exp(growth: Reals, half_turn: Reals) -> Complexes:
    """Return 1 - exp(growth - 2j half_turn), accurate to rounding for arguments of any size, in their shape.

    Uses real functions of the half angle: NumPy vectorises np.tan and np.expm1 but not np.exp of complex numbers, and
    sin and cos of the full angle follow without cancellation. At a pole of the tangent it is large but finite.
    """
    tangent = np.tan(half_turn)
    square = tangent * tangent
    scale = 1.0 / (1.0 + square)
    grown = np.expm1(growth)
    result = np.empty(half_turn.shape, np.complex128)
    # cos = (1 - square) scale and sin = 2 tangent scale; the real part is (1 - cos) - grown cos
    result.real = (square * (2.0 + grown) - grown) * scale
    result.imag = (tangent * scale) * (2.0 + 2.0 * grown)
    return result


@dataclass(slots=True, eq=False)  # not frozen: created for every evaluation, and frozen ones are slow to create
class Line:
    """One layer at all frequencies."""

    Zc: ComplexLike
    """Characteristic specific acoustic impedance sqrt(rho c33), Rayl."""
    delay: ComplexLike
    """t/v, s, so that theta = jw delay."""
    jw: Complexes
    """j times the angular frequency, rad/s, shape (N,)."""
    D: Complexes
    """1 - exp(-theta), shape (N,)."""
    b: Complexes
    """(1 - exp(-2 theta))/2, shape (N,)."""

    def input_impedance(self, load: ComplexLike) -> tuple[Complexes, Complexes]:
        """Return the input impedance of one face in Rayl with `load` (Rayl) at the other, and `share`."""
        q = (load - self.Zc) * self.b
        share = self.Zc / (self.Zc + q)
        return (load - q) * share, share

    def transmission(self, share: ComplexLike) -> ComplexLike:
        """Return the far face's velocity per velocity of the near face, from the second result of `input_impedance`."""
        return (1.0 - self.D) * share

    def weights(self, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike) -> dict[str, ComplexLike]:
        """Return the sensitivity of the terminals to the layer: d Z_el / d ln of its quantities, ohm m2.

        `v` and `F` are those of the back (1) and front (2) face per unit current density. By reciprocity every
        derivative of the terminal impedance is a quadratic form of this field; written in the two waves that enter the
        layer, one at each face, nothing cancels.
        """
        yc = 1.0 / self.Zc
        forward = v1 + F1 * yc
        backward = v2 - F2 * yc
        by_Zc = (forward * forward + backward * backward) * self.b * (0.5 * self.Zc)
        by_theta = (1.0 - self.D) * forward * backward * self.jw * (self.Zc * self.delay)
        return {"Zc": by_Zc, "theta": by_theta, "stiffness": 0.5 * (by_Zc - by_theta)}
