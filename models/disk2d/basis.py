"""The reduced basis of a disk: from solutions for many ceramics to a few hundred shapes that represent all of them.

For each of a few ceramics a rational Krylov space is built on the whole mesh: K vectors (A^-1 M)^k A^-1 b for each of
a few real shifts, A the lossless system at the shift (A. Ruhe, Lin. Alg. Appl. 58 (1984) 391). Displacements and
potentials of all of them are compressed apart (singular values), so that the reduced model keeps the structure of
the full one: real symmetric stiffness, mass and permittivity, hence passive for passive constants. The basis knows
the shapes for constants between the samples, too: over +-15 % of all ten constants the error falls exponentially with
the number of vectors, and fourteen samples suffice (`tests/benchmarks`).
"""

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Reals
from .full import FullDisk, Shape

_PER_SHIFT = 20
_KEPT = 2e-5, 5e-5
# Singular values of displacements and potentials below this part of the largest are left out; the capacitance is
# stationary, so its error is of the square of it, times the sharpness of the resonances.
_TINY = 1e-12


def krylov(disk: FullDisk, shape: Shape, constants: Reals, shift: float, count: int = _PER_SHIFT) -> Reals:
    """Return an orthonormal basis of the Krylov space around `shift` in Hz, scaled, shape (n, count), lossless."""
    n, scale = disk.size, disk.scale
    squared = (2 * np.pi * shift) ** 2
    system = disk.system(shape.weights(constants), -squared * shape.mass)
    solved = disk.factor(system)
    mass = disk.scaled_mass
    made = np.zeros((n, count))
    vector = solved(scale * system[:n, [n]].toarray().ravel())
    for k in range(count):
        if k:
            vector = solved(mass @ made[:, k - 1])
        for _ in range(2):
            vector = vector - made[:, :k] @ (made[:, :k].T @ vector)
        made[:, k] = vector / np.linalg.norm(vector)
    return made


def compressed(snapshots: Sequence[Reals], kept: float) -> Reals:
    """Return the leading left singular vectors of all snapshots side by side, shape (n, r)."""
    whole = np.hstack(list(snapshots))
    values, vectors = np.linalg.eigh(whole @ whole.T if whole.shape[0] < whole.shape[1] else whole.T @ whole)
    singular = np.sqrt(np.maximum(values[::-1], 0.0))
    count = int(np.count_nonzero(singular > max(kept, 1e-7) * singular[0]))
    leading = vectors[:, ::-1][:, :count]
    return leading if whole.shape[0] < whole.shape[1] else whole @ (leading / singular[:count])


def split(disk: FullDisk, snapshots: Sequence[Reals], kept: tuple[float, float] = _KEPT) -> tuple[Reals, Reals]:
    """Return bases of displacement and potential over the unknowns of the mesh, shapes (n, ru) and (n, rp).

    Displacements are orthonormal by the mass matrix. `kept`: the least singular values of either, over the largest.
    """
    moving, n = disk.matrices.moving, disk.size
    u, p = np.zeros((n, 0)), np.zeros((n, 0))
    upper = compressed([s[:moving] for s in snapshots], kept[0])
    lower = compressed([s[moving:] for s in snapshots], kept[1])
    u = np.vstack([upper, np.zeros((n - moving, upper.shape[1]))]) * disk.scale[:, None]
    p = np.vstack([np.zeros((moving, lower.shape[1])), lower]) * disk.scale[:, None]
    mass = u.T @ (disk.matrices.mass[:n, :n] @ u)
    values, vectors = np.linalg.eigh(mass)
    good = values > _TINY * values[-1]
    return u @ (vectors[:, good] / np.sqrt(values[good])), p
