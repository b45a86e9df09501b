"""The piezoelectric layer: an acoustic line driven by a current at both faces, whose motion generates a voltage.

Mason's three-port (forces on the layer, velocities into it) adds to the line of stiffness c33D the same pressure
`H I` at both faces and the voltage `H (v1 + v2) + W I`, with `H = h33/(jw)` and `W = t/(jw eps33S)`; I is the
current density. With D and b of `acoustic_line` and loads Z1 (back), Z2 (front):

    v1 = -H (Z2 b + Zc D^2/2)/N,  v2 = -H (Z1 b + Zc D^2/2)/N,  N = (Zc - Z1)(Zc - Z2) b + Zc (Z1 + Z2),
    Z = W + H (v1 + v2).
"""

from dataclasses import dataclass

from ..base.arrays import Complexes
from .acoustic_line import Line
from .loss_laws import ComplexLike


@dataclass(slots=True, eq=False)
class ActiveLine(Line):
    """One piezoelectric layer at all frequencies."""

    H: Complexes
    """h33/(jw), shape (N,)."""
    W: Complexes
    """Clamped impedance t/(jw eps33S), ohm m2, shape (N,)."""
    poled: bool = True
    """Whether H is not zero."""

    def face_velocities(self, back: ComplexLike, front: ComplexLike) -> tuple[Complexes, Complexes]:
        """Return the velocities of back and front face into the layer per unit current density."""
        inner = self.D * self.D * (0.5 * self.Zc)
        total = (back - self.Zc) * (self.Zc - front) * self.b - (back + front) * self.Zc
        drive = self.H / total
        return drive * (front * self.b + inner), drive * (back * self.b + inner)

    def self_impedance(self, v1: ComplexLike, v2: ComplexLike) -> Complexes:
        """Return voltage per current density, ohm m2, from the result of `face_velocities`."""
        return self.W + self.H * (v1 + v2)

    def open_circuit_voltage(self, load: ComplexLike, share: ComplexLike) -> Complexes:
        """Return the voltage per velocity of one face into the layer, with `load` at the other and no current.

        `share` is the second result of `input_impedance(load)`.
        """
        return self.H * share * (0.5 * self.D * self.D + load * (1.0 / self.Zc) * self.b)

    def weights_driven(
        self, current: ComplexLike, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike
    ) -> dict[str, ComplexLike]:
        """Return d Z_el / d ln of the layer's quantities (d h33 itself), from the field and the layer's own current."""
        stress = self.H * current
        line = self.weights(v1, F1 - stress, v2, F2 - stress)
        clamped = current * current * self.W
        return {
            "thickness": line["theta"] + clamped,
            "density": 0.5 * (line["Zc"] + line["theta"]),
            "stiffness": line["stiffness"],
            "h33": 2.0 * current * (v1 - v2) / self.jw,
            "eps33S": -clamped,
        }
