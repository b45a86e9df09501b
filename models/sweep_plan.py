"""What to measure, before any instrument is asked."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from .base.errors import PzctlError

USUAL_POINTS = 801
"""Of a segment that does not say how many it has."""
BANDWIDTHS = (1, 2, 3, 4, 5)
"""Fast to precise: a scale that every analyzer shares; which of them it has, its driver knows."""


class PlanError(PzctlError):
    """A sweep plan that no instrument could carry out."""


@dataclass(frozen=True)
class Segment:
    """One stretch of frequency: `points` from `start_Hz` to `stop_Hz`, both ends included."""

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
    """What to measure. Limits of an instrument are checked by its driver, which knows them."""

    segments: tuple[Segment, ...]
    oscillator_V: float = 0.5
    """rms; does not count where `oscillator_A` is given."""
    bandwidth: int = BANDWIDTHS[-1]
    """One of `BANDWIDTHS`."""
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
