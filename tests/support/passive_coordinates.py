"""Passive constants drawn from coordinates, for tests: any coordinates give a stable and lossy material."""

import math
from collections.abc import Sequence

import numpy as np

from pzctl.models.base.arrays import Complexes, Reals
from pzctl.models.constants.constitutive import ConstitutiveLaw
from pzctl.models.constants.passivity import PassiveMatrix, passivity_margin
from pzctl.models.constants.piezo_constants import Radial, Thickness
from pzctl.models.constants.tensor import Tensor6mm

_ROUNDING = 1e-12
_RADIAL = (PassiveMatrix(1), PassiveMatrix(2))  # s11 - s12; [[s11 + s12, sqrt2 d31], [sqrt2 d31, epsT]]
_TENSOR = (PassiveMatrix(1), PassiveMatrix(2), PassiveMatrix(3))  # s11 - s12; shear 44-15-11; axial


def is_passive(law: ConstitutiveLaw) -> bool:
    """Return whether the law creates no energy; a lossless law is passive."""
    return passivity_margin(law) >= -_ROUNDING


def thickness_from_coordinates(x: Reals) -> tuple[Complexes, Complexes]:
    """Return (c33D, h33, eps33S), shape (3,), and their derivatives by x, shape (3, 6)."""
    M, slopes = PassiveMatrix(2).forward(x)  # conj of [[c33D, -h33], [-h33, 1/eps33S]]: there +Im is positive
    eps = 1 / np.conj(M[1, 1])
    values = np.array([np.conj(M[0, 0]), -np.conj(M[0, 1]), eps])
    by_x = np.conj(np.array([slopes[:, 0, 0], -slopes[:, 0, 1], slopes[:, 1, 1]]))
    by_x[2] *= -(eps**2)
    return values, by_x


def thickness_coordinates(constants: Thickness) -> Reals:
    """Return the six coordinates of thickness-mode constants. Raises PassivityError if they are not passive."""
    c, h, beta = constants.c33D, constants.h33, 1 / constants.eps33S
    return PassiveMatrix(2).inverse(np.conj(np.array([[c, -h], [-h, beta]])))


def _blocks(parts: Sequence[PassiveMatrix], x: Reals) -> list[tuple[Complexes, Complexes]]:
    """Return each block and its derivatives by all coordinates."""
    made: list[tuple[Complexes, Complexes]] = []
    at = 0
    for part in parts:
        M, own = part.forward(x[at : at + part.count])
        slopes = np.zeros((x.size, part.size, part.size), np.complex128)
        slopes[at : at + part.count] = own
        made.append((M, slopes))
        at += part.count
    return made


def _radial_of(b: Complexes, M: Complexes) -> list[Complexes]:
    minus, plus = b[..., 0, 0], M[..., 0, 0]
    return [(plus + minus) / 2, (plus - minus) / 2, M[..., 0, 1] / math.sqrt(2), M[..., 1, 1]]


def radial_from_coordinates(x: Reals) -> tuple[Complexes, Complexes]:
    """Return (s11E, s12E, d31, eps33T), shape (4,), and their derivatives by x, shape (4, 8)."""
    (b, db), (M, dM) = _blocks(_RADIAL, x)
    return np.array(_radial_of(b, M)), np.array(_radial_of(db, dM))


def radial_coordinates(constants: Radial) -> Reals:
    """Return the eight coordinates of radial-mode constants. Raises PassivityError if they are not passive."""
    s11, s12, d = constants.s11E, constants.s12E, math.sqrt(2) * constants.d31
    blocks = [np.array([[s11 - s12]]), np.array([[s11 + s12, d], [d, constants.eps33T]])]
    return np.concatenate([part.inverse(block) for part, block in zip(_RADIAL, blocks, strict=True)])


def tensor_from_coordinates(x: Reals) -> Tensor6mm:
    """Return the ten complex constants that belong to the coordinates x, shape (20,)."""
    (b, _), (shear, _), (axial, _) = _blocks(_TENSOR, x)
    minus, plus = b[0, 0], axial[0, 0]
    s, d = np.zeros((6, 6), complex), np.zeros((3, 6), complex)
    s[0, 0] = s[1, 1] = (plus + minus) / 2
    s[0, 1] = s[1, 0] = (plus - minus) / 2
    s[:2, 2] = s[2, :2] = axial[0, 1] / math.sqrt(2)
    s[2, 2], s[3, 3], s[4, 4], s[5, 5] = axial[1, 1], shear[0, 0], shear[0, 0], 2 * minus
    d[2, :2], d[2, 2] = axial[0, 2] / math.sqrt(2), axial[1, 2]
    d[0, 4] = d[1, 3] = shear[0, 1]
    return Tensor6mm.from_law(ConstitutiveLaw("stress_E", s, d, np.diag([shear[1, 1], shear[1, 1], axial[2, 2]])))
