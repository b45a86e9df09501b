"""What a 4294A can do: its ranges, its noise and accuracy, and how long it takes."""

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.sweep_plan import BANDWIDTHS, SweepPlan
from ..base.capabilities import Capabilities
from .accuracy import relative_accuracy, relative_noise
from .sweep_time import estimated

LOWEST_HZ, HIGHEST_HZ = 40.0, 110e6
MOST_POINTS = 801
"""In one sweep."""
MOST_LINES = 18
"""Segments in the table of a list sweep."""
LOWEST_OSCILLATOR_V, HIGHEST_OSCILLATOR_V = 5e-3, 1.0
LOWEST_OSCILLATOR_A, HIGHEST_OSCILLATOR_A = 200e-6, 20e-3
HIGHEST_BIAS_V = 40.0


def _noise(plan: SweepPlan, frequency: Frequencies, impedance: Impedances) -> Reals:
    averages = plan.point_average * plan.sweep_average
    return relative_noise(frequency, impedance, plan.bandwidth, plan.oscillator_V, averages)


def _accuracy(plan: SweepPlan, frequency: Frequencies, impedance: Impedances) -> Reals:
    return relative_accuracy(frequency, impedance, plan.bandwidth, plan.oscillator_V)


def _points_seconds(plan: SweepPlan, frequency: Frequencies) -> float:
    return estimated(frequency, plan.bandwidth, plan.point_average, plan.sweep_average, plan.point_delay_s, 0.0)


CAPABILITIES = Capabilities(
    model="4294A",
    frequency_Hz=(LOWEST_HZ, HIGHEST_HZ),
    oscillator_V=(LOWEST_OSCILLATOR_V, HIGHEST_OSCILLATOR_V),
    oscillator_A=(LOWEST_OSCILLATOR_A, HIGHEST_OSCILLATOR_A),
    bias_V=(-HIGHEST_BIAS_V, HIGHEST_BIAS_V),
    points_per_sweep=MOST_POINTS,
    segments_per_sweep=MOST_LINES,
    bandwidths=BANDWIDTHS,
    averages=256,
    delay_s=30.0,
    source_ohm=25.0,
    noise=_noise,
    accuracy=_accuracy,
    points_seconds=_points_seconds,
    setup_seconds=0.5,  # about eighty queries, each of which takes 5 to 10 ms over a LAN
    low_impedance=(0.5, 48.0),  # beyond, error 134: reduce the oscillator level (programming manual, p. 498)
    adapters={"OFF": "none", "M1": "4TP 1 m", "M2": "4TP 2 m", "APC7": "7 mm", "PROBE": "probe"},
)
