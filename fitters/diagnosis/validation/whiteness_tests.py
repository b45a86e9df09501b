"""Whiteness tests of a residual: stretches with more than noise, and periodic ripple.

Neither needs a physical model. Both find what chi2 does not show: a few outliers among 800 points, or a ripple that a
noise estimate from the recording itself mistakes for noise.
"""

from collections.abc import Iterable

import numpy as np

from ....models.base.arrays import Complexes

_LENGTHS = 1.5
"""Ratio of successive window lengths."""
_SURE = 15.0
"""ln likelihood ratio of a significant stretch: one in 1000 recordings of 801 points of pure noise reaches it."""
_PERIODIC = 24.0
"""Power of a line, in halves of the mean noise power: one in a million recordings of 801 points of noise reaches it."""


def structured(residuals: Iterable[Complexes]) -> bool:
    """Return whether any residual differs significantly from white noise, however small it is."""
    return any(uneven(residual, 1) or period(residual) for residual in residuals)


def uneven(residual: Complexes, most: int) -> list[tuple[float, int, int]]:
    """Return up to `most` stretches of `residual` as (ln likelihood ratio, first point, one past the last).

    `residual` is in units of the noise of Re and Im each, shape (N,). A window of L points whose variance is s times
    that of noise has the ln ratio L (s - 1 - ln s). Stretches do not overlap; the most significant comes first.
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
    """Return the period in points of a ripple in `residual`, shape (N,), or None if there is none.

    R. A. Fisher's test for the largest line of a periodogram (Proc. R. Soc. A 125 (1929) 54); the noise is the mean
    power of the other lines, so that it need not be known exactly.
    """
    n = residual.size
    spectrum = np.abs(np.fft.fft(residual - np.mean(residual))) ** 2
    # a ripple of ln Z has lines at both signs of its frequency
    power = spectrum[1 : (n - 1) // 2 + 1] + spectrum[: -((n - 1) // 2) - 1 : -1]
    at = int(np.argmax(power))
    floor = float(np.sum(power) - power[at]) / max(power.size - 1, 1)
    return n / (at + 1) if floor > 0 and 2 * power[at] / floor > _PERIODIC else None
