"""A thin layer over the electrodes of a disk, the same on both faces: printed silver, ink, wax.

It moves as the face does, with u_r and u_z, and is stretched with it, without stress on its own surface:
H grows by the integral of (K11 (S_rr^2 + S_tt^2) + 2 K12 S_rr S_tt - w^2 m (u_r^2 + u_z^2))/2 over the face, with
the strains S_rr = u_r' and S_tt = u_r/r, the mass per area m and stiffnesses K in N/m (`Coat.tension`). That is first
order in thickness; for 8 um of silver on 1.0 mm of ceramic it leaves 0.8 % of what they change (finite elements).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..base.face_loads import Coat
from .footprint import traces
from .full import Shape
from .line_elements import Matrix, Numbers
from .matrices import Face


def face_forms(face: Face, shapes: Reals) -> Reals:
    """Return the integrals over the electrode of an upper face between shapes over the unknowns, (3, nu, nu).

    Of u_r^2 + u_z^2, of the strains' sums of squares, and of twice their product; the first over a^2, 2 pi left out.
    """
    axial, radial = traces(face, shapes)
    line, end = face.line, face.electrode

    def integral(first: int, second: int, power: int) -> Matrix:
        return line.integral(first, second, lambda x: x**power * (x < end))

    mass, stretched, around, both = integral(0, 0, 1), integral(1, 1, 1), integral(0, 0, -1), integral(1, 0, 0)
    # on the axis u_r is 0, and the weight 1/x of its node means nothing
    inner = radial[1:]
    made = [
        axial.T @ (mass @ axial) + radial.T @ (mass @ radial),
        inner.T @ ((stretched + around)[1:, 1:] @ inner),
        inner.T @ ((both + both.T)[1:, 1:] @ inner),
    ]
    return np.array(made)


@dataclass(frozen=True, eq=False)
class Coating:
    """A coat between the shapes of a reduced disk."""

    mass: Reals
    """Over the weight of the mass matrix, shape (nu, nu)."""
    stiffness: Complexes
    """Shape (nu, nu), J/m2."""

    @classmethod
    def of(cls, forms: Reals, coat: Coat, shape: Shape) -> Self:
        """Return the coat between the shapes of these `face_forms`."""
        along, across = coat.tension
        return cls(coat.mass * shape.radius**2 / shape.mass * forms[0], along * forms[1] + across * forms[2])


def change_by(coat: Coat, shape: Shape, moved: Numbers, frequency: Frequencies) -> Complexes:
    """Return what a coat adds to the form of a disk, shape (N,), from the `face_forms` of its motion, (N, 3)."""
    along, across = coat.tension
    inertia = -((2 * np.pi * frequency) ** 2) * coat.mass * shape.radius**2
    return inertia * moved[:, 0] + along * moved[:, 1] + across * moved[:, 2]
