"""Is a residual noise? Stretches with more in it than noise, and courses that come back with a period.

Neither asks for physics. Both find what chi2 does not show: a few points out of place among 800, or a ripple that an
estimate of the noise from the recording itself takes for noise.
"""

from collections.abc import Iterable

import numpy as np

from ....models.base.arrays import Complexes

_LENGTHS = 1.5
"""Ratio of one window's length to the next shorter one's."""
_SURE = 15.0
"""Logarithm of the likelihood ratio of a stretch: of recordings of 801 points of noise, one in 1000 reaches it."""
_PERIODIC = 24.0
"""Power of a line, in half of what noise has on average: one of a million recordings of 801 points of noise has it."""


def structured(residuals: Iterable[Complexes]) -> bool:
    """Return whether what is left of a recording is no noise, small as it may be."""
    return any(uneven(residual, 1) or period(residual) for residual in residuals)


def uneven(residual: Complexes, most: int) -> list[tuple[float, int, int]]:
    """Return up to `most` stretches (ln of the likelihood ratio, first point, one past the last) of `residual`.

    `residual` is in units of noise of Re and Im each, shape (N,). A window whose variance is s times that of noise,
    over L points, has ln ratio L (s - 1 - ln s). None overlap; the surest first.
    """
    squares = np.abs(residual) ** 2 / 2
    running = np.concatenate([[0.0], np.cumsum(squares)])
    n, length = squares.size, 3.0
    windows: list[tuple[float, int, int]] = []
    while length < 0.7 * n:
        size = int(length)
        s = np.maximum((running[size:] - running[:-size]) / size, 1.0)
        ratio = size * (s - 1 - np.log(s))
        windows += [(float(ratio[k]), int(k), int(k) + size) for k in np.flatnonzero(ratio > _SURE)]
        length *= _LENGTHS
    windows.sort(reverse=True)
    kept: list[tuple[float, int, int]] = []
    for one in windows:
        if len(kept) == most:
            break
        if all(one[2] <= a or one[1] >= b for _, a, b in kept):
            kept.append(one)
    return kept


def period(residual: Complexes) -> float | None:
    """Return the period in points of what comes back in `residual`, shape (N,), or None where nothing does.

    R. A. Fisher's test for the largest line of a periodogram (Proc. R. Soc. A 125 (1929) 54); the mean power of the
    other lines is the noise, so that a noise that is not quite known does no harm.
    """
    n = residual.size
    spectrum = np.abs(np.fft.fft(residual - np.mean(residual))) ** 2
    # a ripple of ln Z has a line at both signs of its frequency
    power = spectrum[1 : (n - 1) // 2 + 1] + spectrum[: -((n - 1) // 2) - 1 : -1]
    at = int(np.argmax(power))
    floor = float(np.sum(power) - power[at]) / max(power.size - 1, 1)
    return n / (at + 1) if floor > 0 and 2 * power[at] / floor > _PERIODIC else None
