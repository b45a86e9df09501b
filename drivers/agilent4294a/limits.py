"""Limits of a 4294A beyond its `Capabilities`, checked against a plan before anything is sent.

The instrument itself reports nothing when a value is out of range: it silently takes the nearest possible value
(Programming Manual, the out-of-range rule).
"""

from ...models.sweep_plan import PlanError, Segment, SweepPlan
from ..base.capabilities import named_segments
from .capabilities import CAPABILITIES, HIGHEST_HZ, LOWEST_HZ

LOG_HIGHEST_START_HZ = 109.9998e6
LOG_LOWEST_STOP_HZ = 60.0
RESOLUTION_HZ = 1e-3


def check(plan: SweepPlan) -> None:
    """Raise PlanError where a 4294A cannot carry out `plan`; it says where, what was found and what is allowed."""
    CAPABILITIES.check(plan)
    for where, segment in named_segments(plan):
        _check_segment(segment, where)


def _check_segment(segment: Segment, where: str) -> None:
    log = segment.spacing == "log"
    if log:
        CAPABILITIES.within(f"{where}: start", segment.start_Hz, (LOWEST_HZ, LOG_HIGHEST_START_HZ), "Hz")
        CAPABILITIES.within(f"{where}: stop", segment.stop_Hz, (LOG_LOWEST_STOP_HZ, HIGHEST_HZ), "Hz")
    closest = segment.start_Hz if log else 1.0
    ratio = (segment.stop_Hz / segment.start_Hz) ** (1 / (segment.points - 1)) - 1
    step = closest * ratio if log else (segment.stop_Hz - segment.start_Hz) / (segment.points - 1)
    if step < 2 * RESOLUTION_HZ:
        raise PlanError(
            f"{where}: {segment.points} points from {segment.start_Hz:.12g} to {segment.stop_Hz:.12g} Hz lie "
            f"{step:.3g} Hz apart; at least 0.002 Hz is allowed, as a 4294A sets frequency in steps of 0.001 Hz"
        )
