"""The section of a stack: functions of z in each layer, and the terms of the stationary form over them.

On the way of integration the stationary form of linear piezoelectricity is
    H = 1/2 S:cE:S + S:e:grad(phi) - 1/2 grad(phi):epsS:grad(phi) - 1/2 w^2 density u^2.
Displacements and potential are sums of functions of z with coefficients that depend on r: for waves along r

    u_r = U(z) J1(k r),   u_z = W(z) J0(k r),   phi = P(z) J0(k r),

so that the form has one block for each pair of E = k U, W, P (fields along J0) and of U, kW, kP (fields along J1).
Each term is a constant of a layer, times a power of its thickness, times a real matrix that depends on neither.
Layers have polynomials of their own degree; u_r and u_z are continuous, the potential vanishes on the electrodes.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Reals
from ..disk2d.matrices import CONSTANTS
from .layer_mesh import LayerMesh

LAYER_CONSTANTS = (*CONSTANTS, "density")
"""The constants of a layer, in the order used throughout; an elastic layer has no piezoelectric ones."""
STIFFNESS, PERMITTIVITY = 1e11, 1e-8
"""Units of the computation, Pa and F/m."""
UNITS: Reals = np.array([STIFFNESS] * 5 + [(STIFFNESS * PERMITTIVITY) ** 0.5] * 3 + [PERMITTIVITY] * 2 + [STIFFNESS])
"""Unit of each of LAYER_CONSTANTS; that of density leaves w^2 in."""
STATIC, INERTIAL, VISCOUS = 0, 1, 2
"""How a term depends on frequency: not, by -w^2, by jw."""

FIELDS = {"E": "u", "W": "w", "P": "p", "U": "u", "kW": "w", "kP": "q", "rim": "u"}
"""Fields and their functions of z; `q` are those of `p` without the first, the lift of one volt."""
PAIRS = (
    ("E", "E"),
    ("E", "W"),
    ("E", "P"),
    ("W", "W"),
    ("W", "P"),
    ("P", "P"),
    ("U", "U"),
    ("U", "kW"),
    ("U", "kP"),
    ("kW", "kW"),
    ("kW", "kP"),
    ("kP", "kP"),
    ("rim", "rim"),
)
"""Pairs of fields that the form couples; `rim` is u_r at the rim, which alone tells c12 from c11."""


@dataclass(frozen=True)
class FormTerm:
    """A term of the form without its matrix."""

    constant: int
    """Index among the LAYER_CONSTANTS of all layers in turn, then the loads of back and front (Rayl)."""
    layer: int
    """Index of the layer whose thickness counts."""
    power: int
    """Exponent of that thickness."""
    frequency: int
    """STATIC, INERTIAL or VISCOUS."""


@dataclass(frozen=True, eq=False)
class Block:
    """All terms that couple two fields."""

    terms: tuple[FormTerm, ...]
    matrices: Reals
    """Shape (T, n, m)."""

    def weighted(self, weights: Complexes) -> Complexes:
        """Return the sums with weights of shape (F, T), shape (F, n, m)."""
        count, n, m = self.matrices.shape
        return (weights @ self.matrices.reshape(count, n * m)).reshape(len(weights), n, m)


@dataclass(frozen=True, eq=False)
class CrossSection:
    """Functions of z of a stack, and its form over them."""

    blocks: Mapping[tuple[str, str], Block]
    shapes: Mapping[str, Reals]
    """Of `u`, `w`, `p`: functions as columns over the nodes of all layers, shapes (nz, n); of `p` the lift is first."""
    meshes: tuple[LayerMesh, ...]
    """Elements of all layers from 0 to 1, back to front."""
    piezo: int
    """Index of the piezoelectric layer."""
    ends: tuple[tuple[int, int] | None, ...]
    """First and last node of each layer, None for one that is missing."""
    floats: bool = False
    """Whether the ceramic has no electrodes here: its potential is free, and a constant is the first of `q`."""

    @classmethod
    def of(
        cls,
        meshes: Sequence[LayerMesh],
        piezo: int,
        *,
        missing: Collection[int] = (),
        torn: int | None = None,
        floats: bool = False,
    ) -> Self:
        """Return the section of layers, back to front, with these elements from 0 to 1.

        `piezo`: index of the piezoelectric layer, which has the electrodes on its faces unless it `floats`. `missing`:
        indices of layers that are not there; `torn`: that of a layer that does not touch the one behind it.
        """
        ends = _ends(meshes, missing, torn)
        nodes = _count(ends)
        p = _potentials(meshes[piezo], ends[piezo], nodes, floats=floats)
        eye = np.eye(nodes)
        blocks = {pair: _nodal(pair, meshes, ends, piezo) for pair in PAIRS}
        shapes = {"u": eye, "w": eye, "p": p}
        return cls(_projected(blocks, {**shapes, "q": p[:, 1:]}), shapes, tuple(meshes), piezo, tuple(ends), floats)

    @property
    def is_whole(self) -> bool:
        """Whether these are all functions of the layers' degrees."""
        nodes, functions = self.shapes["u"].shape
        return nodes == functions

    @property
    def driven(self) -> bool:
        """Whether it has electrodes."""
        return bool(np.any(self.shapes["p"][:, 0]))

    @property
    def layers(self) -> int:
        """Number of layers."""
        return len(self.meshes)

    def projected(self, shapes: Mapping[str, Reals]) -> Self:
        """Return the section over sums of its functions: columns of `shapes` for each of `u`, `w`, `q`."""
        n, m = shapes["q"].shape
        p = np.zeros((n + 1, m + 1))
        p[0, 0], p[1:, 1:] = 1.0, shapes["q"]
        own = {"u": shapes["u"], "w": shapes["w"], "p": p}
        sums = {name: self.shapes[name] @ shape for name, shape in own.items()}
        return replace(self, blocks=_projected(self.blocks, {**own, "q": shapes["q"]}), shapes=sums)

    @property
    def size(self) -> int:
        """Number of waves along r: that of the functions without the lift and the constant potential."""
        return sum(shape.shape[1] for shape in self.shapes.values()) - 1 - self.floats


def _projected(blocks: Mapping[tuple[str, str], Block], shapes: Mapping[str, Reals]) -> dict[tuple[str, str], Block]:
    """Return the blocks over the columns of `shapes`, one for each kind of functions in FIELDS."""
    return {
        pair: replace(block, matrices=shapes[FIELDS[pair[0]]].T @ block.matrices @ shapes[FIELDS[pair[1]]])
        for pair, block in blocks.items()
    }


def _ends(meshes: Sequence[LayerMesh], missing: Collection[int], torn: int | None) -> list[tuple[int, int] | None]:
    """Return the first and last node of each layer, None for one that is missing: layers in contact share one."""
    last, made = -1, list[tuple[int, int] | None]()
    for layer, mesh in enumerate(meshes):
        if layer in missing:
            made.append(None)
            continue
        joined = layer > 0 and made[-1] is not None and layer != torn
        first = last if joined else last + 1
        last = first + mesh.size - 1
        made.append((first, last))
    return made


def _count(ends: Sequence[tuple[int, int] | None]) -> int:
    """Return the number of nodes."""
    return max(own[1] for own in ends if own is not None) + 1


def _potentials(mesh: LayerMesh, ends: tuple[int, int] | None, nodes: int, *, floats: bool) -> Reals:
    """Return the functions of the potential over the nodes, the lift of one volt first, shape (nodes, n).

    It is nothing where there are no electrodes.
    """
    if ends is None:
        return np.zeros((nodes, 1))
    within = slice(ends[0], ends[1] + 1)
    p = np.zeros((nodes, mesh.size + 1 if floats else mesh.size - 1))
    if floats:
        p[within, 1] = 1.0
        p[within, 2:] = np.eye(mesh.size)[:, 1:]
    else:
        p[within, 0] = mesh.nodes
        p[within, 1:] = np.eye(mesh.size)[:, 1:-1]
    return p


def _nodal(
    pair: tuple[str, str], meshes: Sequence[LayerMesh], ends: Sequence[tuple[int, int] | None], piezo: int
) -> Block:
    """Return a block over the nodes of all layers."""
    nodes = _count(ends)
    terms: list[FormTerm] = []
    matrices: list[Reals] = []
    for layer, mesh in enumerate(meshes):
        own = ends[layer]
        if own is None:
            continue
        at = slice(own[0], own[1] + 1)
        for name, factor, first, second, frequency in _TERMS.get(pair, ()):
            constant = LAYER_CONSTANTS.index(name)
            if layer != piezo and name.startswith("e"):
                continue
            matrix = np.zeros((nodes, nodes))
            matrix[at, at] = factor * mesh.integral(first, second)
            index = layer * len(LAYER_CONSTANTS) + constant
            terms.append(FormTerm(index, layer, 1 - first - second, frequency))
            matrices.append(matrix)
    if pair == ("W", "W"):
        for face, node in enumerate((0, nodes - 1)):
            matrix = np.zeros((nodes, nodes))
            matrix[node, node] = 1.0
            terms.append(FormTerm(len(meshes) * len(LAYER_CONSTANTS) + face, 0, 0, VISCOUS))
            matrices.append(matrix)
    return Block(tuple(terms), np.array(matrices).reshape(len(terms), nodes, nodes))


_TERMS: Mapping[tuple[str, str], tuple[tuple[str, float, int, int, int], ...]] = {
    ("E", "E"): (("c11E", 1.0, 0, 0, STATIC),),
    ("E", "W"): (("c13E", 1.0, 0, 1, STATIC),),
    ("E", "P"): (("e31", 1.0, 0, 1, STATIC),),
    ("W", "W"): (("c33E", 1.0, 1, 1, STATIC), ("density", 1.0, 0, 0, INERTIAL)),
    ("W", "P"): (("e33", 1.0, 1, 1, STATIC),),
    ("P", "P"): (("eps33S", -1.0, 1, 1, STATIC),),
    ("U", "U"): (("c44E", 1.0, 1, 1, STATIC), ("density", 1.0, 0, 0, INERTIAL)),
    ("U", "kW"): (("c44E", -1.0, 1, 0, STATIC),),
    ("U", "kP"): (("e15", -1.0, 1, 0, STATIC),),
    ("kW", "kW"): (("c44E", 1.0, 0, 0, STATIC),),
    ("kW", "kP"): (("e15", 1.0, 0, 0, STATIC),),
    ("kP", "kP"): (("eps11S", -1.0, 0, 0, STATIC),),
    ("rim", "rim"): (("c11E", -1.0, 0, 0, STATIC), ("c12E", 1.0, 0, 0, STATIC)),
}
# Constant, factor, derivatives of the left and of the right function along z, and dependence on frequency.
