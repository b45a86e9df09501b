"""Resonances seen in recordings: frequency, linewidth and strength."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ...models.sweep import Sweep

RESOLVED = 3.0
"""Least number of frequency steps per linewidth for a reliable linewidth."""
LEAST_STRENGTH = 0.02
"""Least height of a resonance in G/w (or w R), relative to |Y|/w (or w |Z|); weaker ones count as background. At 0.5 V
the noise of a fast preliminary sweep is a hundredth of this."""
ABOVE_NOISE = 10.0
"""Least height of a resonance in standard deviations of the expected noise."""


@dataclass(frozen=True)
class Resonance:
    """A maximum of G/w or of w R."""

    frequency: float
    """Hz."""
    linewidth: float
    """f/Q: full width at half its height, Hz."""
    strength: float
    """Height over the surroundings, relative to |Y|/w or w |Z|: 0 to 1."""
    step: float
    """Hz between the points of the sweep in which it was seen."""

    @property
    def resolved(self) -> bool:
        """Whether the linewidth is reliable."""
        return self.linewidth >= RESOLVED * self.step


def resonances(looks: Sequence[Sweep]) -> tuple[Resonance, ...]:
    """Return the resonances seen in the sweeps `looks`, in rising order; for each frequency the finest sweep counts."""
    finest_first = sorted(looks, key=lambda look: (look.frequency[-1] - look.frequency[0]) / look.frequency.size)
    seen: list[Resonance] = []
    covered: list[tuple[float, float]] = []
    for look in finest_first:
        seen += [peak for peak in _peaks(look) if not any(a <= peak.frequency <= b for a, b in covered)]
        covered.append((float(look.frequency[0]), float(look.frequency[-1])))
    return tuple(sorted(seen, key=lambda peak: peak.frequency))


def _peaks(look: Sweep) -> list[Resonance]:
    w = 2 * np.pi * look.frequency
    series, parallel = look.admittance.real / w, look.impedance.real * w
    peaks = _maxima(look, series, np.abs(look.admittance) / w) + _maxima(look, parallel, np.abs(look.impedance) * w)
    return sorted(peaks, key=lambda peak: peak.frequency)


def _maxima(look: Sweep, trace: Reals, scale: Reals) -> list[Resonance]:
    """Return the maxima of `trace` above noise and `LEAST_STRENGTH` times `scale`; both have shape (N,)."""
    from scipy.signal import find_peaks, peak_widths  # takes half a second, so it is imported only when needed

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
