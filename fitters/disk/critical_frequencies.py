"""Critical frequencies of a resonance in a noisy recording, with their standard uncertainties.

Sherrit's method reads six frequencies off Y/w and wZ: the maximum of the real part and the extremes of the imaginary
part beside it, each component separately. Near each of them a weighted polynomial is fitted to the component over the
widest window in which it agrees with the known noise: wide if the noise is large, narrow if the shape is known well.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Reals
from ...models.base.local_maxima import prominent_peaks
from ...models.constants.sherrit import CriticalFrequencies
from ...models.sweep import Sweep
from ..interface import FitError

FEW_POINTS = 20.0
"""Points per linewidth below which a warning is given (imaginary parts suffer first)."""
TOO_FEW = 5.0
"""Points per linewidth below which the recording is rejected."""
_ABOVE_NOISE = 10.0
_WINDOWS = (1.3, 1.0, 0.8, 0.6, 0.45)
# Half-widths of the window in half linewidths. A resonance is 1/(1 + jx), x = 1 at half a linewidth: its series about a
# real x converges within sqrt(1 + x^2).
_DEGREES = (6, 5, 4, 3, 2)
_FITS = 1.2
# chi2 per degree of freedom up to which a polynomial counts as describing the points.


@dataclass(frozen=True, eq=False)
class ImmittanceTrace:
    """A complex curve with its noise: Y/w or wZ of one sweep."""

    frequency: Frequencies
    values: Complexes
    """S s (Y/w) or ohm/s (wZ), shape (N,)."""
    sigma: Reals
    """Standard deviation of the real and of the imaginary part, shape (N,)."""


@dataclass(frozen=True)
class Critical:
    """Critical frequencies of one peak, with their uncertainties and the resolution of the recording."""

    at: CriticalFrequencies
    u_top: float
    """Standard uncertainty, Hz, as are u_plus and u_minus."""
    u_plus: float
    u_minus: float
    points_per_linewidth: float

    def drawn(self, rng: np.random.Generator) -> complex:
        """Return a random complex frequency according to the noise, Hz."""
        top, plus, minus = rng.normal(
            (self.at.top, self.at.plus, self.at.minus), (self.u_top, self.u_plus, self.u_minus)
        ).tolist()
        return CriticalFrequencies(top, plus, minus).complex


def admittance_trace(sweep: Sweep, noise: Reals) -> ImmittanceTrace:
    """Return Y/w; `noise` is the standard deviation of Re and Im of ln Z, shape (N,)."""
    values = sweep.admittance / (2 * np.pi * sweep.frequency)
    return ImmittanceTrace(sweep.frequency, values, noise * np.abs(values))


def impedance_trace(sweep: Sweep, noise: Reals) -> ImmittanceTrace:
    """Return wZ; `noise` is the standard deviation of Re and Im of ln Z, shape (N,)."""
    values = sweep.impedance * (2 * np.pi * sweep.frequency)
    return ImmittanceTrace(sweep.frequency, values, noise * np.abs(values))


def tops(traces: Sequence[ImmittanceTrace], low: float, high: float) -> list[tuple[ImmittanceTrace, int, float]]:
    """Return the interior maxima of the real part between `low` and `high` (Hz) above the noise, largest first.

    Each is a trace, the index of its maximum, and its prominence.
    """
    maxima: list[tuple[ImmittanceTrace, int, float]] = []
    for trace in traces:
        peaks, prominences = prominent_peaks(trace.values.real, _ABOVE_NOISE * trace.sigma)
        for k, prominence in zip(peaks.tolist(), prominences.tolist(), strict=True):
            if low <= trace.frequency[k] <= high:
                maxima.append((trace, int(k), float(prominence)))
    return sorted(maxima, key=lambda peak: -peak[2])


def critical(trace: ImmittanceTrace, top: int, what: str) -> Critical:
    """Return the critical frequencies of the peak whose maximum is at index `top`.

    `what` names it in errors. Raises FitError if an end of the sweep cuts the peak off, or if fewer than five points
    lie in its linewidth.
    """
    f = trace.frequency
    low, high = linewidth(trace, top, what)
    half = max((high - low) / 2, float(f[top + 1] - f[top]))
    spacing = float(np.median(np.diff(f[(f >= f[top] - 2 * half) & (f <= f[top] + 2 * half)])))
    per_linewidth = 2 * half / spacing
    if per_linewidth < TOO_FEW:
        raise FitError(
            f"{what} at {f[top] / 1e3:.5g} kHz has {per_linewidth:.1f} points in its linewidth of {2 * half / 1e3:.3g} "
            f"kHz; {FEW_POINTS:.0f} give good answers, fewer than {TOO_FEW:.0f} none: sweep it every "
            f"{2 * half / FEW_POINTS:.0f} Hz"
        )
    below = _first((f >= f[top] - 3 * half) & (f <= f[top]), trace.values.imag, f)
    above = _first((f >= f[top]) & (f <= f[top] + 3 * half), -trace.values.imag, f)
    places = [
        _extremum(f, values, trace.sigma, start, half, what)
        for values, start in (
            (trace.values.real, float(f[top])),
            (trace.values.imag, below),
            (-trace.values.imag, above),
        )
    ]
    (at, u_top), (plus, u_plus), (minus, u_minus) = places
    if not plus < at < minus:
        raise FitError(
            f"{what} at {at / 1e3:.5g} kHz: the reactive part has its maximum at {plus / 1e3:.5g} kHz and its minimum "
            f"at {minus / 1e3:.5g} kHz; for a resonance they lie below and above it"
        )
    return Critical(CriticalFrequencies(at, plus, minus), u_top, u_plus, u_minus, (minus - plus) / spacing)


def linewidth(trace: ImmittanceTrace, top: int, what: str) -> tuple[float, float]:
    """Return the frequencies on either side where the real part has fallen to half, Hz."""
    f, values = trace.frequency, trace.values.real
    under = values < values[top] / 2
    below, above = np.flatnonzero(under[:top]), np.flatnonzero(under[top:])
    if below.size == 0 or above.size == 0:
        side = "below" if below.size == 0 else "above"
        raise FitError(
            f"{what} at {f[top] / 1e3:.5g} kHz is cut off: the recording holds {f[0] / 1e3:.5g} to "
            f"{f[-1] / 1e3:.5g} kHz, and more is needed {side} the peak"
        )
    at = [top - 1 - (top - 1 - int(below[-1])), top + int(above[0])]
    return (
        _crossing(f, values, at[0], values[top] / 2),
        _crossing(f, values, at[1] - 1, values[top] / 2),
    )


def _crossing(f: Frequencies, values: Reals, k: int, level: float) -> float:
    """Return where the straight line from point k to k + 1 crosses the level."""
    return float(f[k] + (f[k + 1] - f[k]) * (level - values[k]) / (values[k + 1] - values[k]))


def _first(where: np.ndarray[tuple[int], np.dtype[np.bool_]], values: Reals, f: Frequencies) -> float:
    there = np.flatnonzero(where)
    return float(f[there[np.argmax(values[there])]])


def _extremum(f: Frequencies, values: Reals, sigma: Reals, start: float, half: float, what: str) -> tuple[float, float]:
    """Return the frequency of the maximum near `start` and its standard uncertainty, Hz."""
    best: tuple[float, float] | None = None
    for degree in _DEGREES:
        for window in _WINDOWS:
            inside = np.flatnonzero(np.abs(f - start) <= window * half)
            if inside.size < degree + 3:
                continue
            peak, chi2 = _peak_of_polynomial((f[inside] - start) / half, values[inside], sigma[inside], degree)
            if peak is None:
                continue
            best = start + half * peak[0], half * peak[1]
            if chi2 < _FITS:
                return best
        if best is not None:
            return best
    raise FitError(f"{what} near {start / 1e3:.5g} kHz: too few points there to see where its extremes are")


def _peak_of_polynomial(x: Reals, y: Reals, sigma: Reals, degree: int) -> tuple[tuple[float, float] | None, float]:
    """Return the maximum of a weighted polynomial with its standard uncertainty, and chi2 per degree of freedom.

    The first is None if the polynomial has no maximum within the points.
    """
    basis = np.vander(x, degree + 1, increasing=True)
    weighted = basis / sigma[:, None]
    coefficients, *_ = np.linalg.lstsq(weighted, y / sigma, rcond=None)
    chi2 = float(np.sum(((y - basis @ coefficients) / sigma) ** 2)) / (x.size - degree - 1)
    shape = np.polynomial.Polynomial(coefficients)
    slope, bend = shape.deriv(), shape.deriv(2)
    roots = slope.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    inside = [float(root) for root in real if x[0] <= root <= x[-1] and bend(root) < 0]
    if not inside:
        return None, chi2
    top = min(inside, key=abs)
    by = np.arange(degree + 1) * top ** np.maximum(np.arange(degree + 1) - 1, 0)
    spread = np.linalg.lstsq(weighted.T, by, rcond=None)[0]  # by (W^T W)^-1 by = |spread|^2
    u = float(np.sqrt(max(1.0, chi2)) * np.linalg.norm(spread) / abs(bend(top)))
    return (top, u), chi2
