"""Capacitance of a disk with dots on its faces, with all derivatives.

Stresses t on the footprints answer what the disk for one volt, T, and the dots, free but for these stresses, do there:
with G the disk's own answer, half of its symmetric and half of its antisymmetric motion, and D that of the dots,
    (G + D) t = -T,   C = C(free) + 2 pi T t.
The whole is stationary in the motion of disk and dots and in t: each derivative is that of its term at the solution.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..base.face_loads import Dot
from .band import Band, BandModes, band_shapes, modes_of
from .capacitance import CapacitanceSlopes, assembled_slopes, bands_of, middle_of
from .dot import DotBody, phase
from .footprint import functions_for
from .full import Shape
from .line_elements import Numbers
from .loadable import LoadableDisk
from .reduced import ReducedDisk

_STEP = 1e-5
# Relative step of derivatives by the radius of a dot, which are differences of it alone; their error is its square.
_SIGNS = {"face:front": 1.0, "face:back": -1.0}
# Antisymmetric motion of a face relative to that of the front, both outwards.


@dataclass(frozen=True)
class PlacedDot:
    """A dot on a face."""

    where: str
    """`face:front` or `face:back`."""
    dot: Dot


@dataclass(frozen=True, eq=False)
class FreeDisk:
    """A disk with given constants at some frequencies, whose faces can be loaded in different ways."""

    disk: LoadableDisk
    shape: Shape
    constants: Complexes
    """At each frequency, shape (N, 10), SI."""
    frequency: Frequencies
    """Hz, rising, shape (N,)."""
    rough: bool
    _known: "list[DottedDisk]" = field(default_factory=list["DottedDisk"], repr=False)

    @cached_property
    def weights(self) -> Complexes:
        """Weights of TERMS at each frequency, shape (N, 13)."""
        return self.shape.weights(self.constants)

    @cached_property
    def modes(self) -> tuple[BandModes, BandModes]:
        """Modes of symmetric and antisymmetric motion. Raises DiskError for constants that are not finite."""
        middle = self.weights[middle_of(self.weights, self.frequency)]
        even, odd = (modes_of(one, self.shape, middle, self.rough) for one in self.disk.parts)
        return even, odd

    def with_dots(self, dots: tuple[PlacedDot, ...]) -> "DottedDisk":
        """Return the disk with these dots, from what is known of the last ones on footprints as large."""
        parts = self.footprints(dots)
        for known in self._known:
            if known.dots == dots:
                return known
        answers = next((known.answers for known in self._known if known.footprints == parts), None)
        made = DottedDisk(self, dots, parts, answers or self._answers(parts))
        self._known[:] = [made, *self._known[:1]]
        return made

    def footprints(self, dots: Sequence[PlacedDot]) -> "tuple[Footprint, ...]":
        """Return what the dots touch."""
        area, highest = np.pi * self.shape.radius**2, float(self.frequency[-1])
        phases = [phase(one.dot, one.dot.radius(area), highest) for one in dots]
        return tuple(
            Footprint(one.where, math.sqrt(one.dot.fraction), functions_for(own))
            for one, own in zip(dots, phases, strict=True)
        )

    def _answers(self, footprints: "Sequence[Footprint]") -> "Answers":
        """Return what a volt and stresses on footprints cause."""
        blocks = [one.loads(self.disk) for one in footprints]
        each = [np.hstack(list(own)) * self.shape.radius**2 for own in zip(*blocks, strict=True)]
        even, odd = (
            _answered(self, one, modes, loads)
            for one, modes, loads in zip(self.disk.parts, self.modes, each, strict=True)
        )
        return Answers(even, odd)


@dataclass(frozen=True)
class Footprint:
    """What a dot touches."""

    where: str
    """`face:front` or `face:back`."""
    part: float
    """Radius over that of the disk."""
    count: int
    """Number of functions of pressure and of shear stress."""

    def loads(self, disk: LoadableDisk) -> tuple[Reals, Reals]:
        """Return the loads of symmetric and antisymmetric shapes by unit stresses, shapes (nu, K), over a^2."""
        even, odd = disk.loads(self.part, self.count)
        return even, odd * _SIGNS[self.where]


@dataclass(frozen=True, eq=False)
class _InBand:
    """Motion of one symmetry in one band."""

    at: slice
    band: Band
    shapes: Numbers
    """Shapes of the band over those of the reduced disk, shape (nu, m)."""
    loads: Numbers
    """Shape (m, K)."""
    volt: Complexes
    """For one volt, shape (N, m)."""
    form: Complexes
    """Its form in J/V2, shape (N,)."""
    stressed: Complexes
    """By unit stresses, shape (K, N, m)."""


@dataclass(frozen=True, eq=False)
class Answers:
    """What a volt and unit stresses on footprints cause, by band, in symmetric and antisymmetric motion."""

    even: Sequence[_InBand]
    odd: Sequence[_InBand]

    @cached_property
    def free(self) -> Complexes:
        """The form of the free disk for one volt, shape (N,), J/V2."""
        return np.concatenate([one.form for one in self.even])

    @cached_property
    def moved(self) -> Complexes:
        """Moments of the motion of the footprints for one volt, T, shape (N, K)."""
        return np.concatenate([one.volt @ one.loads for one in self.even])

    @cached_property
    def compliance(self) -> Complexes:
        """The same for each unit stress, G, shape (N, K, K)."""
        even, odd = (
            np.concatenate([np.einsum("knm,ml->nkl", one.stressed, one.loads) for one in side])
            for side in (self.even, self.odd)
        )
        return np.asarray((even + odd) / 2, np.complex128)


def _answered(free: FreeDisk, one: ReducedDisk, modes: BandModes, loads: Reals) -> list[_InBand]:
    made: list[_InBand] = []
    for at in bands_of(free.frequency):
        f, weights = free.frequency[at], free.weights[at]
        shapes = band_shapes(modes, float(f[0]), float(f[-1]), weights[f.size // 2], loads)
        band = Band.of(one, shapes, free.shape, f, weights)
        own = shapes.T @ loads
        made.append(_InBand(at, band, shapes, own, *band.solve_with(own)))
    return made


@dataclass(frozen=True, eq=False)
class DottedDisk:
    """A disk with dots, solved over frequency."""

    bare: FreeDisk
    dots: tuple[PlacedDot, ...]
    footprints: tuple[Footprint, ...]
    answers: Answers

    @cached_property
    def capacitance(self) -> Complexes:
        """Y/(jw) in F, shape (N,)."""
        return self.bare_capacitance + self.added

    @property
    def bare_capacitance(self) -> Complexes:
        """The same without dots."""
        shape, still = self.bare.shape, self.bare.constants[:, -1]
        return still * np.pi * shape.radius**2 / shape.thickness - 4 * np.pi * self.answers.free

    @property
    def added(self) -> Complexes:
        """What the dots add, F, shape (N,)."""
        return 2 * np.pi * np.einsum("nk,nk->n", self.answers.moved, self.stresses)

    @cached_property
    def stresses(self) -> Complexes:
        """Stresses for one volt, t, shape (N, K)."""
        whole = self.answers.compliance + self._receptance
        # of a large stiff dot some are all but determined by others: their sizes differ by orders of magnitude
        own: Reals = np.abs(np.einsum("nkk->nk", whole))
        scale: Reals = 1 / np.sqrt(np.maximum(own, np.finfo(float).tiny))
        scaled: Complexes = whole * scale[:, :, None] * scale[:, None, :]
        right: Complexes = (self.answers.moved * scale)[:, :, None]
        return -scale * np.asarray(np.linalg.solve(scaled, right)[:, :, 0], np.complex128)

    @cached_property
    def _receptance(self) -> Complexes:
        """What unit stresses move on the bases of the dots, D, shape (N, K, K)."""
        return self._receptance_of(self.dots)

    def _receptance_of(self, dots: Sequence[PlacedDot], wider: float = 1.0) -> Complexes:
        """Return the same of other dots on footprints with as many functions, radii times `wider`."""
        counts = [one.count for one in self.footprints]
        return receptance(dots, counts, self.bare.shape, self.bare.frequency, wider)

    @cached_property
    def _motion(self) -> tuple[list[Complexes], list[Complexes]]:
        """Symmetric and antisymmetric motion in each band for one volt, shapes (N, m)."""
        made: tuple[list[Complexes], list[Complexes]] = [], []
        for side, (parts, driven) in enumerate(((self.answers.even, 1.0), (self.answers.odd, 0.0))):
            for one in parts:
                by_stress = np.einsum("nk,knm->nm", self.stresses[one.at], one.stressed) / 2
                made[side].append(driven * one.volt + by_stress)
        return made

    @cached_property
    def slopes(self) -> CapacitanceSlopes:
        """The derivatives by the disk's constants and sizes; a dot covers the same part of the face, equally high."""
        free = self.bare
        by_term = np.zeros(free.weights.shape, np.complex128)
        by_mass = np.zeros(free.frequency.size, np.complex128)
        for parts, motion in zip((self.answers.even, self.answers.odd), self._motion, strict=True):
            for one, y in zip(parts, motion, strict=True):
                by_own, mass = one.band.slopes(y)
                by_term[one.at] += by_own
                by_mass[one.at] += mass
        made = assembled_slopes(free.shape, free.constants, free.frequency, self.capacitance, by_term, by_mass)
        t = self.stresses
        both = (self._receptance_of(self.dots, 1 + side * _STEP) for side in (1, -1))
        wider = (next(both) - next(both)) / (2 * _STEP)
        # what the dots' bases move is -D t, and so the footprints; their loads are in proportion to the area
        by_radius = 2 * np.pi * np.einsum("nk,nkl,nl->n", t, wider - 4 * self._receptance, t, optimize=True)
        return CapacitanceSlopes(
            made.capacitance,
            made.by_constant,
            made.by_log_radius + by_radius,
            made.by_log_thickness,
            made.by_log_density,
        )

    def moved(self, dots: tuple[PlacedDot, ...]) -> Complexes | None:
        """Return the capacitance with slightly different dots less the one with these, to first order, F, shape (N,).

        None if they are not on the same faces.
        """
        if [one.where for one in dots] != [one.where for one in self.dots]:
            return None
        t, free = self.stresses, self.bare
        changed = self._receptance_of(dots) - self._receptance
        made = 2 * np.pi * np.einsum("nk,nkl,nl->n", t, changed, t, optimize=True)
        pairs = list(zip(dots, self.footprints, strict=True))
        after = [replace(own, part=math.sqrt(one.dot.fraction)) for one, own in pairs]
        if after == list(self.footprints):
            return made
        blocks = [
            [new - old for new, old in zip(one.loads(free.disk), own.loads(free.disk), strict=True)]
            for one, own in zip(after, self.footprints, strict=True)
        ]
        for side, parts in enumerate((self.answers.even, self.answers.odd)):
            loads = np.hstack([block[side] for block in blocks]) * free.shape.radius**2
            for one, y in zip(parts, self._motion[side], strict=True):
                made[one.at] += 4 * np.pi * np.einsum("nk,nk->n", t[one.at], y @ (one.shapes.T @ loads))
        return made


def receptance(
    dots: Sequence[PlacedDot], counts: Sequence[int], shape: Shape, frequency: Frequencies, wider: float = 1.0
) -> Complexes:
    """Return what unit stresses move on the bases of dots on a disk, shape (N, K, K), m4/Pa; radii times `wider`.

    `counts`: number of functions of pressure and of shear stress on each base.
    """
    area, highest = np.pi * shape.radius**2, float(frequency[-1])
    made = np.zeros((frequency.size, 2 * sum(counts), 2 * sum(counts)), np.complex128)
    start = 0
    for one, count in zip(dots, counts, strict=True):
        at = slice(start, start + 2 * count)
        made[:, at, at] = DotBody(one.dot, one.dot.radius(area) * wider, highest, count).receptance(frequency)
        start = at.stop
    return made
