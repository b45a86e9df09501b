"""Passivity: a material absorbs energy and supplies none. As a check, and as coordinates that guarantee it.

Holland (IEEE Trans. Sonics Ultrason. SU-14 (1967) 18): -Im [[sE, d^T], [d, epsT]] is positive semidefinite. For its
inverse, [[cD, -h^T], [-h, 1/epsS]], +Im is. Coordinates: every symmetric complex matrix with positive definite real
part and loss is K (1 - j A A^T) K^T for exactly one pair of lower triangular matrices K and A with positive diagonals;
an optimiser may therefore choose any (K, A) and remains stable and passive.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Complexes, Reals
from ..base.errors import PzctlError
from .constitutive import ConstitutiveLaw, convert, loss_matrix
from .tensor import Tensor6mm


class PassivityError(PzctlError):
    """Constants that do not belong to a stable, lossy material."""


def passivity_margin(law: ConstitutiveLaw) -> float:
    """Return the smallest eigenvalue of Holland's loss matrix, each component scaled by its own sE' or epsT'.

    It has the size of a loss tangent: positive for a lossy material, negative if energy would be created.
    """
    at = convert(law, "stress_E")
    size = np.sqrt(np.abs(np.concatenate([np.diag(at.elastic), np.diag(at.dielectric)]).real))
    return float(np.linalg.eigvalsh(loss_matrix(law) / np.outer(size, size))[0])


@dataclass(frozen=True)
class PassiveMatrix:
    """Coordinates of a stable and lossy symmetric complex matrix of `size` rows.

    x, shape (size (size + 1),): ln of the diagonal of K, the rest of K measured by its row's diagonal, then the same
    for A: ln of its diagonal, the rest of A as it is.
    """

    size: int

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return self.size * (self.size + 1)

    def forward(self, x: Reals) -> tuple[Complexes, Complexes]:
        """Return M = K (1 - j A A^T) K^T, shape (n, n), and dM/dx, shape (C, n, n)."""
        n, half = self.size, self.count // 2
        rows, columns = np.tril_indices(n, -1)
        diagonal = np.diag(np.exp(x[:n]))
        unit, A = np.eye(n), np.diag(np.exp(x[half : half + n]))
        unit[rows, columns], A[rows, columns] = x[n:half], x[half + n :]
        K = diagonal @ unit
        core = np.eye(n) - 1j * A @ A.T
        slopes = np.zeros((self.count, n, n), np.complex128)
        for k in range(half):
            row, column = (k, k) if k < n else (int(rows[k - n]), int(columns[k - n]))
            dK, dA = np.zeros((n, n)), np.zeros((n, n))
            if k < n:
                dK[k], dA[k, k] = K[k], A[k, k]
            else:
                dK[row, column], dA[row, column] = diagonal[row, row], 1.0
            one = dK @ core @ K.T
            two = -1j * K @ (dA @ A.T) @ K.T
            slopes[k], slopes[half + k] = one + one.T, two + two.T
        return (K @ core @ K.T).astype(np.complex128), slopes

    def inverse(self, M: Complexes, least: float = 0.0) -> Reals:
        """Return the coordinates of M, with losses of at least `least`, as loss tangents.

        Raises PassivityError if M is not stable, or not strictly lossy while `least` is 0.
        """
        rows, columns = np.tril_indices(self.size, -1)
        try:
            K = np.linalg.cholesky(M.real)
            undone = np.linalg.inv(K)
            A = np.linalg.cholesky(_at_least(-(undone @ M.imag @ undone.T), least))
        except np.linalg.LinAlgError:
            raise PassivityError(
                "these constants have no passive coordinates: the real part and the loss of the matrix "
                "[[sE, d], [d, epsT]] must both be positive definite, and one of them is not"
            ) from None
        d = np.diag(K)
        parts = np.log(d), K[rows, columns] / d[rows], np.log(np.diag(A)), A[rows, columns]
        return np.concatenate(parts).astype(np.float64)


def _at_least(loss: Reals, least: float) -> Reals:
    """Return the nearest symmetric matrix without eigenvalues below `least`; the same one if `least` is 0."""
    if least <= 0:
        return loss
    values, vectors = np.linalg.eigh(loss)
    return loss if values[0] >= least else (vectors * np.maximum(values, least)) @ vectors.T


_TENSOR = (PassiveMatrix(1), PassiveMatrix(2), PassiveMatrix(3))  # s11 - s12; shear 44-15-11; axial


def tensor_coordinates(tensor: Tensor6mm, least: float = 0.0) -> Reals:
    """Return the twenty coordinates of a full tensor, with loss tangents of at least `least`.

    Raises PassivityError if it is not stable, or not passive while `least` is 0.
    """
    try:
        at = convert(tensor.law, "stress_E")
    except np.linalg.LinAlgError:
        raise PassivityError("these constants have no passive coordinates: their stiffness has no inverse") from None
    s, d, eps = at.elastic, at.piezo, at.dielectric
    root = math.sqrt(2)
    axial = [
        [s[0, 0] + s[0, 1], root * s[0, 2], root * d[2, 0]],
        [root * s[0, 2], s[2, 2], d[2, 2]],
        [root * d[2, 0], d[2, 2], eps[2, 2]],
    ]
    blocks = [[[s[0, 0] - s[0, 1]]], [[s[3, 3], d[0, 4]], [d[0, 4], eps[0, 0]]], axial]
    return np.concatenate([part.inverse(np.array(block), least) for part, block in zip(_TENSOR, blocks, strict=True)])
