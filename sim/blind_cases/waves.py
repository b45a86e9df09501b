"""One column of a transducer: plane waves in slices, solved as an initial-value problem from the back face.

In a slice the displacement u and the stress T obey du/dz = (T + h D)/c, dT/dz = -w^2 rho u, and the potential falls by
D l/eps - h du. The propagator of a slice is the power series of its matrix exponential, doubled until it spans the
slice; no trigonometric function, no equivalent circuit. Everything is linear in the displacement of the back face and
in the displacement field D, so two columns of numbers are carried and the front face fixes their ratio.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complexfloating[Any, Any]]
Reals = NDArray[np.floating[Any]]
_TERMS = 9
_SMALL = 0.5


@dataclass(frozen=True, eq=False)
class Slice:
    """A homogeneous slice: m, kg/m3, Pa; for a piezoelectric one also h33 (V/m) and eps33S (F/m).

    Stiffness and permittivity may be one number or one for each frequency, shape (N,); thickness one number or several
    that are solved at once, shape (K, 1).
    """

    thickness: float | Reals
    density: float
    stiffness: complex | Complexes
    h: complex | Complexes = 0.0
    permittivity: complex | Complexes | None = None
    """None: no electrodes around it, no field in it."""


@dataclass(frozen=True)
class InterfaceSheet:
    """A mass without thickness, kg/m2."""

    mass: float


Part = Slice | InterfaceSheet


@dataclass(frozen=True, eq=False)
class LayerColumn:
    """The slices from back to front, and the specific impedances (Rayl) of the media behind and in front."""

    parts: tuple[Part, ...]
    back: complex | Complexes
    front: complex | Complexes


@dataclass(frozen=True, eq=False)
class Response:
    """Impedance times area (ohm m2), and the mean strain of the piezoelectric slices per D (m2/C); shape (N,)."""

    specific_impedance: Complexes
    strain: Complexes


def propagator(omega: Reals, part: Slice) -> tuple[Complexes, Complexes]:
    """Return the even and odd sums of the exponential of a slice, the odd one in metres; shape (N,)."""
    x = -(omega**2) * part.density / part.stiffness * part.thickness**2
    doublings = max(0, int(np.ceil(np.log2(np.sqrt(np.max(np.abs(x))) / _SMALL))))
    y = np.asarray(x / 4.0**doublings, np.complex128)
    even, odd = np.ones_like(y), np.ones_like(y)
    term = np.ones_like(y)
    for n in range(1, _TERMS):
        term = term * y / (2 * n - 1) / (2 * n)
        even, odd = even + term, odd + term / (2 * n + 1)
    odd = odd * part.thickness / 2.0**doublings
    for _ in range(doublings):
        odd, even = 2 * odd * even, 2 * even**2 - 1
    return even, odd


def respond(omega: Reals, column: LayerColumn) -> Response:
    """Solve a column that holds at least one piezoelectric slice; omega in rad/s, shape (N,)."""
    zero = np.zeros_like(omega, np.complex128)
    u = [zero + 1, zero]
    stress = [1j * omega * column.back + zero, zero]
    drop, stretch = [zero, zero], [zero, zero]
    thickness: float | Reals = 0.0
    for part in column.parts:
        if isinstance(part, InterfaceSheet):
            stress = [stress[k] - omega**2 * part.mass * u[k] for k in (0, 1)]
            continue
        even, odd = propagator(omega, part)
        mass = -(omega**2) * part.density
        driven = [stress[0], stress[1] + part.h]
        new = [even * u[k] + odd / part.stiffness * driven[k] for k in (0, 1)]
        stress = [odd * mass * u[k] + even * driven[k] for k in (0, 1)]
        stress[1] = stress[1] - part.h
        if part.permittivity is not None:
            rise = [new[k] - u[k] for k in (0, 1)]
            drop = [drop[k] - part.h * rise[k] for k in (0, 1)]
            drop[1] = drop[1] + part.thickness / part.permittivity
            stretch = [stretch[k] + rise[k] for k in (0, 1)]
            thickness = thickness + part.thickness
        u = new
    leave = 1j * omega * column.front
    back = -(stress[1] + leave * u[1]) / (stress[0] + leave * u[0])
    return Response((back * drop[0] + drop[1]) / (1j * omega), (back * stretch[0] + stretch[1]) / thickness)


def admittance(omega: Reals, columns: Sequence[tuple[float, LayerColumn]]) -> Complexes:
    """Return the admittance of columns side by side, each with its area in m2; siemens, shape (N,)."""
    total = np.zeros_like(omega, np.complex128)
    for area, column in columns:
        total = total + area / respond(omega, column).specific_impedance
    return total
