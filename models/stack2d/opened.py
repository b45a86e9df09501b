"""A stack whose bond is open from the axis to a radius: the motion within, the motion around, and their contact.

Within the radius nothing joins the layers before and behind the opening, so that they carry waves of their own; around
it the stack is whole.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ..base.arrays import Complexes, Frequencies, Reals
from .joined import Contact, as_sums, joined
from .section import CrossSection
from .waves import Side, Sizes, Waves, WholeMotion

Flags: TypeAlias = NDArray[np.bool_]
_SAME = 1e-10
# Relative singular value below which functions of one side are sums of others.


@dataclass(frozen=True)
class Opening:
    """A round opening in the middle of a bond."""

    apart: tuple[int, int]
    """Indices of the layers that face each other in it, from back to front; a layer between them is missing there."""
    fraction: float
    """Part of the area that is open, 0 to 1, both excluded."""


@dataclass(frozen=True, eq=False)
class OpenedSection:
    """A section with an opening between two of its layers."""

    whole: CrossSection
    opened: CrossSection
    """The same functions of z; those of u_r and u_z are free to jump at the opening."""
    jumps: Reals
    """The functions of the whole as sums of those of the opened, over u, w and q, shape (N opened, N whole)."""
    sides: tuple[Side, Side]
    """The functions of the opened that live behind the opening and before it."""

    @classmethod
    def of(cls, whole: CrossSection, apart: tuple[int, int]) -> Self:
        """Return the section opened between two layers, given by their indices; a layer between them is missing."""
        behind, ahead = apart
        sizes = [mesh.size - 1 for mesh in whole.meshes]
        last, first = sum(sizes[: behind + 1]), sum(sizes[:ahead])  # nodes on both sides of the opening
        full = CrossSection.of(whole.meshes, whole.piezo, missing=range(behind + 1, ahead), torn=ahead)
        functions, maps, of_behind = dict[str, Reals](), dict[str, Reals](), dict[str, Flags]()

        def torn(columns: Reals) -> tuple[Reals, Reals]:
            before, beyond = np.zeros_like(columns[: last + 1]), np.zeros_like(columns[first:])
            return np.vstack([columns[: last + 1], beyond]), np.vstack([before, columns[first:]])

        for name in ("u", "w"):
            sides = torn(whole.shapes[name])
            parts = [_independent(side) for side in sides]
            functions[name] = np.hstack(parts)
            maps[name] = as_sums(sides[0] + sides[1], functions[name])
            of_behind[name] = np.repeat([True, False], [part.shape[1] for part in parts])
        # the potential stays within the ceramic: its face at the opening is one of the two
        ceramic_behind = whole.piezo <= behind
        p = torn(whole.shapes["p"])[0 if ceramic_behind else 1]
        functions["q"] = as_sums(p[:, 1:], full.shapes["p"][:, 1:])
        maps["q"] = np.eye(p.shape[1] - 1)
        of_behind["w"] = np.append(of_behind["w"], np.full(p.shape[1] - 1, ceramic_behind))
        one, other = (
            (np.flatnonzero(of_behind["u"] == side), np.flatnonzero(of_behind["w"] == side)) for side in (True, False)
        )
        return cls(whole, full.projected(functions), _on_diagonal(list(maps.values())), (one, other))


def _independent(columns: Reals) -> Reals:
    """Return orthonormal columns that span these."""
    vectors, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(vectors[:, sizes > _SAME * sizes[0]], np.float64)


def _on_diagonal(blocks: Sequence[Reals]) -> Reals:
    return np.asarray(block_diag(*blocks), np.float64)


@dataclass(frozen=True, eq=False)
class OpenedWaves:
    """The waves within an opening and around it, whatever its size."""

    section: OpenedSection
    sizes: Sizes
    within: Waves
    around: Waves

    @classmethod
    def of(cls, section: OpenedSection, sizes: Sizes, values: Complexes, frequency: Frequencies) -> Self:
        """Return the waves at frequencies in Hz, shape (F,), for constants of shape (F, 11 L + 2)."""
        within = Waves.of(section.opened, sizes, values, frequency, section.sides)
        return cls(section, sizes, within, Waves.of(section.whole, sizes, values, frequency))

    def motion(self, fraction: float) -> WholeMotion:
        """Return the motion of the stack for one volt if this part of the bond is open."""
        a = self.sizes.radius / self.sizes.unit
        contact = Contact(self.section.jumps, False, np.zeros(len(self.section.jumps)))
        return joined((self.within, self.around), (math.sqrt(fraction) * a, a), (contact,), self.sizes)
