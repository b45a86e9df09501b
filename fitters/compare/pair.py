"""Two recordings on one frequency grid with their noise, the input of every comparison."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ...models.sweep import Sweep
from ..engine.noise import noise_of, reflection_noise
from ..interface import TaskError
from ..polarity import polarity_of
from .resonances import fitted_poles, resonances_of, running

_LEAST = 20
"""Fewest common points; with fewer, errors and changes cannot be distinguished."""
_FLOOR = 1e-5
"""Smallest noise of ln Z: no analyzer repeats better."""
_SPLINE = 15.0
"""Twice as many points reduce the error of a cubic spline to a sixteenth, so it is a fifteenth of the difference."""
_MOSTLY = 0.9


@dataclass(frozen=True, eq=False)
class Pair:
    """One device before and after."""

    frequency: Frequencies
    before: Impedances
    """ohm, shape (N,)."""
    after: Impedances
    noise_before: Reals
    """Standard deviation of Re and Im of ln Z, shape (N,)."""
    noise_after: Reals
    levels: tuple[float | None, float | None] = (None, None)
    """Oscillator level in V (or A), if the files state it."""
    turned: tuple[str, str] = ("", "")
    """Polarity of each side in its file (`inverted`, `conjugated`) before the correction."""
    repeats: tuple[int, int] = (1, 1)
    reflection: float = 0.0
    """Noise of the reflection at 50 ohm if both can be recordings of a network analyzer; else 0."""
    notes: tuple[str, ...] = field(default=())

    @property
    def log_f(self) -> Reals:
        """Ln f, shape (N,)."""
        return np.log(self.frequency)

    @cached_property
    def change(self) -> Complexes:
        """ln(after/before), shape (N,); its imaginary part within pi."""
        return np.log(self.after / self.before)

    def without(self, held: Sequence[tuple[int, int]]) -> "Pair":
        """Return the same without some blocks of points, whose noise is set to infinity."""
        noise = self.noise_after.copy()
        for first, stop in held:
            noise[first:stop] = np.inf
        return replace(self, noise_after=noise)


def pair_of(before: Sequence[Sweep], after: Sequence[Sweep]) -> Pair:
    """Return the pair of two sides; several sweeps on a side are repeats. Raises TaskError if they share no band."""
    low = max(float(sweep.frequency[0]) for sweep in (*before, *after))
    high = min(float(sweep.frequency[-1]) for sweep in (*before, *after))
    bands = [f"{s.frequency[0]:.6g}-{s.frequency[-1]:.6g} Hz" for s in (before[0], after[0])]
    if low >= high:
        raise TaskError(
            f"the recordings share no band: before is {bands[0]}, after is {bands[1]}; "
            "only where both were measured can they be compared"
        )
    low, high = low * (1 - 1e-9), high * (1 + 1e-9)
    grids = [s.frequency[(s.frequency >= low) & (s.frequency <= high)] for s in (*before, *after)]
    grid = min(grids, key=len)
    if grid.size < _LEAST:
        raise TaskError(
            f"the recordings share {grid.size} points from {low:.6g} to {high:.6g} Hz; at least {_LEAST} are needed"
        )
    turned = tuple(_turned(side) for side in (before, after))
    sides = [_side(side, how, grid) for side, how in zip((before, after), turned, strict=True)]
    return Pair(
        grid,
        np.exp(sides[0][0]),
        np.exp(sides[1][0]),
        sides[0][1],
        sides[1][1],
        (_level(before[0]), _level(after[0])),
        (turned[0], turned[1]),
        (len(before), len(after)),
        reflection_noise((before[0], after[0])),
    )


def unwrapped(Z: Impedances) -> Complexes:
    """Return ln Z without jumps of its phase, shape (N,)."""
    return np.asarray(np.log(np.abs(Z)) + 1j * np.unwrap(np.angle(Z)), np.complex128)


def _level(sweep: Sweep) -> float | None:
    value = sweep.settings.get("oscillator_V") or sweep.settings.get("oscillator_A")
    return float(value) if value else None


def _turned(side: Sequence[Sweep]) -> str:
    """Return the polarity of a side in its file; a negative resistance is sufficient evidence."""
    found = polarity_of(side[0])
    if found is None and float(np.mean(side[0].impedance.real < 0)) > _MOSTLY:
        return "inverted"
    return found or ""


def _side(side: Sequence[Sweep], turned: str, grid: Frequencies) -> tuple[Complexes, Reals]:
    """Return ln Z of one side on the grid, the mean of its repeats, and its noise."""
    _, noises = noise_of(side)
    curves: list[Complexes] = []
    variances: list[Reals] = []
    for sweep, noise in zip(side, noises, strict=True):
        curve, sigma = _on_grid(_right(sweep.impedance, turned), sweep.frequency, noise, grid)
        if curves:  # the phase of repeats must not differ by a whole turn
            curve = curve - 2j * np.pi * np.round(np.mean((curve - curves[0]).imag) / (2 * np.pi))
        curves.append(curve)
        variances.append(sigma**2)
    n = len(curves)
    mean = np.mean(curves, axis=0)
    variance = np.mean(variances, axis=0) / n
    if n > 1:
        scatter = np.sum(np.abs(np.array(curves) - mean) ** 2, axis=0) / 2 / (n - 1) / n
        variance = np.maximum(variance, running(scatter))
    return mean, np.sqrt(variance + _FLOOR**2)


def righted(sweep: Sweep, turned: str) -> Sweep:
    """Return a sweep of this polarity in its file with the right one."""
    return replace(sweep, impedance=_right(sweep.impedance, turned)) if turned else sweep


def _right(Z: Impedances, turned: str) -> Impedances:
    if turned == "inverted":
        return -Z
    return np.conj(Z) if turned == "conjugated" else Z


def _on_grid(Z: Impedances, f: Frequencies, noise: Reals, grid: Frequencies) -> tuple[Complexes, Reals]:
    """Return ln Z on the grid, and its standard deviation with the error of interpolation."""
    y, u, v = unwrapped(Z), np.log(f), np.log(grid)
    inside = np.searchsorted(f, grid).clip(0, f.size - 1)
    nearest = np.where(np.abs(f[inside] - grid) < np.abs(f[inside - 1] - grid), inside, inside - 1).clip(0)
    if np.allclose(f[nearest], grid, rtol=1e-9, atol=0):
        return y[nearest], np.asarray(noise[nearest], np.float64)
    # Resonances that the grid hardly resolves are interpolated as poles, and only the remainder by a spline.
    own = resonances_of(fitted_poles(f, Z, noise), f, Z)
    rest, there = 1 / Z - np.sum(own.seen(f), axis=1), np.sum(own.seen(grid), axis=1)
    made, *coarse = (np.log(CubicSpline(u[k::n], rest[k::n])(v) + there) for k, n in ((0, 1), (0, 2), (1, 2)))
    error = np.sqrt(sum(np.abs(np.exp(one - made) - 1) ** 2 for one in coarse) / 4) / _SPLINE
    phase = np.asarray(np.interp(v, u, y.imag) + made.imag, np.float64)
    curve = np.asarray(2j * np.pi * np.round(phase / (2 * np.pi)) - made, np.complex128)
    return curve, np.hypot(np.interp(v, u, noise), np.sqrt(running(error**2)))
