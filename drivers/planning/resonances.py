"""Resonances seen in recordings: where they are, how wide, how strong."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ...models.sweep import Sweep

RESOLVED = 3.0
"""Steps of a look within a linewidth, from which on the linewidth can be read off it."""
LEAST_STRENGTH = 0.02
"""A resonance that lifts G/w (or w R) by less than this part of |Y|/w (of w |Z|) is left to the background; at 0.5 V
the noise of a fast look is a hundredth of that."""
ABOVE_NOISE = 10.0
"""And one that rises by less than this many standard deviations of the look's expected noise is noise."""


@dataclass(frozen=True)
class Resonance:
    """A maximum of G/w or of w R."""

    frequency: float
    """Hz."""
    linewidth: float
    """f/Q: full width at half its height, Hz."""
    strength: float
    """Its height over its surroundings, as part of |Y|/w or w |Z|: 0 to 1."""
    step: float
    """Hz between the points it was seen at."""

    @property
    def resolved(self) -> bool:
        """Whether the linewidth can be trusted."""
        return self.linewidth >= RESOLVED * self.step


def resonances(looks: Sequence[Sweep]) -> tuple[Resonance, ...]:
    """Return the resonances seen in `looks`, in rising order; where several cover one frequency, by the closest."""
    finest_first = sorted(looks, key=lambda look: (look.frequency[-1] - look.frequency[0]) / look.frequency.size)
    found: list[Resonance] = []
    covered: list[tuple[float, float]] = []
    for look in finest_first:
        found += [one for one in _peaks(look) if not any(a <= one.frequency <= b for a, b in covered)]
        covered.append((float(look.frequency[0]), float(look.frequency[-1])))
    return tuple(sorted(found, key=lambda one: one.frequency))


def _peaks(look: Sweep) -> list[Resonance]:
    w = 2 * np.pi * look.frequency
    series, parallel = look.admittance.real / w, look.impedance.real * w
    found = _maxima(look, series, np.abs(look.admittance) / w) + _maxima(look, parallel, np.abs(look.impedance) * w)
    return sorted(found, key=lambda one: one.frequency)


def _maxima(look: Sweep, trace: Reals, scale: Reals) -> list[Resonance]:
    """Return the maxima of `trace` that rise by `LEAST_STRENGTH` of `scale` and out of noise; both of shape (N,)."""
    from scipy.signal import find_peaks, peak_widths  # half a second, which who only plans a sweep need not wait

    noise = np.array(look.settings.get("noise_relative", 0.0))
    at, properties = find_peaks(trace, prominence=np.maximum(LEAST_STRENGTH, ABOVE_NOISE * noise) * scale)
    _, _, left, right = peak_widths(trace, at, rel_height=0.5)
    f, index = look.frequency, np.arange(look.frequency.size)
    width = np.interp(right, index, f) - np.interp(left, index, f)
    step = np.gradient(f)
    return [
        Resonance(float(f[k]), float(width[i]), float(properties["prominences"][i] / scale[k]), float(step[k]))
        for i, k in enumerate(at)
    ]
