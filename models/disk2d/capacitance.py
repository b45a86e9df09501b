"""Capacitance over frequency of a reduced disk, with the derivative by every constant and size."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from .band import Band, band_shapes, modes_of
from .faces import BARE, FaceMotion, Faces
from .full import Shape
from .line_elements import Numbers
from .matrices import CONSTANTS, OF_TERM, POWERS
from .reduced import DiskError, ReducedDisk
from .unlike_faces import OddMotion

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


def middle_of(weights: Complexes, frequency: Frequencies) -> int:
    """Return the index amid rising frequencies. Raises DiskError if any of the weights of TERMS is not finite."""
    if not np.all(np.isfinite(weights)):
        raise DiskError("these constants are not finite: they are those of no disk")
    middle = int(np.searchsorted(frequency, math.sqrt(float(frequency[0]) * float(frequency[-1]))))
    return min(middle, frequency.size - 1)


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
class _InBand:
    """The motion of a disk in one band."""

    at: slice
    band: Band
    y: Complexes
    """Displacement for one volt, shape (N, m)."""
    odd: OddMotion | None
    """What it causes if the faces are not alike."""

    @cached_property
    def motion(self) -> Complexes:
        """The same with what the odd motion gives back."""
        return self.y if self.odd is None else self.y + self.odd.given_back

    def slopes(self) -> tuple[Complexes, Complexes]:
        """Return the derivatives of the form by the weights of TERMS, shape (N, 13), and by that of the mass, (N,)."""
        faces = self.band.faces
        if faces is None or not faces.is_dead:
            made = self.band.slopes(self.motion)
            return made if self.odd is None else _sum(made, self.odd.odd.slopes(self.odd.y))
        q = self.band.charge(self.motion)
        if self.odd is None:
            return self.band.slopes(self.motion, faces.across(q))
        q_odd, half = self.odd.odd.charge(self.odd.y), self.odd.difference
        made = self.band.slopes(self.motion, faces.across(q) + half.across(q_odd))
        return _sum(made, self.odd.odd.slopes(self.odd.y, faces.across(q_odd) + half.across(q)))

    def on_faces(self) -> tuple[Complexes, Complexes]:
        """Return the `forms` and `charges` of `FaceMotion` in this band."""
        forms, q = _quadratic(self.band.on_face, self.motion, self.motion), self.band.charge(self.motion)
        if self.odd is None:
            return np.array([forms, forms]), np.array([q, q]) ** 2
        forms = forms + _quadratic(self.odd.odd.on_face, self.odd.y, self.odd.y)
        mixed, q_odd = 2 * _quadratic(self.odd.cross, self.motion, self.odd.y), self.odd.odd.charge(self.odd.y)
        return np.array([forms + mixed, forms - mixed]), np.array([q + q_odd, q - q_odd]) ** 2


def _sum(one: tuple[Complexes, Complexes], other: tuple[Complexes, Complexes]) -> tuple[Complexes, Complexes]:
    return one[0] + other[0], one[1] + other[1]


def _quadratic(forms: Numbers, left: Complexes, right: Complexes) -> Complexes:
    """Return each of the forms between two motions, shape (N, 11)."""
    return np.array([np.einsum("ni,ni->n", left @ form, right) for form in forms]).T


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
    faces: Faces
    _parts: Sequence[_InBand]

    @cached_property
    def slopes(self) -> CapacitanceSlopes:
        """The derivatives, which cost no further solution, since the form is stationary, but half as much again."""
        made = self._of_live
        if not self.faces:
            return made
        by_constant, by_size = self.faces.form_slopes(self.shape, self.constants, self.frequency, self.on_faces)
        by_radius, by_thickness, by_density = -4 * np.pi * by_size.T
        return CapacitanceSlopes(
            made.capacitance,
            made.by_constant - 4 * np.pi * by_constant,
            made.by_log_radius + by_radius,
            made.by_log_thickness * (self.shape.thickness / self.faces.live(self.shape).thickness) + by_thickness,
            made.by_log_density + by_density,
        )

    @cached_property
    def _of_live(self) -> CapacitanceSlopes:
        """The same by the constants and sizes of the live ceramic, all weights of what is on the faces held."""
        by_term = np.zeros((self.frequency.size, OF_TERM.size), np.complex128)
        by_mass = np.zeros(self.frequency.size, np.complex128)
        for one in self._parts:
            by_term[one.at], by_mass[one.at] = one.slopes()
        live = self.faces.live(self.shape)
        return assembled_slopes(live, self.constants, self.frequency, self.capacitance, by_term, by_mass)

    @cached_property
    def on_faces(self) -> FaceMotion:
        """Motion of front and back for one volt."""
        forms, charges = zip(*(one.on_faces() for one in self._parts), strict=True)
        return FaceMotion(np.concatenate(forms, 1), np.concatenate(charges, 1), self._parts[0].band.disk.waves)

    @cached_property
    def _form(self) -> Complexes:
        return self.faces.form(self.shape, self.constants, self.frequency, self.on_faces)

    def with_faces(self, faces: Faces) -> Complexes:
        """Return the capacitance with slightly different faces less that with these, F, (N,), to first order."""
        before, after = self._form, faces.form(self.shape, self.constants, self.frequency, self.on_faces)
        thinner = math.log(faces.live(self.shape).thickness / self.faces.live(self.shape).thickness)
        by_thickness = self._of_live.by_log_thickness * thinner if thinner else 0.0
        return -4 * np.pi * (after - before) + by_thickness


def solved(
    disk: ReducedDisk,
    shape: Shape,
    constants: Complexes,
    frequency: Frequencies,
    rough: bool = False,
    faces: Faces = BARE,
    odd: Callable[[], ReducedDisk] | None = None,
) -> SolvedDisk:
    """Solve the disk at rising frequencies in Hz; constants at each of them, shape (N, 10), SI.

    Constants are smooth over an octave, as causal ones are: a parabola in ln f stands for them.
    `rough`: to a thousandth or so, at half the cost. `odd`: gives the reduced disk of antisymmetric motion, which faces
    that are not alike cause; without it only their mean counts. Raises DiskError for constants that are not finite.
    """
    live = faces.live(shape)
    weights = live.weights(constants)
    middle = middle_of(weights, frequency)
    mean, difference = None, None
    if faces:
        front, back = faces.weights(shape, constants, disk.waves)
        mean, difference = front.half_with(back, 1), front.half_with(back, -1)
    amid = None if mean is None else mean.at([middle])
    modes, other = modes_of(disk, live, weights[middle], rough, amid), None
    if odd is not None and not faces.alike:
        # of second order: a thousandth of it is nothing
        other = odd(), modes_of(odd(), live, weights[middle], True, amid)
    made = constants[:, _EPS33S] * np.pi * live.radius**2 / live.thickness
    parts: list[_InBand] = []
    for at in bands_of(frequency):
        f = frequency[at]
        shapes = band_shapes(modes, float(f[0]), float(f[-1]), weights[at][f.size // 2])
        band = Band.of(disk, shapes, live, f, weights[at], None if mean is None else mean.at(at))
        y, form = band.solve()
        caused = None
        if other is not None and difference is not None:
            caused = OddMotion.of(band, y, *other, live, difference.at(at))
            form = form + caused.form
        made[at] -= 4 * np.pi * form
        parts.append(_InBand(at, band, y, caused))
    return SolvedDisk(shape, constants, frequency, made, faces, parts)
