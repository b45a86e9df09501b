"""Training of the reduced disk of antisymmetric motion that faces which are not alike cause (`unlike_faces`)."""

import math
from collections.abc import Callable

import numpy as np

from ..base.arrays import Reals
from .basis import split
from .coat import FORMS, FaceTraces, face_forms
from .footprint import traces
from .full import FullDisk, Shape
from .matrices import Face
from .reduced import ELASTIC, ReducedDisk
from .training import SAMPLES, SHIFTED, jittered, sampled, shifts_of

_MASS, _ALONG, _ACROSS = 0, 5, 6
# Of `face_forms`: u_r^2 + u_z^2, and the strains of a thin layer.
_KEPT = 1e-3, 1e-3
# Least singular values of displacements and potentials over the largest: what they add is small.
_ACROSS_SHARE = 0.35
# Stiffness of a thin layer across over that along.


def trained_odd(
    diameter_to_thickness: float, progress: Callable[[int, int], None] = lambda _i, _n: None
) -> ReducedDisk:
    """Return the reduced disk of antisymmetric motion for this D/t, without its shapes over the mesh.

    It knows what a mass, a thin layer and a dead layer of one face cause by the even motion that a volt causes.
    `progress` is called with the number of finished and of all samples. Raises DiskError for a D/t beyond 2 to 60.
    """
    shifts, rng = shifts_of(diameter_to_thickness), np.random.default_rng(0)
    even, odd = (FullDisk.of(diameter_to_thickness, antisymmetric=one) for one in (False, True))
    snapshots: list[Reals] = []
    for k in range(SAMPLES):
        shape, constants = jittered(diameter_to_thickness, rng), sampled(rng)
        snapshots += [_krylov(even, odd, shape, constants, shift) for shift in shifts]
        progress(k + 1, SAMPLES)
    return ReducedDisk.of(odd, *split(odd, snapshots, _KEPT)).without_mesh


def _krylov(even: FullDisk, odd: FullDisk, shape: Shape, constants: Reals, shift: float) -> Reals:
    """Return what loads of one face cause around `shift` in Hz, scaled, lossless, orthonormal, shape (n, K)."""
    weights, squared = shape.weights(constants), (2 * np.pi * shift) ** 2
    loads = _loads(even, odd, weights, even.solution(shape, constants.astype(np.complex128), shift).real)
    solve = odd.factor(odd.system(weights, -squared * shape.mass))
    made = np.zeros((odd.size, 0))
    vectors = odd.scale[:, None] * loads
    for _ in range(math.ceil(SHIFTED / loads.shape[1])):
        vectors = solve(vectors)
        for _ in range(2):
            vectors = vectors - made @ (made.T @ vectors)
        vectors = np.linalg.qr(vectors)[0]
        made, vectors = np.hstack([made, vectors]), odd.scaled_mass @ vectors
    return made


def _loads(even: FullDisk, odd: FullDisk, weights: Reals, motion: Reals) -> Reals:
    """Return the forces of a mass, a thin layer and a dead layer of the face on the odd motion, shape (n, 3)."""
    face, size = odd.face, odd.size
    moved = FaceTraces.of(face.line, face.electrode, *traces(even.face, motion[:, None]))
    nodes, none = np.eye(face.line.size), np.zeros((face.line.size, face.line.size))
    axial, radial = (
        face_forms(moved, FaceTraces.of(face.line, face.electrode, *parts))[:, 0]
        for parts in ((nodes, none), (none, nodes))
    )
    made = np.zeros((size, 3))
    for column, shares in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, _ACROSS_SHARE))):
        own = np.zeros(FORMS)
        own[[_MASS, _ALONG, _ACROSS]] = shares
        made[:, column] = _at_nodes(face, size, own @ axial, own @ radial)
    electric = weights[ELASTIC.size :]
    charge = sum(w * (one @ motion) for w, one in zip(electric, even.matrices.charges, strict=True))
    for w, one in zip(electric, odd.matrices.charges, strict=True):
        made[:, 2] += w * (one.T @ charge)[:size]
    return made


def _at_nodes(face: Face, size: int, axial: Reals, radial: Reals) -> Reals:
    """Return the forces on all unknowns of a mesh from those on the nodes of its face."""
    made, moving = np.zeros(size), face.radial >= 0
    made[face.axial] = axial
    made[face.radial[moving]] = radial[moving]
    return made
