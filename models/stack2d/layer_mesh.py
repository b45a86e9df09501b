"""Elements through a layer, from 0 to 1, each with polynomials of its own degree."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Reals
from ..disk2d.line_elements import LineElements

_TIPS, _DEGREES = (5e-4, 5e-3, 5e-2), (2, 3, 4)
# Ends of the elements beside a face on which an electrode or a layer ends, over the thickness of the whole stack, and
# their degrees: fields are singular there.
_WIDEST = 0.4
# Widest of them, over the thickness of the layer.


@dataclass(frozen=True)
class LayerMesh:
    """A mesh through a layer."""

    breaks: tuple[float, ...]
    """Ends of the elements, rising from 0 to 1."""
    degrees: tuple[int, ...]
    """Degree of each."""

    @classmethod
    def of(cls, degree: int) -> "LayerMesh":
        """Return a mesh of one element."""
        return cls((0.0, 1.0), (degree,))

    @classmethod
    def graded(cls, degree: int, length: float, finer: int = 0) -> "LayerMesh":
        """Return a mesh that is graded towards both ends.

        `length`: of a stack over the thickness of this layer of it; `finer`: further degrees of the elements beside
        the ends.
        """
        tips = [(length * tip, own + finer) for tip, own in zip(_TIPS, _DEGREES, strict=True) if length * tip < _WIDEST]
        ends, degrees = [tip for tip, _ in tips], [own for _, own in tips]
        breaks = (0.0, *ends, *(1 - end for end in reversed(ends)), 1.0)
        return cls(breaks, (*degrees, degree, *reversed(degrees)))

    @property
    def size(self) -> int:
        """Number of nodes."""
        return sum(self.degrees) + 1

    @property
    def nodes(self) -> Reals:
        """Positions of the nodes, shape (size,)."""
        return np.append(np.concatenate([element.nodes[:-1] for element in self._elements]), 1.0)

    def integral(self, first: int, second: int) -> Reals:
        """Return the integrals of N_i N_k, shape (size, size); `first`, `second`: 1 for the derivative, or 0."""
        made, start = np.zeros((self.size, self.size)), 0
        for element in self._elements:
            own = slice(start, start + element.size)
            made[own, own] += element.integral(first, second).toarray()
            start += element.size - 1
        return made

    @property
    def _elements(self) -> list[LineElements]:
        return [
            LineElements(np.array(ends), own) for ends, own in zip(pairwise(self.breaks), self.degrees, strict=True)
        ]
