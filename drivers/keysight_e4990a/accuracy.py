"""The specified accuracy of an E4990A, and its expected noise from point to point.

Only the basic accuracy of 0.08 % (0.045 % typical) is from the data sheet. The growth of the error at very small and
very large |Z|, with the frequency and with the measurement speed is that of the analyzer's predecessor, whose bridge
and test fixtures it shares [no public source gives the E4990A's own table in full].
"""

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals

BASIC = 0.0008
"""Relative, at 1 kHz to 1 MHz, speed 5 and 0.5 V."""

PER_HERTZ = 1e-9
"""Additional relative error per hertz above 1 MHz: 0.1 % per MHz, up to 1.5 %."""
MOST_PROPORTIONAL = 0.015

SERIES_OHM, PARALLEL_SIEMENS = 2.5e-3, 2.5e-9
"""Residuals of the bridge below 1 MHz; the parallel one grows with the frequency above."""

SPEED_ERROR = {1: 4e-3, 2: 2e-3, 3: 1e-3, 4: 3e-4, 5: 0.0}
"""Additional relative error of faster measurements."""

NOISE = {1: 2e-4, 2: 1.3e-4, 3: 9e-5, 4: 6e-5, 5: 4e-5}
"""Relative noise of a single point at 0.5 V, by speed."""


def relative_accuracy(frequency: Frequencies, impedance: Impedances, speed: int, oscillator_V: float) -> Reals:
    """Return the error of |Z| relative to |Z|, and of the phase in rad; shape (N,)."""
    return gain_accuracy(frequency, speed) + _offset(frequency, impedance, oscillator_V)


def gain_accuracy(frequency: Frequencies, speed: int) -> Reals:
    """Return the part of `relative_accuracy` that is an error of gain and phase, whatever the impedance; shape (N,)."""
    proportional = np.minimum(BASIC + PER_HERTZ * np.maximum(frequency - 1e6, 0.0), MOST_PROPORTIONAL)
    return np.asarray(proportional + SPEED_ERROR[speed], np.float64)


def relative_noise(
    frequency: Frequencies, impedance: Impedances, speed: int, oscillator_V: float, averages: int
) -> Reals:
    """Return the expected standard deviation of Re and Im of Z from point to point, relative to |Z|; shape (N,)."""
    factor = max(0.5 / oscillator_V, 1.0) + _offset(frequency, impedance, oscillator_V) / BASIC
    return NOISE[speed] / np.sqrt(averages) * factor


def _offset(frequency: Frequencies, impedance: Impedances, oscillator_V: float) -> Reals:
    """Return the contribution of the bridge's residuals, Zs/|Z| + Yo |Z|; a level below 0.5 V increases both."""
    size, factor = np.abs(impedance), max(0.5 / oscillator_V, 1.0)
    return factor * (SERIES_OHM / size + PARALLEL_SIEMENS * np.maximum(frequency / 1e6, 1.0) * size)
