"""Model-free comparison of two recordings of one device: significance of their difference, and resonance shift."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from ....models.base.arrays import Complexes, Frequencies, Reals
from ....models.sweep import Sweep
from ...engine.noise import noise_of
from ...engine.recording import log_ratio

_SAME = 1.5
"""Mean squared difference, in units of noise, up to which two recordings agree."""
_TOO_FEW = 20
_SPLINE = 8.0
"""Divisor of the estimated spline error: doubling the point density reduces the error 16 times; half of that is used
to be safe."""
_AS_FINE = 1.5
"""Largest ratio of point spacings for which the resonance shift is reported."""
_WORDS = {
    "oscillator_V": "{1:g} V instead of {0:g} V",
    "oscillator_A": "{1:g} A instead of {0:g} A",
    "bandwidth": "bandwidth {1} instead of {0}",
    "direction": "swept {1} instead of {0}",
}


@dataclass(frozen=True)
class SweepComparison:
    """Difference of another recording of the same device."""

    changed: str
    """Changed settings in words: `0.1 V instead of 0.5 V`, `repeated`."""
    excess: float
    """Mean squared difference of ln Z over the common band, in units of noise: 1 where both agree."""
    shift: float | None
    """Relative change of the series resonance frequency; None if the points are too far apart."""

    @property
    def differs(self) -> bool:
        """Whether the difference exceeds noise."""
        return self.excess > _SAME

    @property
    def says(self) -> str:
        """The result as a sentence."""
        if not self.differs:
            return f"{self.changed}: the two recordings agree to within noise."
        moved = "" if self.shift is None else f"; resonance moved by {1e6 * self.shift:+.3g} ppm"
        return f"{self.changed}: the two recordings differ by {np.sqrt(self.excess):.3g} times the noise{moved}."


def compared(own: Sequence[Sweep], others: Sequence[Sweep]) -> tuple[SweepComparison, ...]:
    """Compare each of `others` with the sweep of `own` that has most points in common with it."""
    made: list[SweepComparison] = []
    for other in others:
        first = max(own, key=lambda one: _common(one, other).sum())
        if _common(first, other).sum() >= _TOO_FEW:
            made.append(_compared(first, other))
    return tuple(made)


def _common(one: Sweep, other: Sweep) -> Any:
    low = max(one.frequency[0], other.frequency[0])
    return (other.frequency >= low) & (other.frequency <= min(one.frequency[-1], other.frequency[-1]))


def _compared(first: Sweep, other: Sweep) -> SweepComparison:
    _, (noise,) = noise_of([first])
    _, (own_noise,) = noise_of([other])
    common = _common(first, other)
    f = other.frequency[common]
    Z, doubt = _at(first, f)
    difference = log_ratio(other.impedance[common], np.exp(Z))
    sigma2 = own_noise[common] ** 2 + np.interp(f, first.frequency, noise) ** 2 + doubt**2
    shift = None
    if float(np.mean(np.diff(f))) <= _AS_FINE * float(np.mean(np.diff(first.frequency))):
        there, here = (_resonance(f, z) for z in (np.exp(Z), other.impedance[common]))
        shift = here / there - 1
    excess = float(np.mean(np.abs(difference) ** 2 / (2 * sigma2)))
    return SweepComparison(_changed(first, other), excess, shift)


def _at(sweep: Sweep, f: Frequencies) -> tuple[Complexes, Reals]:
    """Return ln Z of a sweep interpolated to other frequencies, and its standard error; shapes (N,).

    The error of the spline is estimated from a second spline through every other point.
    """
    values: Complexes = np.log(np.abs(sweep.impedance)) + 1j * np.unwrap(np.angle(sweep.impedance)).astype(
        np.complex128
    )
    if np.array_equal(f, sweep.frequency):
        return values, np.zeros(f.size)
    all_points, half = (
        np.asarray(CubicSpline(sweep.frequency[::stride], values[::stride])(f), np.complex128) for stride in (1, 2)
    )
    return all_points, np.abs(all_points - half) / _SPLINE


def _resonance(f: Frequencies, Z: Complexes) -> float:
    """Return the frequency of the conductance maximum, Hz, from a parabola through five points."""
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
