"""Searches on a trace: extremes, marker peaks, targets, the width of a resonance, ripples (PM p.96-109)."""

from collections.abc import Iterator

import numpy as np

from ...models.base.arrays import Reals
from .search_range import Indices


def marker_peaks(x: Reals, y: Reals, dx: float, dy: float, negative: bool) -> Indices:
    """Return the points that rise from both neighbours with at least the slope dy/dx (PM fig. 7-1), highest first."""
    shown = -y if negative else y
    steepness = dy / dx if dx else np.inf
    rise = np.diff(shown)
    slope = np.abs(rise) / np.maximum(np.abs(np.diff(x)), 1e-300) >= steepness
    inner = np.flatnonzero((rise[:-1] > 0) & (rise[1:] < 0) & slope[:-1] & slope[1:]) + 1
    return inner[np.argsort(-shown[inner], kind="stable")]


def crossings(x: Reals, y: Reals, target: float) -> Reals:
    """Return where the trace crosses the target, in order, interpolated between points."""
    off = y - target
    k = np.flatnonzero(off[:-1] * off[1:] < 0)
    between = x[k] + (x[k + 1] - x[k]) * off[k] / (off[k] - off[k + 1])
    return np.sort(np.concatenate([x[off == 0], between]))


def sides(x: Reals, y: Reals, at: float, target: float) -> Iterator[tuple[float, float]]:
    """Yield the pairs of crossings left and right of `at`, the nearest pair first."""
    every = crossings(x, y, target)
    yield from zip(every[every < at][::-1].tolist(), every[every > at].tolist(), strict=False)


def analysis_peaks(y: Reals, height: float, ratio: bool, negative: bool) -> Indices:
    """Return the peaks that stand out by `height` (or by this ratio) on both sides, from left to right."""
    from scipy.signal import find_peaks  # imported late: slow to load and rarely needed

    shown = np.log(np.maximum(np.abs(y), 1e-300)) if ratio else y
    least = np.log(max(height, 1.0)) if ratio else height
    places, _ = find_peaks(-shown if negative else shown, prominence=max(float(least), 1e-300))
    return np.asarray(places, dtype=np.intp)


def ripples(y: Reals, peaks: Indices, dips: Indices) -> tuple[float, float]:
    """Return the largest drops from a peak to the dips left and right of it; 0 where there is no dip."""
    left = [float(y[p] - y[dips[dips < p][-1]]) for p in peaks if np.any(dips < p)]
    right = [float(y[p] - y[dips[dips > p][0]]) for p in peaks if np.any(dips > p)]
    return max(left, default=0.0), max(right, default=0.0)
