"""The specified accuracy of a 4294A, and its expected noise from point to point.

Accuracy is the Operation Manual's formula for the 16047E fixture without bias:
E = Ep + Epbw + Eposc + Zs'/|Z| + Yo' |Z|, with Zs' = Kbw Kzosc Zs and Yo' = Kbw Kyosc Yo. It bounds the
systematic error, which is the same in every sweep. Noise is 10 to 30 times smaller; its size was measured in recordings
by others.
"""

from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals

# Upper end of each band in Hz (the last is open), then the values in this band.
_BANDS_HZ = np.array([100.0, 800.0, 200e3, 1e6, 15e6])
_YO_SIEMENS = np.array([10e-9, 2.5e-9, 2.5e-9, 5e-9, 50e-9, 500e-9])
_EP_PERCENT = np.array([0.5, 0.3, 0.075, 0.075, np.nan, 1.5])  # 1 to 15 MHz: 0.1 % per MHz
_ZS_OHM = np.array([10e-3, 2.5e-3, 2.5e-3, 2.5e-3, 2.5e-3, 2.5e-3])

_EPBW_PERCENT = {5: (0.0, 0.0), 4: (0.03, 0.06), 3: (0.1, 0.2), 2: (0.2, 0.4), 1: (0.4, 0.8)}
"""By bandwidth: from 50 kHz upwards, and below 50 kHz."""

_KBW = {5: (1.0, 1.0), 4: (1.0, 1.0), 3: (4.0, 3.0), 2: (5.0, 4.0), 1: (10.0, 6.0)}
"""By bandwidth: above 1 MHz, and up to 1 MHz."""

NOISE = {1: 2e-4, 2: 1.3e-4, 3: 9e-5, 4: 6e-5, 5: 4e-5}
"""Relative noise of a single unaveraged point at 0.5 V, by bandwidth.

Measured in recordings for 1 and 5; the values between are geometric steps.
"""

BEST_ACCURACY = 0.00075
"""Smallest proportional part of the formula (800 Hz to 1 MHz, bandwidth 5): the scale for its other parts."""


@dataclass(frozen=True)
class _Level:
    """Effect of the oscillator level on the accuracy."""

    percent: float
    percent_per_MHz: float
    admittance_factor: float
    impedance_factor: float


def relative_accuracy(frequency: Frequencies, impedance: Impedances, bandwidth: int, oscillator_V: float) -> Reals:
    """Return the specified error of |Z| relative to |Z|, and of the phase in rad; shape (N,).

    `frequency` Hz and `impedance` ohm, shape (N,). Holds for 10 milliohm to 100 megohm.
    """
    offset = _offset_share(frequency, np.abs(impedance), bandwidth, oscillator_V)
    return gain_accuracy(frequency, bandwidth, oscillator_V) + offset


def gain_accuracy(frequency: Frequencies, bandwidth: int, oscillator_V: float) -> Reals:
    """Return the part of `relative_accuracy` that is an error of gain and phase, whatever the impedance; shape (N,)."""
    band = np.searchsorted(_BANDS_HZ, frequency)
    MHz = frequency / 1e6
    proportional = np.where(band == 4, 0.1 * MHz, _EP_PERCENT[band])
    fast, slow = _EPBW_PERCENT[bandwidth]
    width = np.where(frequency >= 50e3, fast, slow)
    level = _level(oscillator_V)
    if oscillator_V <= 0.064:  # only here is the level's part scaled by that of the bandwidth
        level_percent = (0.03 + width) * (0.064 / oscillator_V - 1)
    else:
        level_percent = level.percent + level.percent_per_MHz * MHz
    return np.asarray((proportional + width + level_percent) / 100, np.float64)


def relative_noise(
    frequency: Frequencies, impedance: Impedances, bandwidth: int, oscillator_V: float, averages: int
) -> Reals:
    """Return the expected standard deviation of Re and Im of Z from point to point, relative to |Z|; shape (N,).

    `averages`: point factor times sweep factor. The measured noise is scaled by the level's factor, and grows at
    very small and very large |Z| as the accuracy does: at 0.5 V it is doubled where the offset part of the accuracy
    equals its smallest proportional part.
    """
    magnitude = np.abs(impedance)
    offset = _offset_share(frequency, magnitude, bandwidth, oscillator_V)
    factor = _level(oscillator_V).impedance_factor + offset / BEST_ACCURACY  # the offset already includes the level
    return NOISE[bandwidth] / np.sqrt(averages) * factor


def _offset_share(frequency: Frequencies, magnitude: Reals, bandwidth: int, oscillator_V: float) -> Reals:
    """Return Zs'/|Z| + Yo' |Z|: the contribution of the instrument's own residuals."""
    band = np.searchsorted(_BANDS_HZ, frequency)
    high, low = _KBW[bandwidth]
    Kbw = np.where(frequency > 1e6, high, low)
    level = _level(oscillator_V)
    Zs = Kbw * level.impedance_factor * _ZS_OHM[band]
    Yo = Kbw * level.admittance_factor * _YO_SIEMENS[band]
    return Zs / magnitude + Yo * magnitude


def _level(V: float) -> _Level:
    if V > 0.5:
        return _Level(0.03 * (1 / V - 1), 0.01, 1 / V, 2.0)
    for top, bottom in ((0.5, 0.25), (0.25, 0.125), (0.125, 0.064)):
        if bottom < V:
            return _Level(0.03 * (top / V - 1), 0.0, 0.5 / V, top / V)
    return _Level(0.0, 0.0, 0.5 / V, 0.064 / V)
