"""Recordings with their resonances broadened, for searches.

The sharper resonances are, the narrower is the valley around the right constants, and the more wrong orders of
overtones look right. The capacitance of any linear device is analytic on one side of the real axis of frequency: its
mean over a Lorentz curve of half width g is its value at f - jg, which it would have if every loss tangent were larger
by 2 g/f. So a broadened recording is that of a like disk with more loss, and what describes it is near what describes
the recording.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....models.base.arrays import j_omega
from ....models.disk2d.matrices import CONSTANTS
from ...engine.recording import Recording

LOSS = 0.0125
# Added loss tangent: together with that of the hardest ceramic it is the usual one of a soft one.
_LEAST = 1e-3
# Loss tangent of the hardest ceramics.


def broadened(recording: Recording) -> Recording:
    """Return the recording as if every loss tangent were larger.

    Part of the Lorentz curve lies beyond the band, most near its ends; the difference from that counts as noise.
    """
    sweep = recording.sweep
    f, j_w = sweep.frequency, j_omega(sweep.frequency)
    own, half = 1 / (j_w * sweep.impedance), LOSS * f / 2
    weights = np.gradient(f) / ((f[:, None] - f) ** 2 + half[:, None] ** 2)
    capacitance = (weights / weights.sum(axis=1, keepdims=True)) @ own
    beyond = 1 - (np.arctan((f[-1] - f) / half) + np.arctan((f - f[0]) / half)) / np.pi
    noise = np.hypot(recording.noise, beyond * (1 + np.mean(np.abs(own)) / np.abs(capacitance)))
    return replace(recording, sweep=replace(sweep, impedance=1 / (j_w * capacitance)), noise=noise)


def less_lossy(values: Mapping[str, float], layer: str) -> dict[str, float]:
    """Return the constants of a ceramic that describe a recording, from those that describe it broadened.

    Permittivities are what frequency does not scale. What would have no loss keeps a little.
    """
    made = dict(values)
    for name in CONSTANTS:
        re, im = f"{layer}.{name}.re", f"{layer}.{name}.im"
        if name.startswith("c"):
            made[im] = max(values[im] - LOSS * values[re], _LEAST * values[re])
        elif not name.startswith("eps"):
            made[im] = values[im] - LOSS / 2 * values[re]
    return made
