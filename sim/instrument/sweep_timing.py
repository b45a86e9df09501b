"""How long a sweep takes (reference 3.1): each point t = a/f + b, times the averaging at the point."""

import numpy as np

from ...models.base.arrays import Reals
from .axis import Axis

CYCLES = np.array([30.0, 30.0, 24.8, 24.8, 24.8])
"""a: periods of the signal that a point takes, by BWFACT 1 to 5."""

SETTLING = np.array([3.2e-3, 7.8e-3, 14.4e-3, 51.4e-3, 160e-3])
"""b: seconds that a point takes whatever its frequency, by BWFACT 1 to 5."""


def point_seconds(axis: Axis, point_delay: float = 0.0) -> Reals:
    """Return the seconds that each point takes, shape (N,)."""
    index = axis.bandwidth.astype(int) - 1
    return (CYCLES[index] / axis.frequency + SETTLING[index]) * axis.point_average + point_delay
