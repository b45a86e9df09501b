"""The piezoelectric layer: an acoustic line that a current drives at both faces and that hears their approach.

Mason's three-port (forces on the layer, velocities into it) adds to the line of stiffness c33D the same pressure
`H I` at both faces and the voltage `H (v1 + v2) + W I`, with `H = h33/(jw)` and `W = t/(jw eps33S)`; I is the
current density. Written with D, A and B of `line` and loads Z1 (back), Z2 (front):

    v1 = -H (Z2 B + Zc D^2)/N,  v2 = -H (Z1 B + Zc D^2)/N,  N = B (Zc^2 + Z1 Z2) + Zc (Z1 + Z2) A,
    Z = W + H (v1 + v2).
"""

from dataclasses import dataclass

from ..arrays import Complexes
from .laws import ComplexLike
from .line import Line


@dataclass(frozen=True, slots=True)
class ActiveLine(Line):
    """One piezoelectric layer at all frequencies."""

    H: Complexes
    """h33/(jw), shape (N,)."""
    W: Complexes
    """Clamped impedance t/(jw eps33S), ohm m2, shape (N,)."""

    def radiates(self, back: ComplexLike, front: ComplexLike) -> tuple[Complexes, Complexes]:
        """Return the velocities of back and front face into the layer per unit current density."""
        inner = self.Zc * self.D * self.D
        total = self.B * (self.Zc * self.Zc + back * front) + self.Zc * (back + front) * self.A
        drive = -self.H / total
        return drive * (front * self.B + inner), drive * (back * self.B + inner)

    def self_impedance(self, v1: ComplexLike, v2: ComplexLike) -> Complexes:
        """Return voltage per current density, ohm m2, from the velocities that `radiates` gave."""
        return self.W + self.H * (v1 + v2)

    def hears(self, load: ComplexLike) -> Complexes:
        """Return the voltage per velocity of one face into the layer, with `load` at the other and no current."""
        inner = self.Zc * self.D * self.D
        return self.H * (inner + load * self.B) / (self.Zc * self.A + load * self.B)

    def weights_driven(
        self, current: ComplexLike, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike
    ) -> dict[str, Complexes]:
        """Return d Z_el / d ln of Zc, theta, h and W, ohm m2, from the field at the faces and the layer's current."""
        stress = self.H * current
        squeeze = stress * (v1 - v2)
        elastic = self.weights(v1, F1 - stress, v2, F2 - stress)
        return elastic | {"h": 2.0 * squeeze, "W": current * current * self.W}
