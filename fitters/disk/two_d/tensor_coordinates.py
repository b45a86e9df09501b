"""Coordinates of all ten complex constants of a ceramic, stable and passive everywhere.

Holland's matrix has three blocks for a poled ceramic (`models/constants/passivity.py`): s11E - s12E alone, shear
(s44E, d15, eps11T), and axial (s11E + s12E, s13E, s33E, d31, d33, eps33T). Each is K (1 - j A A^T) K^T; the coordinates
are the logarithms of the diagonals of K and A, and their other elements as they are.
"""

import math

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.constants.passivity import PassiveMatrix, tensor_coordinates
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.matrices import CONSTANTS
from ...engine.parameters.coordinates import Block

_ROOT = math.sqrt(2)
_PARTS = (PassiveMatrix(1), PassiveMatrix(2), PassiveMatrix(3))
_COUNT = sum(part.count for part in _PARTS)
COORDINATES = tuple(
    f"tensor.{block}{k}"
    for block, part in zip(("minus", "shear", "axial"), _PARTS, strict=True)
    for k in range(part.count)
)
"""Names of the coordinates, to be prefixed with the layer's."""
LOSSES = ("tensor.minus1", *(f"tensor.shear{k}" for k in (3, 4)), *(f"tensor.axial{k}" for k in (6, 7, 8)))
"""Coordinates that are logarithms of the diagonal of A: half the logarithm of a loss tangent."""
TURNS = ("tensor.shear5", *(f"tensor.axial{k}" for k in (9, 10, 11)))
"""Coordinates that are off-diagonal elements of A: correlations of the losses of different constants."""

_LEAST_LOSS = 1e-7
# A fit may drive a loss to zero; rounding then makes it negative, which has no coordinates.
_FURTHEST = 30.0
# Size of a coordinate beyond which nothing changes: a constant that recordings do not feel must not run to zero.


def tensor_block(layer: str) -> Block:
    """Return the ten constants of a layer at constant field and strain, from twenty coordinates."""
    return Block(
        tuple(f"{layer}.{name}" for name in COORDINATES),
        tuple(f"{layer}.{name}.{part}" for name in CONSTANTS for part in ("re", "im")),
        _forward,
        _inverse,
    )


def _eliminated(M: Complexes, dM: Complexes, stresses: int) -> tuple[Complexes, Complexes]:
    """Return [[c, e^T], [e, epsS]] of [[s, d^T], [d, epsT]] and its derivatives, shapes (n, n) and (C, n, n)."""
    k = stresses
    c = np.linalg.inv(M[:k, :k])
    dc = -c @ dM[:, :k, :k] @ c
    d, dd = M[k:, :k], dM[:, k:, :k]
    e, de = d @ c, dd @ c + d @ dc
    eliminated, slopes = np.zeros_like(M), np.zeros_like(dM)
    eliminated[:k, :k], eliminated[k:, :k], eliminated[:k, k:] = c, e, e.T
    eliminated[k:, k:] = M[k:, k:] - e @ d.T
    slopes[:, :k, :k], slopes[:, k:, :k], slopes[:, :k, k:] = dc, de, np.swapaxes(de, 1, 2)
    slopes[:, k:, k:] = dM[:, k:, k:] - de @ d.T - e @ np.swapaxes(dd, 1, 2)
    return eliminated, slopes


def _of_blocks(minus: Complexes, shear: Complexes, axial: Complexes) -> Complexes:
    """Return the constants, shape (10, ...), from blocks in the form of `_eliminated`, shapes (..., n, n)."""
    low, high = minus[..., 0, 0], axial[..., 0, 0]
    return np.array(
        [
            (high + low) / 2,
            (high - low) / 2,
            axial[..., 0, 1] / _ROOT,
            axial[..., 1, 1],
            shear[..., 0, 0],
            axial[..., 2, 0] / _ROOT,
            axial[..., 2, 1],
            shear[..., 1, 0],
            shear[..., 1, 1],
            axial[..., 2, 2],
        ]
    )


def _forward(x: Reals) -> tuple[Reals, Reals]:
    within = np.abs(x) < _FURTHEST
    x = np.clip(x, -_FURTHEST, _FURTHEST)
    blocks: list[Complexes] = []
    slopes: list[Complexes] = []
    at = 0
    for part, stresses in zip(_PARTS, (1, 1, 2), strict=True):
        M, own = part.forward(x[at : at + part.count])
        dM = np.zeros((_COUNT, part.size, part.size), np.complex128)
        dM[at : at + part.count] = own
        block, by = _eliminated(M, dM, stresses)
        blocks.append(block)
        slopes.append(by)
        at += part.count
    values, by_x = _of_blocks(*blocks), _of_blocks(*slopes)
    J = np.stack([by_x.real, by_x.imag], axis=1).reshape(2 * len(CONSTANTS), _COUNT)
    return np.stack([values.real, values.imag], axis=1).ravel(), J * within


def _inverse(values: Reals) -> Reals:
    return tensor_coordinates(Tensor6mm(*(complex(re, im) for re, im in values.reshape(-1, 2))), _LEAST_LOSS)
