"""How long a 4294A takes for a sweep.

A user of the instrument fitted this model and called it conservative: t = a/f + b for each point, by bandwidth.
Compared with recorded run times (400 points, 40 Hz to 110 MHz, point averaging on) it is 1.3 to 1.5 times too long, so
`estimated` errs on the safe side. Time grows linearly with either kind of averaging (measured for
point averaging, at factors 2 to 64).
"""

import numpy as np

from ...models.base.arrays import Frequencies

PERIODS: dict[int, float] = {1: 30.0, 2: 30.0, 3: 24.8, 4: 24.8, 5: 24.8}
"""a: periods of the signal each point takes, by bandwidth."""

SECONDS: dict[int, float] = {1: 3.2e-3, 2: 7.8e-3, 3: 14.4e-3, 4: 51.4e-3, 5: 160e-3}
"""b: additional time of each point in s, by bandwidth."""

PATIENCE = 1.5
MARGIN_SECONDS = 15.0


def estimated(
    frequency: Frequencies,
    bandwidth: int,
    point_average: int,
    sweep_average: int,
    point_delay: float,
    sweep_delay: float,
) -> float:
    """Return the seconds for `sweep_average` sweeps over `frequency` (Hz, shape (N,)); delays in s."""
    points = np.sum(PERIODS[bandwidth] / frequency + SECONDS[bandwidth])
    return float(sweep_average * (point_average * points + frequency.size * point_delay + sweep_delay))


def timeout(estimated_seconds: float) -> float:
    """Return the seconds after which a sweep that should take `estimated_seconds` counts as hung."""
    return PATIENCE * estimated_seconds + MARGIN_SECONDS
