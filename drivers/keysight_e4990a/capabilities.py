"""What an E4990A can do: its ranges, its noise and accuracy, and how long it takes.

The ranges are those of the option with the highest frequency (E4990A-120); what another one does not take is found out
when it reads back. A delay is refused: public sources name one command for it and differ about which delay it sets.
"""

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.sweep_plan import BANDWIDTHS, SweepPlan
from ..base.capabilities import Capabilities
from .accuracy import relative_accuracy, relative_noise

LOWEST_HZ, HIGHEST_HZ = 20.0, 120e6
MOST_POINTS, MOST_SEGMENTS = 1601, 201

SPEED_SECONDS = {1: 3.2e-3, 2: 7.8e-3, 3: 14.4e-3, 4: 51.4e-3, 5: 160e-3}
"""What a point takes, by speed [of the predecessor: no public source times an E4990A at each speed]."""
PERIODS = 30.0
"""Periods of the signal that a point takes besides."""


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
