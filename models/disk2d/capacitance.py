"""Capacitance over frequency of a reduced disk, with the derivative by every constant and size."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..base.face_loads import Coat
from .band import Band, band_shapes, modes_of
from .coat import Coating, change_by
from .full import Shape
from .matrices import CONSTANTS, OF_TERM, POWERS
from .reduced import DiskError, ReducedDisk

_OCTAVES = 1.0
_EPS33S = CONSTANTS.index("eps33S")


@dataclass(frozen=True, eq=False)
class CapacitanceSlopes:
    """Capacitance in F and its derivatives."""

    capacitance: Complexes
    """Y/(jw), shape (N,)."""
    by_constant: Complexes
    """Derivative by the value of each of CONSTANTS at each frequency, shape (N, 10); F per SI unit."""
    by_log_radius: Complexes
    """F, shape (N,)."""
    by_log_thickness: Complexes
    """F, shape (N,)."""
    by_log_density: Complexes
    """F, shape (N,)."""


def bands_of(frequency: Frequencies) -> list[slice]:
    """Return slices of rising frequencies, none wider than an octave."""
    octaves: Reals = np.log2(frequency / frequency[0])
    width = float(octaves[-1])
    count = max(1, int(np.ceil(width / _OCTAVES)))
    inner = [int(np.searchsorted(octaves, width * k / count)) for k in range(1, count)]
    ends = [0, *inner, frequency.size]
    return [slice(low, high) for low, high in pairwise(ends) if high > low]


def middle_of(weights: Complexes, frequency: Frequencies) -> Complexes:
    """Return the weights of TERMS amid rising frequencies, shape (13,). Raises DiskError if any is not finite."""
    if not np.all(np.isfinite(weights)):
        raise DiskError("these constants are not finite: they are those of no disk")
    middle = int(np.searchsorted(frequency, math.sqrt(float(frequency[0]) * float(frequency[-1]))))
    return weights[min(middle, frequency.size - 1)]


def _in_bands(
    disk: ReducedDisk, shape: Shape, weights: Complexes, frequency: Frequencies, rough: bool, coat: Coat | None
) -> list[tuple[slice, Band]]:
    coating = None if coat is None else Coating.of(disk.face, coat, shape)
    modes = modes_of(disk, shape, middle_of(weights, frequency), rough, coating)
    made: list[tuple[slice, Band]] = []
    for part in bands_of(frequency):
        f = frequency[part]
        shapes = band_shapes(modes, float(f[0]), float(f[-1]), weights[part][f.size // 2])
        made.append((part, Band.of(disk, shapes, shape, f, weights[part], coating)))
    return made


def assembled_slopes(
    shape: Shape,
    constants: Complexes,
    frequency: Frequencies,
    capacitance: Complexes,
    by_term: Complexes,
    by_mass: Complexes,
) -> CapacitanceSlopes:
    """Return the derivatives of a capacitance, shape (N,), from those of the form by the weights of its terms.

    `constants`: shape (N, 10); `by_term`: of TERMS, shape (N, 13); `by_mass`: of the mass matrix, shape (N,).
    """
    weights, lengths = shape.weights(constants), shape.lengths
    empty = np.pi * shape.radius**2 / shape.thickness
    still = constants[:, _EPS33S] * empty
    by_term = -4 * np.pi * by_term
    by_density = 4 * np.pi * (2 * np.pi * frequency) ** 2 * by_mass
    by_constant = np.zeros(constants.shape, np.complex128)
    for k, constant in enumerate(OF_TERM.tolist()):
        by_constant[:, constant] += by_term[:, k] * lengths[k]
    by_constant[:, _EPS33S] += empty
    scaled = by_term * weights
    return CapacitanceSlopes(
        capacitance,
        by_constant,
        scaled @ POWERS + 2 * by_density + 2 * still,
        scaled @ (1 - POWERS) + by_density - still,
        by_density,
    )


@dataclass(frozen=True, eq=False)
class SolvedDisk:
    """A reduced disk, solved over frequency."""

    shape: Shape
    constants: Complexes
    """At each frequency, shape (N, 10), SI."""
    frequency: Frequencies
    """Hz, rising, shape (N,)."""
    capacitance: Complexes
    """Y/(jw) in F, shape (N,)."""
    coat: Coat | None
    """On both faces."""
    _parts: Sequence[tuple[slice, Band, Complexes]]
    """Bands with their displacements."""

    @cached_property
    def slopes(self) -> CapacitanceSlopes:
        """The derivatives, which cost no further solution, since the form is stationary, but half as much again."""
        by_term = np.zeros((self.frequency.size, OF_TERM.size), np.complex128)
        by_mass = np.zeros(self.frequency.size, np.complex128)
        for part, band, y in self._parts:
            by_term[part], by_mass[part] = band.slopes(y)
        made = assembled_slopes(self.shape, self.constants, self.frequency, self.capacitance, by_term, by_mass)
        if self.coat is None:
            return made
        # of a coat, only the mass depends on a size: it is in proportion to the area
        inertia = change_by(replace(self.coat, speed=0.0), self.shape, self.on_faces, self.frequency)
        return replace(made, by_log_radius=made.by_log_radius - 8 * np.pi * inertia)

    @cached_property
    def on_faces(self) -> Complexes:
        """`face_forms` of the motion for one volt, shape (N, 3)."""
        made = np.empty((self.frequency.size, 3), np.complex128)
        for part, band, y in self._parts:
            made[part] = band.on_face(y)
        return made

    def with_coat(self, coat: Coat | None) -> Complexes:
        """Return the capacitance with a slightly different coat less that with this one, F, (N,), to first order."""
        return -4 * np.pi * (self._of_coat(coat) - self._of_coat(self.coat))

    def _of_coat(self, coat: Coat | None) -> Complexes:
        if coat is None:
            return np.zeros(self.frequency.size, np.complex128)
        return change_by(coat, self.shape, self.on_faces, self.frequency)


def solved(
    disk: ReducedDisk,
    shape: Shape,
    constants: Complexes,
    frequency: Frequencies,
    rough: bool = False,
    coat: Coat | None = None,
) -> SolvedDisk:
    """Solve the disk at rising frequencies in Hz; constants at each of them, shape (N, 10), SI.

    Constants are smooth over an octave, as causal ones are: a parabola in ln f stands for them.
    `rough`: to a thousandth or so, at half the cost. `coat`: on both faces. Raises DiskError for constants that are not
    finite.
    """
    made = constants[:, _EPS33S] * np.pi * shape.radius**2 / shape.thickness
    parts: list[tuple[slice, Band, Complexes]] = []
    for part, band in _in_bands(disk, shape, shape.weights(constants), frequency, rough, coat):
        y, form = band.solve()
        made[part] -= 4 * np.pi * form
        parts.append((part, band, y))
    return SolvedDisk(shape, constants, frequency, made, coat, parts)
