"""Delays of echoes that a residual shows: those at which it is periodic in frequency.

To first order an echo changes ln Z by s(f) exp(-j 2 pi f delay); what the constants can do as well is projected out. A
delay is found in two steps: with an echo of any phase, whose envelope is as wide as the band is narrow, then near the
best ones with its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Reals

_PER_PERIOD = 4
"""Delays tried per inverse of the recorded band, with an echo of any phase: its envelope is that wide."""
_PER_CYCLE = 12
"""Delays tried per period of the highest frequency near each of the best, with the phase of an echo."""
_PEAKS = 3
"""Budget: number of delays."""


@dataclass(frozen=True)
class LikelyDelay:
    """A delay at which the residual is periodic."""

    delay: float
    """s."""
    amplitude: float
    """Amplitude of the echo."""
    explained: float
    """Squared ln Z that an echo of this delay explains, summed over the points."""


def longest_delay(sweeps: Sequence[Frequencies]) -> float:
    """Return the longest delay, s, that one of these sweeps, Hz, tells from a shorter one; 0 if there is no sweep.

    By the sampling theorem: at points df apart, an echo of delay + 1/df differs from that of delay by a phase only.
    Further sweeps over the same points do not change that.
    """
    spacings = [float(np.median(np.diff(np.sort(f)))) for f in sweeps if f.size > 1]
    return max((1 / (2 * spacing) for spacing in spacings if spacing > 0), default=0.0)


def likely_delays(
    frequency: Frequencies, slope: Complexes, J: Complexes, r: Complexes, low: float, high: float
) -> tuple[LikelyDelay, ...]:
    """Return the likeliest delays between `low` and `high`, s, most explained first; see `longest_delay`.

    `slope`: s(f) of an echo of amplitude 1, shape (N,); `J`: derivatives of ln Z by the constants, shape (N, M); `r`:
    ln(Z_model/Z), shape (N,).
    """
    if frequency.size < 3:
        return ()
    band = float(np.max(frequency) - np.min(frequency))
    Q, _ = np.linalg.qr(np.concatenate([J.real, J.imag]))
    echoes = _Echoes(frequency, slope, Q, np.concatenate([r.real, r.imag]))
    delays = np.arange(max(low, 1 / band), high, 1 / (_PER_PERIOD * band))
    explained = np.array([0.0, *(echoes.any_phase(delay) for delay in delays.tolist()), 0.0])
    peaks = np.flatnonzero((explained[1:-1] >= explained[:-2]) & (explained[1:-1] > explained[2:]))
    best = sorted(peaks.tolist(), key=lambda k: -float(explained[k + 1]))[:_PEAKS]
    step = 1 / (_PER_CYCLE * float(np.max(frequency)))
    found = [_near(echoes, float(delays[k]), 1 / (_PER_PERIOD * band), step) for k in best]
    return tuple(sorted(found, key=lambda one: -one.explained))


def _near(echoes: "_Echoes", delay: float, width: float, step: float) -> LikelyDelay:
    """Return the best echo within `width` of a delay."""
    tried = np.arange(max(step, delay - width), delay + width, step)
    return max((echoes.at(own) for own in tried.tolist()), key=lambda one: one.explained)


@dataclass(frozen=True, eq=False)
class _Echoes:
    """Echoes to first order beside the constants."""

    frequency: Frequencies
    slope: Complexes
    """Change of ln Z by an echo of amplitude 1 and no delay, shape (N,)."""
    Q: Reals
    """Orthonormal changes of ln Z by the constants, shape (2N, P)."""
    r: Reals
    """ln(Z_model/Z), real and imaginary parts, shape (2N,)."""

    def any_phase(self, delay: float) -> float:
        """Return the squared ln Z that an echo of any amplitude and phase explains."""
        own = self._beside(delay, (1.0, 1j))
        a, *_ = np.linalg.lstsq(own, self.r, rcond=None)
        return float(np.sum((own @ a) ** 2))

    def at(self, delay: float) -> LikelyDelay:
        """Return the echo of a delay with the amplitude that explains most."""
        own = self._beside(delay, (1.0,))[:, 0]
        power = float(own @ own)
        amplitude = max(0.0, -float(own @ self.r) / power) if power > 0 else 0.0
        return LikelyDelay(delay, amplitude, amplitude**2 * power)

    def _beside(self, delay: float, phases: tuple[complex, ...]) -> Reals:
        wave = self.slope * np.exp(-2j * np.pi * self.frequency * delay)
        columns = np.stack([np.concatenate([(c * wave).real, (c * wave).imag]) for c in phases], axis=1)
        return columns - self.Q @ (self.Q.T @ columns)
