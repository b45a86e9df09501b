"""Measuring plans, independent of any instrument."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from .base.errors import PzctlError

USUAL_POINTS = 801
"""Default number of points of a segment."""
BANDWIDTHS = (1, 2, 3, 4, 5)
"""Fast to precise: a scale common to all analyzers; each driver knows which of them it supports."""


class PlanError(PzctlError):
    """A sweep plan that no instrument can carry out."""


@dataclass(frozen=True)
class Segment:
    """A frequency segment: `points` from `start_Hz` to `stop_Hz`, both ends included."""

    start_Hz: float
    stop_Hz: float
    points: int = USUAL_POINTS
    spacing: Literal["linear", "log"] = "linear"

    def __post_init__(self) -> None:
        for name, value in (("start", self.start_Hz), ("stop", self.stop_Hz)):
            if not (math.isfinite(value) and value > 0):
                raise PlanError(f"segment: {name} is {value:g} Hz; a positive frequency is needed")
        if self.stop_Hz <= self.start_Hz:
            raise PlanError(f"segment: stop {self.stop_Hz:g} Hz is not above start {self.start_Hz:g} Hz")
        if self.points < 2:
            raise PlanError(f"segment: {self.points} points; at least 2 are needed")


@dataclass(frozen=True)
class SweepPlan:
    """A measuring plan. The driver checks it against the limits of its instrument."""

    segments: tuple[Segment, ...]
    oscillator_V: float = 0.5
    """V rms; ignored if `oscillator_A` is given."""
    bandwidth: int = BANDWIDTHS[-1]
    """One of `BANDWIDTHS`."""
    point_average: int = 1
    sweep_average: int = 1
    bias_V: float = 0.0
    """DC bias; 0 means that the bias source stays off."""
    direction: Literal["up", "down"] = "up"
    oscillator_A: float | None = None
    """A rms; None for a level in volts."""
    point_delay_s: float = 0.0
    """Delay at each point before it is measured, s."""
    sweep_delay_s: float = 0.0
    """Delay before each sweep, s."""
    joined: bool = False
    """Whether the segments form one recording; they must then be in rising order and not overlap."""

    def __post_init__(self) -> None:
        if not self.segments:
            raise PlanError("sweep plan: no segment; at least one is needed")
        for k, (one, following) in enumerate(pairwise(self.segments), start=2):
            if self.joined and following.start_Hz <= one.stop_Hz:
                raise PlanError(
                    f"sweep plan: segment {k} starts at {following.start_Hz:.12g} Hz and the one before stops at "
                    f"{one.stop_Hz:.12g} Hz; segments that are joined must rise and not overlap"
                )


@dataclass(frozen=True)
class LevelLimits:
    """Limits of a sample or a bench; None if nobody set a limit."""

    max_bias_V: float | None = None
    """Volts, of either sign."""
    max_oscillator_V: float | None = None
    """Volts rms."""

    def check(self, plan: SweepPlan, whose: str) -> None:
        """Raise PlanError if a plan exceeds the limits; `whose` names their owner, such as `this bench`."""
        bias, level = self.max_bias_V, self.max_oscillator_V
        if bias is not None and not abs(plan.bias_V) <= bias:
            raise PlanError(f"sweep plan: bias is {plan.bias_V:g} V; {whose} allows {bias:g} V (max_bias_V)")
        if level is None:
            return
        if plan.oscillator_A is not None:
            raise PlanError(
                f"sweep plan: oscillator is {plan.oscillator_A:g} A, whatever voltage that takes; {whose} allows "
                f"{level:g} V (max_oscillator_V): drive by a voltage"
            )
        if not plan.oscillator_V <= level:
            raise PlanError(
                f"sweep plan: oscillator is {plan.oscillator_V:g} V; {whose} allows {level:g} V (max_oscillator_V)"
            )

    def allows(self, plan: SweepPlan) -> bool:
        """Return whether a plan stays within these limits."""
        try:
            self.check(plan, "")
        except PlanError:
            return False
        return True
