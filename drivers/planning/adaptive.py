"""From a fast look to a sweep plan with its points where the resonances are.

A resonance says what it has to say within a few linewidths f/Q of its maxima: of G/w (series) and of w R (parallel).
There the plan has at least 20 points per linewidth, some on the shoulders, and elsewhere as few as a smooth curve
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
"""In the core of a resonance, at least."""
CORE = 1.0
"""Half width of the core, in linewidths."""
SHOULDER, POINTS_PER_LINEWIDTH_THERE = 4.0, 4
"""Half width of the shoulders, in linewidths, and the points there."""
BACKGROUND_POINTS = 120
"""Over the whole range, in equal ratios of frequency."""

LOOK_POINTS = 1586
"""Of the fast look: 0.3 % apart over a ratio of 160; an analyzer of 801 points makes it in two full sweeps."""
ZOOM_POINTS = 101
MOST_ZOOMS = 3

WIDEST_RATIO = 1.5
"""Of a background stretch's ends: its points are in equal steps."""


class AdaptiveError(CannotError):
    """No plan can be made of what was seen."""


@dataclass(frozen=True)
class _Stretch:
    """From `low` to `high` (Hz) points are `step` (Hz) apart."""

    low: float
    high: float
    step: float

    @property
    def count(self) -> int:
        """How many points it has, the one at `high` not counted."""
        return max(2, math.ceil((self.high - self.low) / self.step))

    def joined(self, following: "_Stretch") -> "_Stretch":
        return _Stretch(self.low, following.high, min(self.step, following.step))


@dataclass(frozen=True)
class Adapted:
    """What to measure, and why."""

    plan: SweepPlan
    resonances: tuple[Resonance, ...]
    """Those with 20 points per linewidth or more, in rising order."""
    left_out: tuple[Resonance, ...]
    """Weaker ones, for which the time was too short."""
    looks: tuple[Sweep, ...]
    """What the resonances were seen in."""


def adapted(
    base: SweepPlan, seconds: float, measure: Callable[[SweepPlan], Sequence[Sweep]], can: Capabilities
) -> Adapted:
    """Look at the device over the range of `base` and return the plan that takes about `seconds`, the looks included.

    `measure` carries out a plan, on an analyzer that `can` this: the fast look, then closer ones where a resonance is
    too narrow for it. Raises AdaptiveError where nothing is seen or the time is too short, and what `measure` raises.
    """
    looks = tuple(measure(look_plan(base, can)))
    seen = resonances(looks)
    for _ in range(MOST_ZOOMS):
        narrow = [one for one in seen if not one.resolved]
        if not narrow:
            break
        looks += tuple(measure(zoom_plan(base, narrow, can)))
        seen = resonances(looks)
    if not seen and all(np.median(look.impedance.real) < 0 for look in looks):
        raise AdaptiveError(
            "fast look: Re Z is negative, which no passive device has; is the polarity of the leads right?"
        )
    fast = look_plan(base, can)
    spent = sum(can.points_seconds(fast, look.frequency) + can.segment_seconds(fast) for look in looks)
    plan, kept = adaptive_plan(base, seen, seconds - spent, can)
    return Adapted(plan, kept, tuple(one for one in seen if one not in kept), looks)


def look_plan(base: SweepPlan, can: Capabilities) -> SweepPlan:
    """Return the fast look over the range of `base`, at its level and bias: some seconds long."""
    whole = Segment(*_range(base), LOOK_POINTS, "log")
    return replace(base, segments=(whole,), bandwidth=can.bandwidths[0], point_average=1, sweep_average=1, joined=False)


def zoom_plan(base: SweepPlan, narrow: Sequence[Resonance], can: Capabilities) -> SweepPlan:
    """Return the closer look at resonances that are too narrow for the last one."""
    low, high = _range(base)
    wanted = [(max(low, one.frequency - 8 * one.step), min(high, one.frequency + 8 * one.step)) for one in narrow]
    segments = tuple(Segment(a, b, ZOOM_POINTS) for a, b in _merged(wanted))
    return replace(look_plan(base, can), segments=segments)


def adaptive_plan(
    base: SweepPlan, seen: Sequence[Resonance], seconds: float, can: Capabilities
) -> tuple[SweepPlan, tuple[Resonance, ...]]:
    """Return the plan of one recording that takes about `seconds`, and the resonances it serves, in rising order.

    Range, level, bandwidth, averaging and bias are those of `base`. Where the time is too short for all, the weakest
    are left to the background; where there is more, all densities rise alike. Raises AdaptiveError where there is
    none, or no time for one.
    """
    if not seen:
        low, high = _range(base)
        raise AdaptiveError(
            f"fast look: no resonance between {low / 1e3:.5g} and {high / 1e3:.5g} kHz rises above the background; "
            "sweep with fixed points, or over another range"
        )
    kept = sorted(seen, key=lambda one: -one.strength)
    while can.seconds(shortest := _with_density(base, kept, 1.0, can)) > seconds:
        if len(kept) == 1:
            raise AdaptiveError(
                f"adaptive sweep: {seconds:.3g} s are left, and one resonance alone with {POINTS_PER_LINEWIDTH} points "
                f"per linewidth takes {can.seconds(shortest):.3g} s; allow more points or a wider bandwidth"
            )
        kept.pop()
    return _fill(base, kept, seconds, can), tuple(sorted(kept, key=lambda one: one.frequency))


def _fill(base: SweepPlan, kept: Sequence[Resonance], seconds: float, can: Capabilities) -> SweepPlan:
    """Return the densest plan that still takes at most `seconds`."""
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
        (one.frequency - reach * one.linewidth, one.frequency + reach * one.linewidth, one.linewidth / per / factor)
        for one in kept
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
    """Return fewer stretches, nowhere wider spaced: neighbours become one where that costs `cheap` points or less."""
    made = list(stretches)
    while len(made) > 1:
        pairs = [one.joined(next_one) for one, next_one in pairwise(made)]
        costs = [
            both.count - one.count - next_one.count for both, (one, next_one) in zip(pairs, pairwise(made), strict=True)
        ]
        k = int(np.argmin(costs))
        if costs[k] > cheap:
            break
        made[k : k + 2] = [pairs[k]]
    return made


def _segments(stretches: Sequence[_Stretch]) -> tuple[Segment, ...]:
    """Return each stretch as a segment that ends one step before the next begins; the last one at its end."""
    *inner, last = stretches
    before = (Segment(one.low, one.high - (one.high - one.low) / one.count, one.count) for one in inner)
    return (*before, Segment(last.low, last.high, last.count + 1))


def _merged(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return spans of frequency with those that overlap put together, in rising order."""
    made: list[tuple[float, float]] = []
    for a, b in sorted(spans):
        if made and a <= made[-1][1]:
            made[-1] = (made[-1][0], max(b, made[-1][1]))
        else:
            made.append((a, b))
    return made
