"""The notation `air | disk | glue | ml1 | air`: parts joined back to front."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from .stack import Stack


class Joins:
    """A part that can be joined in a row."""

    def __or__(self, other: Joins | LayerRow) -> LayerRow:
        """Return the row with `other` in front of this part."""
        return LayerRow((self,)) | other


@dataclass(frozen=True)
class LayerRow:
    """Parts back to front, not yet a stack: the area of the faces is missing."""

    parts: tuple[Joins, ...]
    stack_of: ClassVar[Callable[[Sequence[Joins], float], Stack]]
    """Makes a stack of a row; set by the module of stacks, which imports this one."""

    def __or__(self, other: Joins | LayerRow) -> LayerRow:
        """Return the row with `other` in front of these parts."""
        return LayerRow(self.parts + (other.parts if isinstance(other, LayerRow) else (other,)))

    def with_area(self, area: float) -> Stack:
        """Return the stack of these parts with faces of `area` m2. Raises StackError if a load is missing at an end."""
        return LayerRow.stack_of(self.parts, area)
