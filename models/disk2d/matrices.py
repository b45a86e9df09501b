"""The matrices of a disk in r and z, one per constant: assembled once per mesh, weighted by constants and sizes.

Linear piezoelectricity with axial symmetry. On the way of integration the stationary form is
    H = 1/2 S:cE:S + S:e:grad(phi) - 1/2 grad(phi):epsS:grad(phi) - 1/2 w^2 density u^2,
and with r = a x, z = b y (radius a, half thickness b) each of its terms is a constant times a^k b^(1-k) times a matrix
that depends on neither. So one set of matrices serves every ceramic and every size of a disk. The faces z = +-b
carry the electrodes and nothing else; by symmetry u_r is even in z, u_z and phi are odd, and half a disk is enough.
What loads one face also causes the opposite motion, u_r odd, u_z and phi even, which no voltage does: the same half
disk with other conditions at z = 0.
Basis functions are products of functions of x and of y, the matrices Kronecker products of line integrals.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..base.arrays import Reals
from .line_elements import LineElements, Matrix, Numbers

CONSTANTS = ("c11E", "c12E", "c13E", "c33E", "c44E", "e31", "e33", "e15", "eps11S", "eps33S")
"""The ten constants in the order used throughout."""


@dataclass(frozen=True)
class Term:
    """A term of H: `constant` x a^power x b^(1 - power)."""

    constant: str
    power: int


TERMS = (
    Term("c11E", 0),
    Term("c12E", 0),
    Term("c13E", 1),
    Term("c33E", 2),
    Term("c44E", 2),
    Term("c44E", 1),
    Term("c44E", 0),
    Term("e31", 1),
    Term("e33", 2),
    Term("e15", 1),
    Term("e15", 0),
    Term("eps11S", 0),
    Term("eps33S", 2),
)
"""One term per matrix; the mass matrix, density x a^2 b, comes last and is not included."""
OF_TERM = np.array([CONSTANTS.index(term.constant) for term in TERMS])
"""Index of each term's constant in CONSTANTS."""
POWERS = np.array([term.power for term in TERMS])
"""Exponent of the radius in each of TERMS."""

_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Face:
    """The upper face of a mesh."""

    line: LineElements
    """Elements along x = r/a."""
    radial: NDArray[np.intp]
    """Unknown that is u_r of each node of the line; -1 on the axis, where there is none."""
    axial: NDArray[np.intp]
    """Unknown that is u_z of each node."""
    electrode: float = 1.0
    """Radius of the electrode over that of the disk, an end of elements."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """The terms of H over (u_r, u_z, phi within, electrode), real symmetric, each of shape (n + 1, n + 1).

    The last row and column are the voltage between the electrodes, for the uniform field; `phi within` is what the
    potential departs from that, zero on the electrodes.
    """

    terms: tuple[Matrix, ...]
    mass: Matrix
    moving: int
    """Number of unknowns that are displacements."""
    face: Face | None = None
    """None for a section whose faces nothing loads."""
    charges: tuple[Matrix, ...] = ()
    """Of TERMS but the elastic ones: what each unknown and the volt put on potentials that are not zero on the face.

    Shape (nodes, n + 1) each: of unit potentials of the face's nodes that fall to the mid-plane, linearly, or in
    antisymmetric motion as a parabola. The charge on the electrode is found so (a weak form), and not from the slope
    of the potential, which converges badly.
    """

    @property
    def size(self) -> int:
        """Number n of unknowns, without the voltage."""
        return self.mass.shape[0] - 1


def assemble(
    along_r: LineElements,
    along_z: LineElements,
    *,
    move_in_plane: bool = True,
    electrode: float = 1.0,
    antisymmetric: bool = False,
) -> Matrices:
    """Return the matrices on a mesh of x and y. Without `move_in_plane` u_r is zero: the laterally clamped plate.

    `electrode`: radius of both electrodes over that of the disk, an end of elements along r. `antisymmetric`: of the
    motion with u_r odd in z, whose electrodes have the same potential, so that no voltage drives it.
    """
    nr, nz = along_r.size, along_z.size
    places = np.arange(nr * nz).reshape(nr, nz)
    within = np.ones((nr, nz), np.bool_)
    within[:, 0] = antisymmetric
    within[along_r.nodes < electrode + _SAME, -1] = False
    in_plane = places[1:, 1:] if antisymmetric else places[1:]
    kept = (in_plane if move_in_plane else places[:0], places if antisymmetric else places[:, 1:], places[within])
    columns: list[Matrix] = []
    for field, free in enumerate(kept):
        columns.append(unit_columns(free.ravel() + field * nr * nz, 3 * nr * nz))
    volt = np.zeros((3 * nr * nz, 1))
    if not antisymmetric:
        volt[2 * nr * nz :, 0] = np.tile(along_z.nodes / 2, nr)  # the field of one volt between parallel electrodes
    keep = sp.csr_array(sp.hstack([*columns, sp.csr_array(volt)]))

    blocks = blocks_of(along_r, along_z)
    *terms, mass = (gathered(parts, keep, keep, nr * nz) for parts in blocks)
    fall = along_z.nodes[:, None] ** (2 if antisymmetric else 1)
    raised = sp.csr_array(sp.vstack([sp.csr_array((2 * nr * nz, nr)), kron(sp.eye_array(nr), fall)]))
    electric = [parts for term, parts in zip(TERMS, blocks, strict=False) if not term.constant.startswith("c")]
    charges = tuple(gathered(parts, raised, keep, nr * nz) for parts in electric)
    moving = np.concatenate([kept[0].ravel(), kept[1].ravel() + nr * nz])
    number = np.full(2 * nr * nz, -1)
    number[moving] = np.arange(moving.size)
    face = Face(along_r, number[places[:, -1]], number[places[:, -1] + nr * nz], electrode)
    return Matrices(tuple(terms), mass, moving.size, face, charges)


def gathered(parts: Mapping[tuple[int, int], Matrix], left: Matrix, right: Matrix, count: int) -> Matrix:
    """Return the matrix between the unknowns that `left` and `right` select, from blocks of three fields of `count`."""
    grid = [[parts.get((i, k), sp.csr_array((count, count))) for k in range(3)] for i in range(3)]
    whole = sp.csr_array(sp.block_array(grid))
    coupling = all(i != k for i, k in parts)
    return sp.csr_array(left.T @ (whole + sp.tril(whole.T, -1) if coupling else whole) @ right)


def unit_columns(rows: Numbers, size: int) -> Matrix:
    """Return the columns of the unit matrix of `size` at `rows`."""
    return sp.csr_array(sp.coo_array((np.ones(rows.size), (rows, np.arange(rows.size))), shape=(size, rows.size)))


kron: Callable[[Matrix, Matrix], Matrix] = sp.kron
"""Kronecker product of sparse matrices."""


def blocks_of(
    along_r: LineElements, along_z: LineElements, within: Callable[[Reals], Reals] = np.ones_like
) -> list[dict[tuple[int, int], Matrix]]:
    """Return the blocks, on and above the diagonal, of each of TERMS and the mass; fields 0 u_r, 1 u_z, 2 phi.

    `within`: 1 where there is material along z, else 0.
    """

    def over_r(first: int, second: int, power: int) -> Matrix:
        return along_r.integral(first, second, lambda x: x**power)

    A, D, B = over_r(0, 0, 1), over_r(1, 1, 1), over_r(0, 0, -1)  # u u, u' u', u u/r^2, all with weight r
    F = over_r(1, 0, 0)  # u' u/r with weight r
    spread = over_r(1, 0, 1) + over_r(0, 0, 0)  # (u' + u/r) w
    G = over_r(0, 1, 1)  # u w'
    Zm, Zd = along_z.integral(0, 0, within), along_z.integral(1, 1, within)
    Zs, Zt = along_z.integral(0, 1, within), along_z.integral(1, 0, within)

    def product(r: Matrix, z: Matrix) -> Matrix:
        return kron(r, z)

    return [
        {(0, 0): product(D + B, Zm)},
        {(0, 0): product(F + F.T, Zm)},
        {(0, 1): product(spread, Zs)},
        {(1, 1): product(A, Zd)},
        {(0, 0): product(A, Zd)},
        {(0, 1): product(G, Zt)},
        {(1, 1): product(D, Zm)},
        {(0, 2): product(spread, Zs)},
        {(1, 2): product(A, Zd)},
        {(0, 2): product(G, Zt)},
        {(1, 2): product(D, Zm)},
        {(2, 2): -product(D, Zm)},
        {(2, 2): -product(A, Zd)},
        {(0, 0): product(A, Zm), (1, 1): product(A, Zm)},
    ]
