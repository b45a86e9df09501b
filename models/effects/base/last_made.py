"""What was computed last for one device and one set of frequencies."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from ...base.arrays import Frequencies

_Made = TypeVar("_Made")


@dataclass(eq=False)
class LastMade(Generic[_Made]):
    """A one-entry cache by device and frequency, both compared by identity."""

    _known: tuple[object, Frequencies, _Made] | None = None

    def of(self, device: object, frequency: Frequencies, make: Callable[[], _Made]) -> _Made:
        """Return what was made for these, or make it; it is kept if the frequencies cannot change."""
        if self._known is not None and self._known[0] is device and self._known[1] is frequency:
            return self._known[2]
        made = make()
        if not frequency.flags.writeable:
            self._known = device, frequency, made
        return made
