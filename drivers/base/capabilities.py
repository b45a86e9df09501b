"""The capabilities of an analyzer as numbers, for making sweep plans and checking them before anything is sent."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.sweep_plan import PlanError, Segment, SweepPlan

PerPoint = Callable[[SweepPlan, Frequencies, Impedances], Reals]
"""A function of a plan's settings, frequencies (Hz) and impedances (ohm), shape (N,), with one value per point."""


@dataclass(frozen=True)
class Capabilities:
    """The capabilities of an analyzer. Ranges are (lowest, highest), both included."""

    model: str
    """Name of the model, as in `the 4294A can do`."""
    frequency_Hz: tuple[float, float]
    oscillator_V: tuple[float, float]
    """rms."""
    oscillator_A: tuple[float, float] | None
    """rms; None if the analyzer cannot drive by a current."""
    bias_V: tuple[float, float]
    """(0, 0) without a bias source."""
    points_per_sweep: int
    """Greatest number of points of one sweep; a longer segment takes several sweeps."""
    segments_per_sweep: int
    """Greatest number of segments in one sweep of a joined plan; more take several sweeps."""
    bandwidths: tuple[int, ...]
    """Values of `SweepPlan.bandwidth`, from fast to precise, without gaps."""
    averages: int
    """Greatest averaging factor, of points or sweeps."""
    delay_s: float
    """Longest delay before a point or a sweep."""
    source_ohm: float
    """Resistance between oscillator and device."""
    noise: PerPoint
    """Relative standard deviation of Re and Im of Z from point to point."""
    accuracy: PerPoint
    """Specified relative error of |Z|, and of its phase in rad, which is the same in every sweep."""
    points_seconds: Callable[[SweepPlan, Frequencies], float]
    """Seconds that all sweeps of a plan over these frequencies take, without the delays before sweeps."""
    setup_seconds: float
    """Seconds for setting up, checking and reading a segment."""
    adapters: Mapping[str, str] = field(default_factory=dict[str, str])
    """Adapters between analyzer and fixture: their names for `compensate`, and those in a sweep's settings."""
    low_impedance: tuple[float, float] | None = None
    """(V, ohm): highest oscillator level at which an impedance below this is measured; None without such a limit."""

    def highest_level_V(self, impedance: Impedances) -> float:
        """Return the highest oscillator level, V rms, at which a device of this impedance (N,) can be measured."""
        highest = self.oscillator_V[1]
        if self.low_impedance is None or float(np.min(np.abs(impedance))) >= self.low_impedance[1]:
            return highest
        return min(highest, self.low_impedance[0])

    def seconds(self, plan: SweepPlan) -> float:
        """Return the seconds that `plan` takes, including the set-up of its segments."""
        frequency = np.concatenate([np.linspace(s.start_Hz, s.stop_Hz, s.points) for s in plan.segments])
        return self.points_seconds(plan, frequency) + len(plan.segments) * self.segment_seconds(plan)

    def segment_seconds(self, plan: SweepPlan) -> float:
        """Return the seconds that each segment of `plan` takes besides its points."""
        return self.setup_seconds + plan.sweep_average * plan.sweep_delay_s

    def check(self, plan: SweepPlan) -> None:
        """Raise PlanError with place, value and allowed range if `plan` exceeds these capabilities."""
        for where, segment in named_segments(plan):
            for end, value in (("start", segment.start_Hz), ("stop", segment.stop_Hz)):
                self.within(f"{where}: {end}", value, self.frequency_Hz, "Hz")
            if segment.spacing not in ("linear", "log"):
                raise PlanError(f"{where}: spacing {segment.spacing!r} is not known; linear or log is allowed")
        if plan.oscillator_A is None:
            self.within("sweep plan: oscillator", plan.oscillator_V, self.oscillator_V, "V")
        elif self.oscillator_A is None:
            raise PlanError(
                f"sweep plan: oscillator is {plan.oscillator_A:.12g} A; a {self.model} can only be set in volts"
            )
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
        """Raise PlanError if `value` is not between `ends`."""
        low, high = ends
        if not low <= value <= high:  # true for NaN too
            raise PlanError(f"{what} is {value:.12g} {unit}; the {self.model} can do {low:.12g} to {high:.12g} {unit}")

    def _whole(self, what: str, value: int, low: int, high: int) -> None:
        if value != int(value) or not low <= value <= high:
            raise PlanError(f"{what} is {value}; the {self.model} can do {low} to {high}, whole numbers")


def named_segments(plan: SweepPlan) -> tuple[tuple[str, Segment], ...]:
    """Return each segment of `plan` with its name for errors."""
    if len(plan.segments) == 1:
        return (("sweep plan", plan.segments[0]),)
    return tuple((f"sweep plan: segment {k}", segment) for k, segment in enumerate(plan.segments, start=1))
