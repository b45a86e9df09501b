"""A reduced disk whose faces can be loaded: its motion of either symmetry, with the displacements of its face."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..base.arrays import Reals
from .basis import krylov, split
from .footprint import footprint, functions_for, loads
from .full import FullDisk, Shape
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
class LoadableDisk:
    """Both symmetries of a disk about its mid-plane: any load of a face is half of one and half of the other."""

    even: ReducedDisk
    """u_r even in z: the motion that a voltage excites. Without its shapes over the mesh."""
    odd: ReducedDisk
    """The same of the other motion, which no voltage drives."""

    @property
    def parts(self) -> tuple[ReducedDisk, ReducedDisk]:
        """Symmetric and antisymmetric motion."""
        return self.even, self.odd

    def loads(self, part: float, count: int) -> tuple[Reals, Reals]:
        """Return the loads of the shapes by unit stresses on a footprint, each of shape (nu, K), over a^2.

        `part`: radius of the footprint over that of the disk. `count`: number of functions of each stress.
        """
        line = self.even.line
        nodes = np.arange(line.size)
        pressure, shear = footprint(Face(line, nodes, nodes), part, count)
        even, odd = (np.hstack([one.axial.T @ pressure, one.radial.T @ shear]) for one in self.parts)
        return even, odd

    def arrays(self) -> dict[str, Reals]:
        """Return all arrays by name, for storage."""
        parts = zip(("even", "odd"), self.parts, strict=True)
        return {f"{name}.{key}": array for name, one in parts for key, array in one.arrays().items()}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Reals]) -> Self:
        """Return the disk of stored `arrays`."""

        def part(name: str) -> ReducedDisk:
            own = {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}
            return ReducedDisk.from_arrays(own)

        return cls(part("even"), part("odd"))


def trained_for_loads(
    diameter_to_thickness: float, progress: Callable[[int, int], None] = lambda _i, _n: None, electrode: float = 1.0
) -> LoadableDisk:
    """Return the reduced disk of both symmetries for this D/t, for loads of any footprint of usual size.

    The compliance of a footprint is accurate to 1e-4 for the range of constants. `progress` is called with the number
    of finished and of all samples. Raises DiskError for a D/t beyond 2 to 60.
    """
    shifts, made = shifts_of(diameter_to_thickness), list[ReducedDisk]()
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
        made.append(ReducedDisk.of(full, *split(full, snapshots, _KEPT)).without_mesh)
    return LoadableDisk(made[0], made[1])


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
