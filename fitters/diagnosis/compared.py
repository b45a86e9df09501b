"""Two recordings of one device, without any model: whether they differ by more than noise, and how resonance moved."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from ...models.arrays import Complexes, Frequencies, Reals
from ...models.sweep import Sweep
from ..noise import noise_of

_SAME = 1.5
"""Mean squared difference, in units of noise, up to which two recordings agree."""
_TOO_FEW = 20
_WORDS = {
    "oscillator_V": "{1:g} V instead of {0:g} V",
    "oscillator_A": "{1:g} A instead of {0:g} A",
    "bandwidth": "bandwidth {1} instead of {0}",
    "direction": "swept {1} instead of {0}",
}


@dataclass(frozen=True)
class Comparison:
    """What another recording of the same device shows."""

    changed: str
    """What was done differently, in words: `0.1 V instead of 0.5 V`, `repeated`."""
    excess: float
    """Mean squared difference of ln Z where both were recorded, in units of noise: 1 where they agree."""
    shift: float
    """Relative change of the frequency of series resonance."""

    @property
    def differs(self) -> bool:
        """Whether they differ by more than noise."""
        return self.excess > _SAME

    @property
    def says(self) -> str:
        """A sentence for people."""
        if not self.differs:
            return f"{self.changed}: the same to within noise."
        return (
            f"{self.changed}: not the same ({np.sqrt(self.excess):.3g} times the noise); resonance moved by "
            f"{1e6 * self.shift:+.3g} ppm."
        )


def compared(own: Sequence[Sweep], others: Sequence[Sweep]) -> tuple[Comparison, ...]:
    """Return how each of `others` differs from the one of `own` that has most of its points in common with it."""
    made: list[Comparison] = []
    for other in others:
        first = max(own, key=lambda one: _common(one, other).sum())
        if _common(first, other).sum() >= _TOO_FEW:
            made.append(_compared(first, other))
    return tuple(made)


def _common(one: Sweep, other: Sweep) -> Any:
    low = max(one.frequency[0], other.frequency[0])
    return (other.frequency >= low) & (other.frequency <= min(one.frequency[-1], other.frequency[-1]))


def _compared(first: Sweep, other: Sweep) -> Comparison:
    _, (noise,) = noise_of([first])
    _, (own_noise,) = noise_of([other])
    common = _common(first, other)
    f = other.frequency[common]
    Z = _at(first, np.log(first.impedance), f)
    difference = np.log(other.impedance[common]) - Z
    sigma2 = own_noise[common] ** 2 + np.interp(f, first.frequency, noise) ** 2
    there, here = (_resonance(f, z) for z in (np.exp(Z), other.impedance[common]))
    excess = float(np.mean(np.abs(difference) ** 2 / (2 * sigma2)))
    return Comparison(_changed(first, other), excess, here / there - 1)


def _at(sweep: Sweep, values: Complexes, f: Frequencies) -> Complexes:
    if np.array_equal(f, sweep.frequency):
        return values
    unwrapped = values.real + 1j * np.unwrap(values.imag)
    return np.asarray(CubicSpline(sweep.frequency, unwrapped)(f), np.complex128)


def _resonance(f: Frequencies, Z: Complexes) -> float:
    """Return the frequency of the top of the conductance, Hz, by a parabola through the points about it."""
    G: Reals = (1 / Z).real
    k = int(np.clip(np.argmax(G), 2, f.size - 3))
    near = slice(k - 2, k + 3)
    parabola: Reals = np.asarray(np.polyfit(f[near] - f[k], G[near] / G[k], 2), np.float64)
    a, b = float(parabola[0]), float(parabola[1])
    return float(f[k]) - b / (2 * a) if a < 0 else float(f[k])


def _changed(first: Sweep, other: Sweep) -> str:
    words = [
        says.format(first.settings[name], other.settings[name])
        for name, says in _WORDS.items()
        if first.settings.get(name) is not None
        and other.settings.get(name) is not None
        and first.settings[name] != other.settings[name]
    ]
    band = f"{other.frequency[0] / 1e6:.4g} to {other.frequency[-1] / 1e6:.4g} MHz"
    same = np.isclose(first.frequency[[0, -1]], other.frequency[[0, -1]], rtol=1e-6).all()
    return ", ".join(words) or ("repeated" if same else band)
