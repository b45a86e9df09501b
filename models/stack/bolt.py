"""A bolt that presses layers together: an elastic path parallel to them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from ..base.arrays import Complexes, Frequencies, j_omega
from .loss_laws import require_positive

NAME = "bolt"
"""Prefix of its parameter."""


@dataclass(frozen=True)
class Bolt:
    """A spring without mass from the front face of one layer to the back face of another.

    It acts where both layers are there.
    """

    behind: str
    """The layer that holds its back end."""
    before: str
    """The layer that holds its front end."""
    stiffness: float
    """Force per elongation E A/length, N/m, of the whole area."""

    def __post_init__(self) -> None:
        require_positive(NAME, stiffness=self.stiffness)

    def with_stiffness(self, stiffness: float) -> Self:
        """Return the bolt with this stiffness, N/m."""
        return replace(self, stiffness=stiffness)

    def ends(self, sections: Mapping[str, range]) -> tuple[int, int] | None:
        """Return the interfaces of its ends, or None if it has not both; `sections`: of each layer of the row."""
        if self.behind not in sections or self.before not in sections:
            return None
        ends = sections[self.behind].stop, sections[self.before].start
        return ends if ends[0] < ends[1] else None

    def compliance(self, frequency: Frequencies, area: float) -> Complexes:
        """Return the velocity difference of its ends per pressure, 1/Rayl, shape (N,)."""
        return j_omega(frequency) * (area / self.stiffness)
