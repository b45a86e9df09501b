"""Training of a reduced disk for a geometry, once for every PZT, and enrichment where it is not accurate enough."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..base.arrays import Complexes, Reals
from .basis import krylov, split
from .error_estimate import estimate
from .full import FullDisk, Shape
from .reduced import DiskError, ReducedDisk

HIGHEST = 3400.0
"""Frequency times thickness up to which a reduced disk is valid, Hz m: 1.5 times the thickness resonance of PZT."""
SMALLEST, LARGEST = 2.0, 60.0
"""Allowed range of diameter over thickness."""
DENSITY = 7800.0
_CENTRE = np.array([125e9, 80e9, 80e9, 117e9, 22.5e9, -5.0, 16.0, 11.5, 8.5e-9, 7.5e-9])
_SPREAD = np.array([0.16, 0.2, 0.16, 0.12, 0.18, 0.5, 0.16, 0.25, 0.3, 0.3])
# Centre and half width of the range of constants; it contains every complete set of the material library.
SAMPLES = 14
"""Number of ceramics from which the shapes are taken."""
_JITTER = 0.02  # of the aspect ratio
SHIFTED = 22
"""Vectors of the Krylov space of the voltage around each frequency."""
_ENOUGH = 1e-4
_ADDED = 12
_ROUNDS = 6
_NEW = 1e-6
# Smallest singular values, relative to the largest, that enrich a basis.


def sampled(rng: np.random.Generator) -> Reals:
    """Return real constants in the box, shape (10,), of a stable material of usual coupling."""
    while True:
        c = _CENTRE * (1 + _SPREAD * rng.uniform(-1, 1, _CENTRE.size))
        plane = (c[0] + c[1]) * c[3] - 2 * c[2] ** 2  # of the axial block
        if plane > 0.25 * (c[0] + c[1]) * c[3] and c[0] - c[1] > 0.2 * c[0]:
            return c


def trained(
    diameter_to_thickness: float, progress: Callable[[int, int], None] = lambda _i, _n: None, electrode: float = 1.0
) -> ReducedDisk:
    """Return a reduced disk for this D/t, accurate to 1e-4 of the capacitance for its range of constants.

    `progress` is called with the number of finished and of all samples. Raises DiskError for a D/t beyond 2 to 60.
    """
    shifts, rng = shifts_of(diameter_to_thickness), np.random.default_rng(0)
    full = FullDisk.of(diameter_to_thickness, electrode=electrode)
    snapshots: list[Reals] = []
    for k in range(SAMPLES):
        shape = jittered(diameter_to_thickness, rng)
        constants = sampled(rng)
        snapshots += [krylov(full, shape, constants, shift, SHIFTED) for shift in shifts]
        progress(k + 1, SAMPLES)
    return ReducedDisk.of(full, *split(full, snapshots))


def shifts_of(diameter_to_thickness: float) -> list[float]:
    """Return the frequencies in Hz around which a disk one metre thick is sampled. Raises DiskError for its D/t."""
    if not SMALLEST <= diameter_to_thickness <= LARGEST:
        raise DiskError(
            f"disk of diameter/thickness {diameter_to_thickness:.3g}: the two-dimensional model covers "
            f"{SMALLEST:g} to {LARGEST:g}"
        )
    count = math.ceil(3 * max(1.0, math.sqrt(diameter_to_thickness / 10)))
    return (HIGHEST * (np.arange(count) + 0.5) / count).tolist()


def jittered(diameter_to_thickness: float, rng: np.random.Generator) -> Shape:
    """Return a disk one metre thick of about this D/t."""
    return Shape(diameter_to_thickness / 2 * (1 + _JITTER * rng.uniform(-1, 1)), 1.0, DENSITY)


def enriched(full: FullDisk, reduced: ReducedDisk, shape: Shape, snapshots: Sequence[Reals]) -> ReducedDisk:
    """Return the reduced disk with shapes added from `snapshots`, scaled and each of shape (n, k)."""
    u, p = split(full, snapshots, (_NEW, _NEW))
    mass = full.matrices.mass[: full.size, : full.size]
    u = u - reduced.u @ (reduced.u.T @ (mass @ u))
    u = u - reduced.u @ (reduced.u.T @ (mass @ u))
    values, vectors = np.linalg.eigh(u.T @ (mass @ u))
    good = values > 1e-10
    u = u @ (vectors[:, good] / np.sqrt(values[good]))
    scaled = np.linalg.qr(reduced.p / full.scale[:, None])[0]
    rest = p / full.scale[:, None]
    rest = rest / np.linalg.norm(rest, axis=0)
    rest = rest - scaled @ (scaled.T @ rest)
    vectors, values, _ = np.linalg.svd(rest - scaled @ (scaled.T @ rest), full_matrices=False)
    p = np.hstack([scaled, vectors[:, values > 1e-5]]) * full.scale[:, None]
    return ReducedDisk.of(full, np.hstack([reduced.u, u]), p)


def ensured(
    full: FullDisk, reduced: ReducedDisk, shape: Shape, constants: Complexes, frequency: Reals
) -> tuple[ReducedDisk, float]:
    """Return a reduced disk accurate for these constants, shape (N, 10), at each frequency, and its estimated error.

    If the estimate exceeds 1e-4 of the capacitance, the basis is enriched by the Krylov space at the worst frequency.
    """
    errors = estimate(full, reduced, shape, constants, frequency)
    for _ in range(_ROUNDS):
        worst = int(np.argmax(errors))
        if errors[worst] < _ENOUGH:
            break
        there, f = constants[worst], float(frequency[worst])
        x = full.solution(shape, there, f)[:-1] / full.scale
        snapshots = [krylov(full, shape, there.real, f, _ADDED), np.column_stack([x.real, x.imag]) / np.linalg.norm(x)]
        reduced = enriched(full, reduced, shape, snapshots)
        errors = estimate(full, reduced, shape, constants, frequency)
    return reduced, float(errors.max())
