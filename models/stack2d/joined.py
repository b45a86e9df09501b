"""Parts of a stack between radii, each with waves of its own: their contact, and the motion of all for one volt.

At the radius where two parts meet, the functions of one are sums of those of the other (it follows): a layer ends
there, a bond opens, an electrode ends. Both have the same displacements and potentials, and the forces and charges of
the one that follows are those of the other (mode matching): linear equations for the amplitudes of all waves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Complexes, Reals
from .section import PERMITTIVITY
from .waves import Motion, Rim, Sizes, Waves, WholeMotion, decaying, motion, standing

_Row: TypeAlias = tuple[Sequence[tuple[slice, Complexes]], Complexes]
# Equations: the factors of the amplitudes at each place, shapes (F, n, N), and their right side, (F, n).
_NONE: Complexes = np.zeros(1, np.complex128)


@dataclass(frozen=True, eq=False)
class Contact:
    """Where two parts meet."""

    sums: Reals
    """The functions of the part that follows as sums of those of the other, over u, w and q, shape (N, N other)."""
    outer_follows: bool
    """Whether the outer part follows, or the inner one."""
    lift: Reals
    """One volt between the electrodes over the functions of the part that follows, if they end there, shape (N,)."""


@dataclass(frozen=True, eq=False)
class _Part:
    """The waves of a part between its radii, and a constant potential if its potential is free."""

    waves: Waves
    inner: Rim | None
    """None at the axis."""
    outer: Rim
    at: slice
    """Its amplitudes among those of all parts."""

    @property
    def _constant(self) -> int:
        """Index of the constant potential among the functions."""
        return self.waves.U.shape[1] + self.waves.wide["W"].shape[1]

    @property
    def pulled(self) -> NDArray[np.intp]:
        """The functions whose forces are not zero by themselves, as that of a constant potential is."""
        every = np.arange(self.waves.U.shape[1] + self.waves.p.shape[1], dtype=np.intp)
        return np.delete(every, self._constant) if self.waves.section.floats else every

    def displacements(self, rim: Rim) -> Complexes:
        """Return the displacements that each amplitude makes at a rim, shape (F, functions, N)."""
        made = self.waves.displacements(rim)
        if not self.waves.section.floats:
            return made
        whole = np.pad(made, ((0, 0), (0, 0), (0, 1)))
        whole[:, self._constant, -1] = 1.0
        return whole

    def forces(self, rim: Rim) -> Complexes:
        """Return the forces that each amplitude makes on a rim, shape (F, functions, N)."""
        made = self.waves.stresses(rim)
        return np.pad(made, ((0, 0), (0, 0), (0, 1))) if self.waves.section.floats else made

    def motion(self, amplitudes: Complexes) -> Motion:
        """Return its motion with the amplitudes of all parts, shape (F, all)."""
        own = amplitudes[:, self.at]
        waves = own[:, : own.shape[1] - self.waves.section.floats]
        return self.waves.with_amplitudes(waves, self.inner, self.outer)


def joined(zones: Sequence[Waves], radii: Sequence[float], contacts: Sequence[Contact], sizes: Sizes) -> WholeMotion:
    """Return the motion of a stack for one volt, free at its rim and at that of its hole.

    `zones`: waves of each part from the axis or the hole outwards; `radii`: their outer ones over the unit of length.
    """
    parts = _parts(zones, radii, sizes.hole / sizes.unit)
    edges = [part.inner for part in parts[1:] if part.inner is not None]
    meetings = list(zip(contacts, pairwise(parts), edges, strict=True))
    rows = [row for contact, (inner, outer), edge in meetings for row in _meeting(contact, inner, outer, edge)]
    first, last = parts[0], parts[-1]
    rims = [(last, last.outer), *([(first, first.inner)] if first.inner is not None else [])]
    rows += [([(part.at, part.forces(rim)[:, part.pulled])], -part.waves.forces[:, part.pulled]) for part, rim in rims]
    amplitudes = _solved(rows, last.at.stop)
    motions = tuple(part.motion(amplitudes) for part in parts)
    pairs_of = zip(parts, motions, strict=True)
    charge = sum((part.waves.charge(own) for part, own in pairs_of if part.waves.section.driven), _NONE)
    for contact, (_, outer), edge in meetings:
        if np.any(contact.lift):
            # what flows along r from where the electrodes end
            flux = (outer.forces(edge) @ amplitudes[:, outer.at, None])[:, :, 0] @ contact.lift
            charge = charge + 2 * np.pi * edge.radius * flux
    return WholeMotion(charge * PERMITTIVITY * sizes.unit, motions)


def whole_motion(waves: Waves, sizes: Sizes) -> WholeMotion:
    """Return the motion of a stack that is the same everywhere for one volt."""
    return joined((waves,), (sizes.radius / sizes.unit,), (), sizes) if sizes.hole > 0 else motion(waves, sizes)


def _meeting(contact: Contact, inner: _Part, outer: _Part, edge: Rim) -> list[_Row]:
    """Return the equations of two parts at the edge where they meet: of displacements and of forces."""
    here, there = (inner, inner.outer), (outer, edge)
    (leader, at), (follower, its) = (here, there) if contact.outer_follows else (there, here)
    A, kept = contact.sums, leader.pulled
    moved = [(follower.at, follower.displacements(its)), (leader.at, -(A @ leader.displacements(at)))]
    pulled = [(follower.at, (A.T @ follower.forces(its))[:, kept]), (leader.at, -leader.forces(at)[:, kept])]
    wide, other = leader.waves, follower.waves
    return [
        (moved, wide.still @ A.T + contact.lift - other.still),
        (pulled, (wide.forces - other.forces @ A)[:, kept]),
    ]


def _solved(rows: Sequence[_Row], size: int) -> Complexes:
    """Return the amplitudes that fulfil linear equations, shape (F, size)."""
    right = np.concatenate([given for _, given in rows], axis=1)
    equations, start = np.zeros((*right.shape, size), np.complex128), 0
    for terms, given in rows:
        end = start + given.shape[1]
        for at, own in terms:
            equations[:, start:end, at] = own
        start = end
    return np.asarray(np.linalg.solve(equations, right[:, :, None])[:, :, 0], np.complex128)


def as_sums(columns: Reals, of: Reals) -> Reals:
    """Return the coefficients of columns as sums of those of another matrix."""
    if of.shape[1] == 0:
        return np.zeros((0, columns.shape[1]))
    return np.asarray(np.linalg.lstsq(of, columns)[0], np.float64)


def _parts(zones: Sequence[Waves], radii: Sequence[float], hole: float) -> list[_Part]:
    """Return the parts with their cylinder functions: those that stand and, away from the axis, those that decay."""
    made: list[_Part] = []
    b, start = hole, 0
    for own, a in zip(zones, radii, strict=True):
        inner, outer, waves = None, standing(own.k, a, a), own
        if b > 0:
            inner, outer = (standing(own.k, r, a).beside(decaying(own.k, r, b)) for r in (b, a))
            waves = own.doubled
        end = start + waves.k.shape[1] + own.section.floats
        made.append(_Part(waves, inner, outer, slice(start, end)))
        b, start = a, end
    return made
