"""A reduced disk whose faces can be loaded: its motion of either symmetry, with the displacements of its face."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Reals
from .basis import krylov, split
from .footprint import footprint, functions_for, loads, traces
from .full import FullDisk, Shape
from .line_elements import LineElements
from .matrices import Face
from .reduced import ReducedDisk
from .training import HIGHEST, SAMPLES, SHIFTED, jittered, sampled, shifts_of

SMALLEST, LARGEST = 0.05, math.sqrt(0.5)
"""Radii of footprints, over that of the disk, for which the shapes are trained."""
_KEPT = 1e-4, 2e-4
# Least singular values of displacements and potentials over the largest.
_LOADS, _STEPS = 8, 3
# Random loads for each ceramic and shift, and vectors of the Krylov space of each.
_SLOWEST = 1300.0
# Speed of shear waves in solder and resins, m/s.


@dataclass(frozen=True, eq=False)
class FaceShapes:
    """A reduced disk of one symmetry with the traces of its shapes on the upper face."""

    reduced: ReducedDisk
    """Without its shapes over the mesh; of antisymmetric motion nothing is driven by the voltage."""
    axial: Reals
    """u_z of each shape at the nodes of the face, shape (nodes, nu)."""
    radial: Reals
    """u_r, shape (nodes, nu)."""

    @classmethod
    def of(cls, full: FullDisk, u: Reals, p: Reals) -> Self:
        """Project the disk on displacements `u`, orthonormal by mass, and potentials `p`."""
        face = full.face
        reduced = ReducedDisk.of(full, u, p)
        axial, radial = traces(face, u)
        return cls(replace(reduced, u=reduced.u[:0], p=reduced.p[:0], face=reduced.face[:0]), axial, radial)


@dataclass(frozen=True, eq=False)
class LoadableDisk:
    """Both symmetries of a disk about its mid-plane: any load of a face is half of one and half of the other."""

    even: FaceShapes
    """u_r even in z: the motion that a voltage excites."""
    odd: FaceShapes
    line: LineElements
    """Elements along the face."""

    @property
    def parts(self) -> tuple[FaceShapes, FaceShapes]:
        """Symmetric and antisymmetric motion."""
        return self.even, self.odd

    def loads(self, part: float, count: int) -> tuple[Reals, Reals]:
        """Return the loads of the shapes by unit stresses on a footprint, each of shape (nu, K), over a^2.

        `part`: radius of the footprint over that of the disk. `count`: number of functions of each stress.
        """
        nodes = np.arange(self.line.size)
        pressure, shear = footprint(Face(self.line, nodes, nodes), part, count)
        even, odd = (np.hstack([one.axial.T @ pressure, one.radial.T @ shear]) for one in self.parts)
        return even, odd

    def arrays(self) -> dict[str, Reals]:
        """Return all arrays by name, for storage."""
        made = {"line.breaks": self.line.breaks, "line.order": np.array(float(self.line.order))}
        for name, one in zip(("even", "odd"), self.parts, strict=True):
            made |= {f"{name}.axial": one.axial, f"{name}.radial": one.radial}
            made |= {f"{name}.{key}": array for key, array in one.reduced.arrays().items()}
        return made

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Reals]) -> Self:
        """Return the disk of stored `arrays`."""

        def part(name: str) -> FaceShapes:
            own = {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}
            return FaceShapes(ReducedDisk.from_arrays(own), own["axial"], own["radial"])

        return cls(part("even"), part("odd"), LineElements(arrays["line.breaks"], int(arrays["line.order"])))


def trained_for_loads(
    diameter_to_thickness: float, progress: Callable[[int, int], None] = lambda _i, _n: None, electrode: float = 1.0
) -> LoadableDisk:
    """Return the reduced disk of both symmetries for this D/t, for loads of any footprint of usual size.

    The compliance of a footprint is accurate to 1e-4 for the range of constants. `progress` is called with the number
    of finished and of all samples. Raises DiskError for a D/t beyond 2 to 60.
    """
    shifts, made = shifts_of(diameter_to_thickness), list[FaceShapes]()
    meshes = [FullDisk.of(diameter_to_thickness, electrode=electrode, antisymmetric=odd) for odd in (False, True)]
    for n, full in enumerate(meshes):
        rng, snapshots = np.random.default_rng(0), list[Reals]()
        for k in range(SAMPLES):
            shape, constants = jittered(diameter_to_thickness, rng), sampled(rng)
            for shift in shifts:
                if full is meshes[0]:
                    snapshots.append(krylov(full, shape, constants, shift, SHIFTED))
                snapshots += _of_loads(full, shape, constants, shift, rng)
            progress(n * SAMPLES + k + 1, 2 * SAMPLES)
        made.append(FaceShapes.of(full, *split(full, snapshots, _KEPT)))
    return LoadableDisk(made[0], made[1], meshes[0].face.line)


def _of_loads(full: FullDisk, shape: Shape, constants: Reals, shift: float, rng: np.random.Generator) -> list[Reals]:
    """Return what random stresses on footprints of random sizes cause around `shift` in Hz, scaled, lossless."""
    solve = full.factor(full.system(shape.weights(constants), -((2 * np.pi * shift) ** 2) * shape.mass))
    parts = np.exp(rng.uniform(math.log(SMALLEST), math.log(LARGEST), _LOADS)).tolist()
    drawn: list[Reals] = []
    for part in parts:
        count = functions_for(2 * math.pi * HIGHEST / _SLOWEST * part * shape.radius / shape.thickness)
        drawn.append(loads(full.face, full.size, part, count) @ rng.normal(size=2 * count))
    vectors, made = full.scale[:, None] * np.array(drawn).T, list[Reals]()
    for _ in range(_STEPS):
        vectors = solve(full.scaled_mass @ made[-1] if made else vectors)
        before = np.hstack([*made, vectors])
        vectors = np.linalg.qr(before)[0][:, -_LOADS:]
        made.append(vectors)
    return made
