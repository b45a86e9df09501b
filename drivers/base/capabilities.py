"""What an analyzer can do, as numbers: what plans are made with and checked against before anything is sent."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.sweep_plan import PlanError, Segment, SweepPlan

PerPoint = Callable[[SweepPlan, Frequencies, Impedances], Reals]
"""Of a plan's settings, frequencies in Hz and impedances in ohm, shape (N,): one number for each point, shape (N,)."""


@dataclass(frozen=True)
class Capabilities:
    """What an analyzer can do. Ranges are (lowest, highest), both included."""

    model: str
    """As in `a 4294A can do`."""
    frequency_Hz: tuple[float, float]
    oscillator_V: tuple[float, float]
    """rms."""
    oscillator_A: tuple[float, float] | None
    """rms; None where it drives by voltage alone."""
    bias_V: tuple[float, float]
    """(0, 0) where it has no bias source."""
    points_per_sweep: int
    """In one sweep; a segment of more is carried out as several."""
    segments_per_sweep: int
    """That one sweep of a joined plan can hold; more are carried out as several."""
    bandwidths: tuple[int, ...]
    """Values of `SweepPlan.bandwidth`, fast to precise, without gaps."""
    averages: int
    """Most, of either kind."""
    delay_s: float
    """Longest, before a point or a sweep."""
    source_ohm: float
    """Resistance between oscillator and device."""
    noise: PerPoint
    """Relative standard deviation of Re and Im of Z from point to point."""
    accuracy: PerPoint
    """Specified relative error of |Z|, and of its phase in rad: what stays the same from sweep to sweep."""
    points_seconds: Callable[[SweepPlan, Frequencies], float]
    """Seconds that all sweeps of a plan over these frequencies take, the delays before sweeps not counted."""
    setup_seconds: float
    """What setting up, checking and reading a segment takes."""
    adapters: Mapping[str, str] = field(default_factory=dict[str, str])
    """What may sit between analyzer and fixture, as `compensate` takes it, and as a sweep's settings say it."""

    def seconds(self, plan: SweepPlan) -> float:
        """Return the seconds that `plan` takes, the set-up of its segments included."""
        frequency = np.concatenate([np.linspace(s.start_Hz, s.stop_Hz, s.points) for s in plan.segments])
        return self.points_seconds(plan, frequency) + len(plan.segments) * self.segment_seconds(plan)

    def segment_seconds(self, plan: SweepPlan) -> float:
        """Return the seconds that each segment of `plan` takes besides its points."""
        return self.setup_seconds + plan.sweep_average * plan.sweep_delay_s

    def check(self, plan: SweepPlan) -> None:
        """Raise PlanError where `plan` is beyond this: where, what was found, what is allowed."""
        for where, segment in named_segments(plan):
            for end, value in (("start", segment.start_Hz), ("stop", segment.stop_Hz)):
                self.within(f"{where}: {end}", value, self.frequency_Hz, "Hz")
            if segment.spacing not in ("linear", "log"):
                raise PlanError(f"{where}: spacing {segment.spacing!r} is not known; linear or log is allowed")
        if plan.oscillator_A is None:
            self.within("sweep plan: oscillator", plan.oscillator_V, self.oscillator_V, "V")
        elif self.oscillator_A is None:
            raise PlanError(f"sweep plan: oscillator is {plan.oscillator_A:.12g} A; a {self.model} is set in volts")
        else:
            self.within("sweep plan: oscillator", plan.oscillator_A, self.oscillator_A, "A")
        self.within("sweep plan: point delay", plan.point_delay_s, (0.0, self.delay_s), "s")
        self.within("sweep plan: sweep delay", plan.sweep_delay_s, (0.0, self.delay_s), "s")
        self.within("sweep plan: bias", plan.bias_V, self.bias_V, "V")
        self._whole("sweep plan: bandwidth", plan.bandwidth, self.bandwidths[0], self.bandwidths[-1])
        self._whole("sweep plan: point averaging", plan.point_average, 1, self.averages)
        self._whole("sweep plan: sweep averaging", plan.sweep_average, 1, self.averages)
        if plan.direction not in ("up", "down"):
            raise PlanError(f"sweep plan: direction {plan.direction!r} is not known; up or down is allowed")

    def within(self, what: str, value: float, ends: tuple[float, float], unit: str) -> None:
        """Raise PlanError where `value` is not between `ends`."""
        low, high = ends
        if not low <= value <= high:  # also where value is NaN
            raise PlanError(f"{what} is {value:.12g} {unit}; a {self.model} can do {low:.12g} to {high:.12g} {unit}")

    def _whole(self, what: str, value: int, low: int, high: int) -> None:
        if value != int(value) or not low <= value <= high:
            raise PlanError(f"{what} is {value}; a {self.model} can do {low} to {high}, whole numbers")


def named_segments(plan: SweepPlan) -> tuple[tuple[str, Segment], ...]:
    """Return each segment of `plan` with what an error calls it."""
    if len(plan.segments) == 1:
        return (("sweep plan", plan.segments[0]),)
    return tuple((f"sweep plan: segment {k}", segment) for k, segment in enumerate(plan.segments, start=1))
