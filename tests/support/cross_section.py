"""The matrices of a disk with additions: bonded layers, electrodes that end before the rim, rings of mass.

The full section instead of half of it: in y, -1 to 1 is the ceramic, with one unit for each layer in front and behind.
The matrices stay affine: a layer's Lame constants times powers of the radius and of its own thickness; only ratios of
radii (the electrodes' and the rings' edges) are part of the mesh. Everything is halved, to match half a disk.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Literal

import numpy as np
import scipy.sparse as sp

from pzctl.models.base.arrays import Reals
from pzctl.models.disk2d.line_elements import LineElements, Matrix
from pzctl.models.disk2d.matrices import Matrices, blocks_of, gathered, kron, unit_columns

LAYER_POWERS = np.array([0, 1, 2, 0, 1, 2])
"""Exponent of the radius in the terms of a layer: three of its first Lame constant, then three of its second."""
_OF_LAME = (
    ({0: 1.0, 1: 1.0}, {2: 1.0}, {3: 1.0}),
    ({0: 2.0, 6: 1.0}, {5: 1.0}, {3: 2.0, 4: 1.0}),
)
# Composition of these terms: TERMS of a ceramic with c11 = c33 = lambda + 2 mu, c12 = c13 = lambda, c44 = mu.
_MASS = 13
_GRADING = (0.15, 0.0225)
# Element length beside the edge of an electrode or a bonded layer, in usual lengths: the field there is singular.
_NEAR = 0.3
# Ends of elements closer to an edge than this part of an element are dropped.


@dataclass(frozen=True)
class Ring:
    """Mass spread evenly over a ring of a face of the whole transducer, or a spot (`inner` zero)."""

    face: Literal["back", "front"]
    inner: float
    """Inner radius over that of the disk."""
    outer: float
    """Outer radius over that of the disk."""


@dataclass(frozen=True)
class CrossSection:
    """All additions to the ceramic."""

    back: int = 0
    """Layers behind the ceramic."""
    front: int = 0
    """Layers in front of the ceramic."""
    electrode: float = 1.0
    """Radius of both electrodes over that of the disk."""
    rings: tuple[Ring, ...] = ()

    @property
    def heights(self) -> Reals:
        """Ends of elements along y."""
        ends: Reals = np.arange(-1.0 - self.back, 2.0 + self.front)
        near: list[float] = []
        for face, layers in ((-1, self.back), (1, self.front)):
            if layers or self.electrode < 1:
                near += [face * (1 - part) for part in _GRADING]
            if layers:
                near += [face * (1 + part) for part in _GRADING]
        return np.sort(np.concatenate([ends, near]))

    def breaks(self, elements: int) -> Reals:
        """Return the ends of elements along r: `elements` of them, and further ones at edges."""
        sharp = [1.0] if self.back or self.front else list[float]()
        sharp += [self.electrode] if self.electrode < 1 else []
        wanted = [edge for ring in self.rings for edge in (ring.inner, ring.outer)] + sharp
        wanted += [edge + side * part / elements for edge in sharp for part in _GRADING for side in (-1, 1)]
        wanted = sorted({edge for edge in wanted if 0 < edge < 1})
        usual = np.linspace(0.0, 1.0, elements + 1)
        near = [any(abs(place - edge) < _NEAR / elements for edge in wanted) for place in usual.tolist()]
        near[0] = near[-1] = False
        return np.sort(np.concatenate([usual[~np.array(near)], wanted]))


@dataclass(frozen=True, eq=False)
class SectionMatrices:
    """The terms of H, and the masses separately."""

    terms: tuple[Matrix, ...]
    """TERMS, then six for each layer from back to front (`LAYER_POWERS`)."""
    masses: tuple[Matrix, ...]
    """Mass matrices of the ceramic, of each layer, of each ring."""
    moving: int

    def loaded(self, over_ceramic: Reals) -> Matrices:
        """Return the matrices with one mass: each weighted by its mass over that of an equal part of the ceramic."""
        weighed = (share * mass for share, mass in zip((1.0, *over_ceramic.tolist()), self.masses, strict=True))
        return Matrices(self.terms, reduce(add, weighed), self.moving)


def assemble_section(
    section: CrossSection, along_r: LineElements, order_z: int, *, move_in_plane: bool = True
) -> SectionMatrices:
    """Return the matrices on a mesh along r; without `move_in_plane` u_r is zero."""
    along_z = LineElements(section.heights, order_z)
    nr, nz = along_r.size, along_z.size
    places, y = np.arange(nr * nz).reshape(nr, nz), along_z.nodes
    ceramic = np.abs(y) < 1 + 1e-9
    free = np.tile(np.abs(y) < 1 - 1e-9, (nr, 1))
    free[np.ix_(along_r.nodes > section.electrode + 1e-9, ceramic)] = True
    kept = (places[1:] if move_in_plane else places[:0], places, places[free])
    volt = np.zeros((3 * nr * nz, 1))
    volt[2 * nr * nz :, 0] = np.tile(np.where(ceramic, y / 2, 0.0), nr)
    columns = [unit_columns(own.ravel() + field * nr * nz, 3 * nr * nz) for field, own in enumerate(kept)]
    keep = sp.csr_array(sp.hstack([*columns, sp.csr_array(volt)]))

    def built(parts: Mapping[tuple[int, int], Matrix]) -> Matrix:
        return gathered(parts, keep, keep, nr * nz) / 2

    *terms, mass = (built(parts) for parts in blocks_of(along_r, along_z, _between(-1, 1)))
    masses: list[Matrix] = [mass]
    for low in (*range(-1 - section.back, -1), *range(1, 1 + section.front)):
        own = [built(parts) for parts in blocks_of(along_r, along_z, _between(low, low + 1))]
        terms += [reduce(add, (share * own[k] for k, share in made.items())) for lame in _OF_LAME for made in lame]
        masses.append(own[_MASS])
    for ring in section.rings:
        over_r = along_r.integral(0, 0, lambda x, ring=ring: x * ((x > ring.inner) & (x < ring.outer)))
        node = unit_columns(np.array([0 if ring.face == "back" else nz - 1]), nz)
        face = kron(over_r, sp.csr_array(node @ node.T))
        masses.append(built({(0, 0): face, (1, 1): face}))
    return SectionMatrices(tuple(terms), tuple(masses), kept[0].size + kept[1].size)


def _between(low: float, high: float) -> Callable[[Reals], Reals]:
    return lambda y: np.where((y > low) & (y < high), 1.0, 0.0)
