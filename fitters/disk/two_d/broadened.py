"""Recordings with their resonances broadened, for searches.

The sharper resonances are, the narrower is the valley around the right constants, and the more wrong orders of
overtones look right. The capacitance of any linear device is analytic on one side of the real axis of frequency: its
mean over a Lorentz curve of half width g is its value at f - jg, which it would have if every loss tangent were larger
by 2 g/f. So a broadened recording is that of a like disk with more loss, and what describes it is near what describes
the recording.
"""

from dataclasses import replace

import numpy as np

from ....models.base.arrays import j_omega
from ...engine.recording import Recording

_LOSS = 0.0125
# Added loss tangent: together with that of the hardest ceramic it is the usual one of a soft one.


def broadened(recording: Recording) -> Recording:
    """Return the recording as if every loss tangent were larger.

    Part of the Lorentz curve lies beyond the band, most near its ends; the difference from that counts as noise.
    """
    sweep = recording.sweep
    f, j_w = sweep.frequency, j_omega(sweep.frequency)
    own, half = 1 / (j_w * sweep.impedance), _LOSS * f / 2
    weights = np.gradient(f) / ((f[:, None] - f) ** 2 + half[:, None] ** 2)
    capacitance = (weights / weights.sum(axis=1, keepdims=True)) @ own
    beyond = 1 - (np.arctan((f[-1] - f) / half) + np.arctan((f - f[0]) / half)) / np.pi
    noise = np.hypot(recording.noise, beyond * (1 + np.mean(np.abs(own)) / np.abs(capacitance)))
    return replace(recording, sweep=replace(sweep, impedance=1 / (j_w * capacitance)), noise=noise)
