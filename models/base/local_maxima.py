"""Maxima of a curve, with their prominence.

Equivalent to `scipy.signal.find_peaks`, without the half second that importing `scipy.signal` takes: longer than a fit.
"""

import numpy as np
from numpy.typing import NDArray

from .arrays import Reals


def prominent_peaks(values: Reals, least: Reals | float) -> tuple[NDArray[np.intp], Reals]:
    """Return the interior maxima of `values`, shape (N,), of at least some prominence, and the prominence of each.

    Indices increase; a flat top counts once, at its middle. The prominence of a maximum is its height over the higher
    of its two valleys, each the minimum of the curve until it rises above the maximum or ends. `least`: of shape (N,),
    or one value for all.
    """
    begin = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1])  # of each run of equal values
    level, middle = values[begin], (begin + np.append(begin[1:], values.size) - 1) // 2
    top = np.zeros(level.size, bool)
    top[1:-1] = (level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])
    places = middle[top]
    prominences = np.array([_prominence(values, int(k)) for k in places], float)
    enough = prominences >= np.broadcast_to(least, values.shape)[places]
    return places[enough], prominences[enough]


def _prominence(values: Reals, k: int) -> float:
    higher = np.flatnonzero(values > values[k])
    at = int(np.searchsorted(higher, k))
    left = int(higher[at - 1]) + 1 if at else 0
    right = int(higher[at]) if at < higher.size else values.size
    return float(values[k] - max(values[left : k + 1].min(), values[k:right].min()))
