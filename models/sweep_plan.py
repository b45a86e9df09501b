"""What to measure, before any instrument is asked."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from .base.errors import PzctlError


class PlanError(PzctlError):
    """A sweep plan that no instrument could carry out."""


@dataclass(frozen=True)
class Segment:
    """One stretch of frequency: `points` from `start_Hz` to `stop_Hz`, both ends included."""

    start_Hz: float
    stop_Hz: float
    points: int = 801
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
    """What to measure. Limits of an instrument are checked by its driver, which knows them."""

    segments: tuple[Segment, ...]
    oscillator_V: float = 0.5
    """rms; does not count where `oscillator_A` is given."""
    bandwidth: int = 5
    """1 (fast) to 5 (precise)."""
    point_average: int = 1
    sweep_average: int = 1
    bias_V: float = 0.0
    """DC bias; 0 means that the bias source stays off."""
    direction: Literal["up", "down"] = "up"
    oscillator_A: float | None = None
    """rms; None drives by voltage."""
    point_delay_s: float = 0.0
    """Waited at each point before it is measured."""
    sweep_delay_s: float = 0.0
    """Waited before each sweep."""
    joined: bool = False
    """Whether the segments make one recording together; they are then in rising order and do not overlap."""

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
    """The most that may be applied to a sample, or at a bench; None where nobody set a limit."""

    max_bias_V: float | None = None
    """Volts, of either sign."""
    max_oscillator_V: float | None = None
    """Volts rms."""

    def check(self, plan: SweepPlan, whose: str) -> None:
        """Raise PlanError where a plan applies more; `whose` says what allows it, as `this bench`."""
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
        """Return whether a plan keeps within these limits."""
        try:
            self.check(plan, "")
        except PlanError:
            return False
        return True
