"""What touches a round part of a face: pressures and shear stresses on it, as loads of the nodes of a mesh.

Stresses on a footprint of radius R are sums of a few functions of s = r/R: of the pressure Legendre polynomials of
2 s^2 - 1, and of the radial shear stress s times the same. Both are singular at the edge of contact. Where a body with
upright sides, softer than the ceramic, is bonded to it, they grow as the distance from the edge to a power of -0.3 to
-0.45 (D. B. Bogy, J. Appl. Mech. 38 (1971) 377), for which the last function (1 - s^2)^(-1/3) stands.
"""

import math
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from ..base.arrays import Reals
from .line_elements import Numbers
from .matrices import Face

_FEWEST, _MOST = 3, 9
# Number of functions of the pressure, and of the shear stress; a footprint of more wavelengths is described roughly.
_POINTS = 16
# Gauss points in each element: exact for elements of order up to 20.
_NEAR = 0.7
# Beyond this s points are denser towards the edge.


def functions_for(phase: float) -> int:
    """Return the number of functions for a footprint of this radius, in radians of the slowest wave under it.

    One for each two radians, and that of the edge: with fewer, a dot of solder as wide as a disk is thick is wrong.
    """
    return min(_MOST, max(_FEWEST, 1 + math.ceil(phase / 2)))


def stresses(s: Reals, count: int) -> Reals:
    """Return the functions of pressure at s = r/R, shape (P, count); those of the shear stress are s times them."""
    smooth = np.asarray(legvander(2 * s**2 - 1, count - 2), np.float64)
    return np.column_stack([smooth, (1 - s**2) ** (-1 / 3)])


def rule(ends: Reals) -> tuple[Reals, Reals]:
    """Return points s between rising `ends`, the last of them 1, and their weights of s ds, shapes (P,).

    In the last interval 1 - s^2 = v^3 and the points are those of Gauss in v: there the singular function times s ds is
    -3/2 v dv.
    """
    points, weights = (np.asarray(one, np.float64) for one in leggauss(_POINTS))
    points, weights = (points + 1) / 2, weights / 2
    ends = np.unique(np.append(ends, _NEAR))
    s, over = list[Reals](), list[Reals]()
    for low, high in pairwise(ends[:-1].tolist()):
        s.append(low + (high - low) * points)
        over.append((high - low) * weights * s[-1])
    far = float((1 - ends[-2] ** 2) ** (1 / 3))
    s.append(np.sqrt(1 - (far * points) ** 3))
    over.append(1.5 * far * weights * (far * points) ** 2)
    return np.concatenate(s), np.concatenate(over)


def footprint(face: Face, part: float, count: int) -> tuple[Reals, Reals]:
    """Return the integrals over x dx of the functions of pressure and of shear stress times each nodal function.

    Shapes (nodes, count). `part`: radius of the footprint over that of the disk, up to 1.
    """
    s, over = rule(np.append(face.line.breaks[face.line.breaks < part] / part, 1.0))
    nodal = face.line.values(s * part)
    pressure = stresses(s, count) * (over * part**2)[:, None]
    return nodal.T @ pressure, nodal.T @ (s[:, None] * pressure)


def loads(face: Face, size: int, part: float, count: int) -> Reals:
    """Return the loads of `size` unknowns by unit stresses, pressures first, shape (size, 2 count); over a^2."""
    pressure, shear = footprint(face, part, count)
    made = np.zeros((size, 2 * count))
    moving = face.radial >= 0
    made[face.axial, :count] = pressure
    made[face.radial[moving], count:] = shear[moving]
    return made


def traces(face: Face, shapes: Numbers) -> tuple[Numbers, Numbers]:
    """Return u_z and u_r of shapes over the unknowns of a mesh at the nodes of its face, shapes (nodes, nu)."""
    radial = np.where((face.radial >= 0)[:, None], shapes[face.radial], 0.0)
    return shapes[face.axial], radial
