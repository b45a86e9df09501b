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
"""Delays tried per inverse of the recorded band."""
_PEAKS = 3
"""Budget: number of delays."""
_LEAST = 1e-6
"""Smallest part of a column beyond the constants that counts, relative to the column."""


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
    delays = np.arange(max(low, 1 / band), high, 1 / (_PER_PERIOD * band))
    Q, _ = np.linalg.qr(np.concatenate([J.real, J.imag]))
    found = [_at(delay, frequency, slope, Q, r) for delay in delays.tolist()]
    explained = np.array([0.0, *(one.explained for one in found), 0.0])
    peaks = (explained[1:-1] >= explained[:-2]) & (explained[1:-1] > explained[2:])
    best = [one for one, peak in zip(found, peaks.tolist(), strict=True) if peak]
    return tuple(sorted(best, key=lambda one: -one.explained)[:_PEAKS])


def _at(delay: float, frequency: Frequencies, slope: Complexes, Q: Reals, r: Complexes) -> LikelyDelay:
    """Return the echo of a delay that explains most of the residual beside the constants with tangents `Q`."""
    wave = slope * np.exp(-2j * np.pi * frequency * delay)
    columns = np.stack([np.concatenate([one.real, one.imag]) for one in (wave, 1j * wave)], axis=1)
    own = columns - Q @ (Q.T @ columns)
    if float(np.linalg.norm(own)) < _LEAST * float(np.linalg.norm(columns)):
        return LikelyDelay(delay, 0.0, 0.0)
    rest = np.concatenate([r.real, r.imag])
    a, *_ = np.linalg.lstsq(own, -rest, rcond=None)
    return LikelyDelay(delay, float(np.linalg.norm(a)), float(np.sum((own @ a) ** 2)))


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
