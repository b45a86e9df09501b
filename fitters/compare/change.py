"""The prior distributions of a change's sizes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals

Values = Mapping[str, float]
"""Sizes in SI units, by name."""
_LARGEST = 100.0
TERMINALS, DEVICE = "terminals", "layer:device"


@dataclass(frozen=True)
class ChangeSize:
    """A size of a change: log-normal, or normal if it may have either sign."""

    name: str
    unit: str
    median: float
    """Median; of a signed size, its mean."""
    spread: float
    """Standard deviation of its logarithm; of a signed size, of the size itself, in its unit."""
    signed: bool = False
    limits: tuple[float, float] = (-np.inf, np.inf)
    """What lies beyond counts as at the limit."""

    @property
    def lattice(self) -> Reals:
        """Coordinates at which a fit may begin; for a signed size they are denser near zero."""
        return 3.5 * np.sinh(np.linspace(-5, 5, 60)) / np.sinh(5.0) if self.signed else np.arange(-3.5, 3.6, 0.25)

    def value(self, x: float) -> float:
        """Return the size at a coordinate with a unit normal prior."""
        value = self.median + self.spread * x if self.signed else self.median * np.exp(min(self.spread * x, _LARGEST))
        return float(min(max(value, self.limits[0]), self.limits[1]))

    def slope(self, x: float) -> float:
        """Return d size / d coordinate."""
        return self.spread if self.signed else self.spread * self.value(x)
