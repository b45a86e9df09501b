"""Adaptive sweep plans, made from fast preliminary sweeps, with their points where the resonances are.

The information about a resonance lies within a few linewidths f/Q of its maxima: of G/w (series) and of w R (parallel).
The plan has at least 20 points per linewidth there, some on the shoulders, and elsewhere as few as a smooth curve
needs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...models.base.errors import CannotError
from ...models.sweep import Sweep
from ...models.sweep_plan import Segment, SweepPlan
from ..base.capabilities import Capabilities
from .resonances import Resonance, resonances

POINTS_PER_LINEWIDTH = 20
"""Least number of points per linewidth in the core of a resonance."""
CORE = 1.0
"""Half width of the core, in linewidths."""
SHOULDER, POINTS_PER_LINEWIDTH_THERE = 4.0, 4
"""Half width of the shoulders, in linewidths, and the points per linewidth there."""
BACKGROUND_POINTS = 120
"""Number of background points over the whole range, in equal ratios of frequency."""

LOOK_POINTS = 1586
"""Points of the first preliminary sweep: 0.3 % apart over a ratio of 160, two full sweeps of 801 points."""
ZOOM_POINTS = 101
MOST_ZOOMS = 3

WIDEST_RATIO = 1.5
"""Greatest frequency ratio of a background stretch, whose points are equally spaced."""


class AdaptiveError(CannotError):
    """No adaptive plan can be made from the preliminary sweeps."""


@dataclass(frozen=True)
class _Stretch:
    """A stretch from `low` to `high` (Hz) with points `step` (Hz) apart."""

    low: float
    high: float
    step: float

    @property
    def count(self) -> int:
        """The number of points, without the one at `high`."""
        return max(2, math.ceil((self.high - self.low) / self.step))

    def joined(self, following: "_Stretch") -> "_Stretch":
        return _Stretch(self.low, following.high, min(self.step, following.step))


@dataclass(frozen=True)
class Adapted:
    """An adaptive plan, and the resonances it is based on."""

    plan: SweepPlan
    resonances: tuple[Resonance, ...]
    """Resonances with 20 points per linewidth or more, in rising order."""
    left_out: tuple[Resonance, ...]
    """Weaker resonances for which the time is too short."""
    looks: tuple[Sweep, ...]
    """The preliminary sweeps."""


def adapted(
    base: SweepPlan, seconds: float, measure: Callable[[SweepPlan], Sequence[Sweep]], can: Capabilities
) -> Adapted:
    """Make preliminary sweeps over the range of `base` and return a plan; together they take about `seconds`.

    `measure` carries out a plan on an analyzer with the capabilities `can`: one fast sweep, then closer ones where a
    resonance is too narrow for it. Raises AdaptiveError if there is no resonance or too little time, and what `measure`
    raises.
    """
    looks = tuple(measure(look_plan(base, can)))
    seen = resonances(looks)
    for _ in range(MOST_ZOOMS):
        narrow = [resonance for resonance in seen if not resonance.resolved]
        if not narrow:
            break
        looks += tuple(measure(zoom_plan(base, narrow, can)))
        seen = resonances(looks)
    if not seen and all(np.median(look.impedance.real) < 0 for look in looks):
        raise AdaptiveError(
            "preliminary sweep: Re Z is negative, as in no passive device; is the polarity of the leads right?"
        )
    fast = look_plan(base, can)
    spent = sum(can.points_seconds(fast, look.frequency) + can.segment_seconds(fast) for look in looks)
    plan, kept = adaptive_plan(base, seen, seconds - spent, can)
    return Adapted(plan, kept, tuple(resonance for resonance in seen if resonance not in kept), looks)


def look_plan(base: SweepPlan, can: Capabilities) -> SweepPlan:
    """Return the plan of the fast preliminary sweep over the range of `base`, at its level and bias."""
    whole = Segment(*_range(base), LOOK_POINTS, "log")
    return replace(base, segments=(whole,), bandwidth=can.bandwidths[0], point_average=1, sweep_average=1, joined=False)


def zoom_plan(base: SweepPlan, narrow: Sequence[Resonance], can: Capabilities) -> SweepPlan:
    """Return the plan of closer preliminary sweeps of resonances that were too narrow for the last one."""
    low, high = _range(base)
    spans = [(max(low, seen.frequency - 8 * seen.step), min(high, seen.frequency + 8 * seen.step)) for seen in narrow]
    segments = tuple(Segment(a, b, ZOOM_POINTS) for a, b in _merged(spans))
    return replace(look_plan(base, can), segments=segments)


def adaptive_plan(
    base: SweepPlan, seen: Sequence[Resonance], seconds: float, can: Capabilities
) -> tuple[SweepPlan, tuple[Resonance, ...]]:
    """Return the plan of one recording of about `seconds`, and the resonances with their own points, in rising order.

    Range, level, bandwidth, averaging and bias are those of `base`. If the time is too short for all resonances, the
    weakest get background points only; if there is more time, all densities rise by the same factor. Raises
    AdaptiveError if there is no resonance, or not enough time for one.
    """
    if not seen:
        low, high = _range(base)
        raise AdaptiveError(
            f"preliminary sweep: no resonance between {low / 1e3:.5g} and {high / 1e3:.5g} kHz above the background; "
            "sweep with fixed points, or over another range"
        )
    kept = sorted(seen, key=lambda resonance: -resonance.strength)
    while can.seconds(shortest := _with_density(base, kept, 1.0, can)) > seconds:
        if len(kept) == 1:
            raise AdaptiveError(
                f"adaptive sweep: {seconds:.3g} s are left, but a single resonance with {POINTS_PER_LINEWIDTH} points "
                f"per linewidth takes {can.seconds(shortest):.3g} s; allow more points or a wider bandwidth"
            )
        kept.pop()
    return _fill(base, kept, seconds, can), tuple(sorted(kept, key=lambda resonance: resonance.frequency))


def _fill(base: SweepPlan, kept: Sequence[Resonance], seconds: float, can: Capabilities) -> SweepPlan:
    """Return the densest plan that takes at most `seconds`."""
    low, high = 1.0, 2.0
    while can.seconds(_with_density(base, kept, high, can)) <= seconds:
        low, high = high, 2 * high
    for _ in range(20):
        middle = (low + high) / 2
        if can.seconds(_with_density(base, kept, middle, can)) <= seconds:
            low = middle
        else:
            high = middle
    return _with_density(base, kept, low, can)


def _range(plan: SweepPlan) -> tuple[float, float]:
    return min(s.start_Hz for s in plan.segments), max(s.stop_Hz for s in plan.segments)


def _with_density(base: SweepPlan, kept: Sequence[Resonance], factor: float, can: Capabilities) -> SweepPlan:
    """Return the plan with `factor` times the least number of points everywhere."""
    low, high = _range(base)
    ratio = (high / low) ** (1 / (BACKGROUND_POINTS * factor))
    tiers = [
        (
            peak.frequency - reach * peak.linewidth,
            peak.frequency + reach * peak.linewidth,
            peak.linewidth / per / factor,
        )
        for peak in kept
        for reach, per in ((CORE, POINTS_PER_LINEWIDTH), (SHOULDER, POINTS_PER_LINEWIDTH_THERE))
    ]
    rungs = np.geomspace(low, high, 2 + int(np.log(high / low) / np.log(WIDEST_RATIO))).tolist()[1:-1]
    edges = {low, high, *rungs, *(edge for a, b, _ in tiers for edge in (a, b) if low < edge < high)}
    stretches = [
        _Stretch(a, b, min([(ratio - 1) * a, *(step for x, y, step in tiers if x <= (a + b) / 2 <= y)]))
        for a, b in pairwise(sorted(edges))
    ]
    cheap = can.segment_seconds(base) / can.points_seconds(base, np.array([np.sqrt(low * high)]))
    return replace(base, segments=_segments(_simplified(stretches, cheap)), joined=True)


def _simplified(stretches: Sequence[_Stretch], cheap: float) -> list[_Stretch]:
    """Return fewer stretches, nowhere wider spaced: join neighbours if that costs at most `cheap` points."""
    joined = list(stretches)
    while len(joined) > 1:
        pairs = [left.joined(right) for left, right in pairwise(joined)]
        costs = [
            both.count - left.count - right.count for both, (left, right) in zip(pairs, pairwise(joined), strict=True)
        ]
        k = int(np.argmin(costs))
        if costs[k] > cheap:
            break
        joined[k : k + 2] = [pairs[k]]
    return joined


def _segments(stretches: Sequence[_Stretch]) -> tuple[Segment, ...]:
    """Return each stretch as a segment that ends one step before the next one starts; the last ends at its end."""
    *inner, last = stretches
    before = (Segment(part.low, part.high - (part.high - part.low) / part.count, part.count) for part in inner)
    return (*before, Segment(last.low, last.high, last.count + 1))


def _merged(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return spans of frequency in rising order, with overlapping ones joined."""
    merged: list[tuple[float, float]] = []
    for a, b in sorted(spans):
        if merged and a <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(b, merged[-1][1]))
        else:
            merged.append((a, b))
    return merged
