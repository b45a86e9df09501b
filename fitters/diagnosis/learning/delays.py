"""Start values of an echo: the delays at which the residual is periodic in frequency.

A smooth correction cannot follow an echo of a long delay, so its delay is looked for in the residual itself. To first
order an echo changes ln Z by s(f) exp(-j 2 pi f delay), with s(f) the derivative by the corrected impedance; what the
constants can do as well is projected out.
"""

from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Reals
from ....models.effects import Device
from ....models.effects.base.effect import EffectParameter
from ....models.effects.learned.corrections import Place
from ....models.effects.learned.laws import Law
from ....models.effects.learned.learned import LearnedLaw
from ...error_model.error_columns import stack_of
from ..hypotheses.hypothesis import Hypothesis

_CONSTANT = Law(
    "constant",
    (EffectParameter("size", "1", 0.01),),
    lambda x, values: np.full(x.size, values["size"], np.complex128),
    "a constant part of {size}",
)
_STEP = 1e-4
"""Correction by which a derivative is taken."""
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
    """Amplitude of the correction there, dimensionless."""
    explained: float
    """Squared ln Z that an echo of this delay explains, summed over the points."""


def likely_delays(
    parent: Hypothesis, place: Place, steps: tuple[str, ...], low: float, high: float
) -> tuple[LikelyDelay, ...]:
    """Return the likeliest delays between `low` and `high` of an echo at a place, most explained first."""
    frequency, slope, J, r = _linearised(parent, place, steps)
    if frequency.size < 3:
        return ()
    band = float(np.max(frequency) - np.min(frequency))
    high = min(high, frequency.size / (2 * band))  # sampling theorem
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
    """d ln Z / d correction, shape (N,)."""
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
        """Return the echo of a delay from a medium that ends free: its first order is -2 exp(-j w delay)."""
        own = self._beside(delay, (-1.0,))[:, 0]
        power = float(own @ own)
        amplitude = max(0.0, -float(own @ self.r) / power) if power > 0 else 0.0
        return LikelyDelay(delay, amplitude, amplitude**2 * power)

    def _beside(self, delay: float, phases: tuple[complex, ...]) -> Reals:
        wave = self.slope * np.exp(-2j * np.pi * self.frequency * delay)
        columns = np.stack([np.concatenate([(c * wave).real, (c * wave).imag]) for c in phases], axis=1)
        return columns - self.Q @ (self.Q.T @ columns)


def _linearised(
    parent: Hypothesis, place: Place, steps: tuple[str, ...]
) -> tuple[Frequencies, Complexes, Complexes, Complexes]:
    """Return frequencies, d ln Z / d correction, derivatives by the coordinates, and ln(Z_model/Z), of valid points."""
    objective, gram = parent.objective, parent.fit.gram
    models = objective.models(parent.fit.x)
    parts: list[tuple[Frequencies, Complexes, Complexes, Complexes]] = []
    for recording, model, J, r in zip(objective.recordings, models, gram.J, gram.r, strict=True):
        if recording.step not in steps or not isinstance(model, Device):
            continue
        f = recording.sweep.frequency
        probe = LearnedLaw(place, _CONSTANT, stack_of(model))
        with_it = model.with_effect(probe, place.where, {"size": _STEP * probe.natural})
        slope = np.asarray(np.log(with_it.impedance(f) / model.impedance(f)) / _STEP, np.complex128)
        on = np.isfinite(recording.noise) & np.isfinite(slope)
        parts.append((f[on], slope[on], J[on], r[on]))
    if not parts:
        return np.zeros(0), np.zeros(0, np.complex128), np.zeros((0, 0), np.complex128), np.zeros(0, np.complex128)
    return (
        np.concatenate([one[0] for one in parts]),
        np.concatenate([one[1] for one in parts]),
        np.concatenate([one[2] for one in parts]),
        np.concatenate([one[3] for one in parts]),
    )
