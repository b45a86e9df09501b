"""The capabilities of an E4990A: ranges, noise and accuracy, and duration of sweeps.

The ranges are those of the option with the highest frequency (E4990A-120); on another option, a value out of range is
detected when it is read back. A delay is refused: public sources give one command for it, but differ about its meaning.
"""

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.sweep_plan import BANDWIDTHS, SweepPlan
from ..base.capabilities import Capabilities
from .accuracy import relative_accuracy, relative_noise

LOWEST_HZ, HIGHEST_HZ = 20.0, 120e6
MOST_POINTS, MOST_SEGMENTS = 1601, 201

SPEED_SECONDS = {1: 3.2e-3, 2: 7.8e-3, 3: 14.4e-3, 4: 51.4e-3, 5: 160e-3}
"""Seconds per point, by speed [of the predecessor: no public source gives times of an E4990A at each speed]."""
PERIODS = 30.0
"""Additional periods of the signal per point."""


def _noise(plan: SweepPlan, frequency: Frequencies, impedance: Impedances) -> Reals:
    averages = plan.point_average * plan.sweep_average
    return relative_noise(frequency, impedance, plan.bandwidth, plan.oscillator_V, averages)


def _accuracy(plan: SweepPlan, frequency: Frequencies, impedance: Impedances) -> Reals:
    return relative_accuracy(frequency, impedance, plan.bandwidth, plan.oscillator_V)


def _points_seconds(plan: SweepPlan, frequency: Frequencies) -> float:
    points = float(np.sum(PERIODS / frequency + SPEED_SECONDS[plan.bandwidth]))
    return points * plan.point_average * plan.sweep_average


CAPABILITIES = Capabilities(
    model="E4990A",
    frequency_Hz=(LOWEST_HZ, HIGHEST_HZ),
    oscillator_V=(5e-3, 1.0),
    oscillator_A=None,
    bias_V=(-40.0, 40.0),
    points_per_sweep=MOST_POINTS,
    segments_per_sweep=MOST_SEGMENTS,
    bandwidths=BANDWIDTHS,
    averages=999,
    delay_s=0.0,
    source_ohm=25.0,
    noise=_noise,
    accuracy=_accuracy,
    points_seconds=_points_seconds,
    setup_seconds=0.5,
    adapters={"OFF": "none"},
)
