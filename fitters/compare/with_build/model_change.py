"""A change in a device that a build describes.

    ln Z after = ln Z before + ln Z(constants before, change) - ln Z(constants before)

What the model cannot describe is in both terms, and cancels. What was there before and is gone has its constants from
the recording after. Several changes act together in one model.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ..change import ChangeSize, Values
from ..resonances import Resonances
from .found_device import Apply, FoundDevice, Step


@dataclass(frozen=True, eq=False)
class ModelChange:
    """An effect, or another value of a constant, at its place in the device."""

    effect: str
    where: str
    sizes: tuple[ChangeSize, ...]
    says: str
    apply: Apply
    """Returns the device with the change."""
    found: FoundDevice
    odds: float
    taken: bool = False
    """Whether it was present before and is gone; `found` is then the device after."""
    main: int = 1
    """Number of first sizes; they, or a combination of them, must be determined."""
    starts: tuple[tuple[float, ...], ...] = ()
    derived: Callable[[Values], dict[str, tuple[float, str]]] | None = None
    """Values derived from its sizes, with units."""
    before: Apply | None = None
    """What of it was in the device before, for another size of the same effect; None for nothing."""
    alone: bool = False
    """Whether no other change of the device's model goes with it, because it changes the layers."""

    def act(
        self, Z: Impedances, own: Resonances, frequency: Frequencies, steps: Sequence[Step], constants: Reals | None
    ) -> Impedances:
        """Return Z after it, ohm, shape (N,).

        `steps`: it and the changes before it, with their sizes; `constants`: coordinates of the device's, if moved.
        """
        moved = np.exp(self._found(constants).log_ratio(frequency, steps, own))
        return Z / moved if self.taken else Z * moved

    def errors(self, frequency: Frequencies, steps: Sequence[Step], constants: Reals | None) -> tuple[Complexes, int]:
        """Return errors of ln Z after by the uncertain constants and the discrepancy of the model, shape (N, K).

        And how many of them are constants.
        """
        found = self._found(constants)
        sign = -1 if self.taken else 1
        parts = found.of_constants(frequency, steps), found.of_discrepancy(frequency, steps)
        return np.asarray(sign * np.hstack(parts), np.complex128), parts[0].shape[1]

    def _found(self, constants: Reals | None) -> FoundDevice:
        return self.found if constants is None else self.found.moved(constants)
