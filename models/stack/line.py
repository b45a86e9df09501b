"""The acoustic line: what a wave meets in a layer, seen from one face with a load at the other.

All quantities are per area: pressure F (Pa, compressive), velocity v (m/s, towards the front), specific acoustic
impedance F/v (Rayl). A layer of characteristic impedance Zc and phase `theta = gamma t` (gamma = jw/v) enters only
through `D = 1 - exp(-theta)`, computed without cancellation. With `B = 1 - exp(-2 theta) = D(2 - D)` and
`A = 1 + exp(-2 theta) = 2 - B` a load Z_L is seen as

    Z = Zc (Z_L A + Zc B) / (Zc A + Z_L B).

There is no tan with its poles, nothing overflows for a thick lossy backing (exp(-theta) -> 0), and no digit is lost
for a glue line at 40 Hz (D -> theta).
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Complexes, Reals
from .laws import ComplexLike


def one_minus_exp(decay: Reals, turn: Reals) -> Complexes:
    """Return 1 - exp(-(decay + j turn)), of the shape of the arguments, to rounding for any size of them.

    Real functions of the half angle: np.tan and np.expm1 are vectorised where np.exp of complex numbers is not, and
    sin and cos of `turn` follow without cancellation. At a pole of the tangent it is large but finite.
    """
    tangent = np.tan(0.5 * turn)
    square = tangent * tangent
    scale = 1.0 / (1.0 + square)
    shrink = np.expm1(-decay)
    result = np.empty(np.shape(turn), np.complex128)
    result.real = (2.0 * square - shrink * (1.0 - square)) * scale
    result.imag = 2.0 * tangent * scale * (1.0 + shrink)
    return result


@dataclass(frozen=True, slots=True)
class Line:
    """One layer at all frequencies."""

    Zc: ComplexLike
    """Characteristic specific acoustic impedance sqrt(rho c33), Rayl."""
    theta: Complexes
    """gamma t, shape (N,)."""
    D: Complexes
    """1 - exp(-theta), shape (N,)."""
    B: Complexes
    """1 - exp(-2 theta), shape (N,)."""
    A: Complexes
    """1 + exp(-2 theta), shape (N,)."""

    def seen(self, load: ComplexLike) -> Complexes:
        """Return the impedance of one face in Rayl, with `load` (Rayl) at the other."""
        ratio = load / self.Zc
        return self.Zc * (ratio * self.A + self.B) / (ratio * self.B + self.A)

    def passed(self, load: ComplexLike) -> Complexes:
        """Return the velocity of the far face, which carries `load`, per velocity of the near face."""
        return 2.0 * (1.0 - self.D) / (load / self.Zc * self.B + self.A)

    def weights(self, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike) -> dict[str, Complexes]:
        """Return how the terminals feel the layer: d Z_el / d ln Zc and d Z_el / d ln theta, ohm m2.

        `v` and `F` are those of the back (1) and front (2) face, per unit current density. Reciprocity makes every
        derivative of the terminals' impedance a quadratic form of this field; written in the two waves that enter
        the layer, one at each face, nothing cancels.
        """
        forward = v1 + F1 / self.Zc
        backward = v2 - F2 / self.Zc
        half = 0.5 * self.Zc
        return {
            "Zc": 0.5 * half * self.B * (forward * forward + backward * backward),
            "theta": 2.0 * half * self.theta * (1.0 - self.D) * forward * backward,
        }
