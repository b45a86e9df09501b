"""A stack whose layers or electrodes do not all end at one radius: parts between radii, each with a section of its own.

Outwards electrodes and layers end and none begins, so that the functions of each part follow from those of the part
within it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from scipy.linalg import block_diag

from ..base.arrays import Complexes, Frequencies, Reals
from .joined import Contact, as_sums, joined
from .layer_mesh import LayerMesh
from .section import CrossSection
from .waves import Sizes, Waves, WholeMotion


@dataclass(frozen=True, eq=False)
class ZonedSection:
    """The sections of all parts from the axis outwards."""

    sections: tuple[CrossSection, ...]
    reaches: tuple[float, ...]
    """Outer radius of each part over that of the stack, rising."""
    contacts: tuple[Contact, ...]

    @classmethod
    def joining(cls, sections: Sequence[CrossSection], reaches: Sequence[float]) -> Self:
        """Return the stack of parts with these sections."""
        contacts = tuple(_contact(inner, outer) for inner, outer in pairwise(sections))
        return cls(tuple(sections), tuple(reaches), contacts)

    @classmethod
    def of(cls, meshes: Sequence[LayerMesh], piezo: int, reaches: Sequence[float], electrode: float) -> Self:
        """Return the stack of layers, back to front, with these elements from 0 to 1.

        `reaches`: radius of each layer over that of the stack; `electrode`: that of the electrodes of layer `piezo`.
        """
        radii = sorted({*reaches, electrode})
        sections = [
            CrossSection.of(
                meshes,
                piezo,
                missing=[k for k, reach in enumerate(reaches) if reach < radius],
                floats=electrode < radius <= reaches[piezo],
            )
            for radius in radii
        ]
        return cls.joining(sections, radii)

    @property
    def layers(self) -> int:
        """Number of layers."""
        return self.sections[0].layers

    @property
    def size(self) -> int:
        """Number of waves along r of all parts."""
        return sum(section.size for section in self.sections)


@dataclass(frozen=True, eq=False)
class ZonedWaves:
    """The waves of all parts."""

    section: ZonedSection
    sizes: Sizes
    waves: tuple[Waves, ...]

    @classmethod
    def of(cls, section: ZonedSection, sizes: Sizes, values: Complexes, frequency: Frequencies) -> Self:
        """Return the waves at frequencies in Hz, shape (F,), for constants of shape (F, 11 L + 2)."""
        return cls(section, sizes, tuple(Waves.of(own, sizes, values, frequency) for own in section.sections))

    def motion(self) -> WholeMotion:
        """Return the motion of the stack for one volt."""
        radius = self.sizes.radius / self.sizes.unit
        return joined(self.waves, [radius * reach for reach in self.section.reaches], self.section.contacts, self.sizes)


def inherited(inner: CrossSection, outer: CrossSection) -> dict[str, Reals]:
    """Return the functions `u`, `w` and `p` of a part over the nodes of the part around it, columns."""
    rows = np.concatenate(
        [
            np.arange(own[0], own[1] + 1)
            for own, kept in zip(inner.ends, outer.ends, strict=True)
            if own is not None and kept is not None
        ]
    )
    there = np.unique(rows)
    return {name: shape[there] for name, shape in inner.shapes.items()}


def _contact(inner: CrossSection, outer: CrossSection) -> Contact:
    """Return the contact of two parts: at its inner edge the outer one moves as the inner one does."""
    given = inherited(inner, outer)
    u, w = (as_sums(given[name], outer.shapes[name]) for name in ("u", "w"))
    p, lift = given["p"], outer.shapes["p"][:, 0]
    q = as_sums(np.column_stack([p[:, 1:], p[:, 0] - lift]), outer.shapes["p"][:, 1:])
    raised = np.zeros(outer.shapes["u"].shape[1] + outer.shapes["w"].shape[1])
    ends = inner.driven and outer.floats
    return Contact(
        np.asarray(block_diag(u, w, q[:, :-1]), np.float64),
        True,
        np.concatenate([raised, q[:, -1] if ends else np.zeros(len(q))]),
    )
