"""What a 4294A can do, held against a plan before anything is sent.

The instrument itself says nothing when it is asked for more: it silently takes the nearest value it has
(Programming Manual, the out-of-range rule).
"""

from ...models.sweep_plan import PlanError, Segment, SweepPlan

LOWEST_HZ = 40.0
HIGHEST_HZ = 110e6
LOG_HIGHEST_START_HZ = 109.9998e6
LOG_LOWEST_STOP_HZ = 60.0
RESOLUTION_HZ = 1e-3
MOST_POINTS = 801
"""In one sweep; a segment of more is carried out as several."""
LOWEST_OSCILLATOR_V = 5e-3
HIGHEST_OSCILLATOR_V = 1.0
LOWEST_OSCILLATOR_A = 200e-6
HIGHEST_OSCILLATOR_A = 20e-3
LONGEST_DELAY_S = 30.0
BANDWIDTHS = (1, 2, 3, 4, 5)
MOST_AVERAGES = 256
HIGHEST_BIAS_V = 40.0


def check(plan: SweepPlan) -> None:
    """Raise PlanError where a 4294A cannot carry out `plan`: where, what was found, what is allowed."""
    for i, segment in enumerate(plan.segments):
        _check_segment(segment, f"sweep plan: segment {i + 1}" if len(plan.segments) > 1 else "sweep plan")
    if plan.oscillator_A is None:
        _within("sweep plan: oscillator", plan.oscillator_V, LOWEST_OSCILLATOR_V, HIGHEST_OSCILLATOR_V, "V")
    else:
        _within("sweep plan: oscillator", plan.oscillator_A, LOWEST_OSCILLATOR_A, HIGHEST_OSCILLATOR_A, "A")
    _within("sweep plan: point delay", plan.point_delay_s, 0.0, LONGEST_DELAY_S, "s")
    _within("sweep plan: sweep delay", plan.sweep_delay_s, 0.0, LONGEST_DELAY_S, "s")
    _within("sweep plan: bias", plan.bias_V, -HIGHEST_BIAS_V, HIGHEST_BIAS_V, "V")
    _whole("sweep plan: bandwidth", plan.bandwidth, BANDWIDTHS[0], BANDWIDTHS[-1])
    _whole("sweep plan: point averaging", plan.point_average, 1, MOST_AVERAGES)
    _whole("sweep plan: sweep averaging", plan.sweep_average, 1, MOST_AVERAGES)
    if plan.direction not in ("up", "down"):
        raise PlanError(f"sweep plan: direction {plan.direction!r} is not known; up or down is allowed")


def _check_segment(segment: Segment, where: str) -> None:
    if segment.spacing not in ("linear", "log"):
        raise PlanError(f"{where}: spacing {segment.spacing!r} is not known; linear or log is allowed")
    log = segment.spacing == "log"
    _within(f"{where}: start", segment.start_Hz, LOWEST_HZ, LOG_HIGHEST_START_HZ if log else HIGHEST_HZ, "Hz")
    _within(f"{where}: stop", segment.stop_Hz, LOG_LOWEST_STOP_HZ if log else LOWEST_HZ, HIGHEST_HZ, "Hz")
    closest = segment.start_Hz if log else 1.0
    ratio = (segment.stop_Hz / segment.start_Hz) ** (1 / (segment.points - 1)) - 1
    step = closest * ratio if log else (segment.stop_Hz - segment.start_Hz) / (segment.points - 1)
    if step < 2 * RESOLUTION_HZ:
        raise PlanError(
            f"{where}: {segment.points} points from {segment.start_Hz:.12g} to {segment.stop_Hz:.12g} Hz lie "
            f"{step:.3g} Hz apart; at least 0.002 Hz is allowed, as a 4294A sets frequency in steps of 0.001 Hz"
        )


def _within(what: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:  # also where value is NaN
        raise PlanError(f"{what} is {value:.12g} {unit}; a 4294A can do {low:.12g} to {high:.12g} {unit}")


def _whole(what: str, value: int, low: int, high: int) -> None:
    if value != int(value) or not low <= value <= high:
        raise PlanError(f"{what} is {value}; a 4294A can do {low} to {high}, whole numbers")
