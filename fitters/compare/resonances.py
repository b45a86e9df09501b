"""The resonances of a recording: poles of its admittance, and a remainder.

The poles are those of the rational fit of the data checks (`fitters/diagnosis/data_quality/pole_fit.py`).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ...models.sweep import Sweep
from ..diagnosis.data_quality.pole_fit import Frame, PoleFit
from ..diagnosis.data_quality.vector_fitting import frame_for_poles, vector_fitted

_ERROR = 3e-4
"""Error of ln Z below which more poles are useless."""
_LEAST_Q = 3.0
_SMOOTH = 9
"""Points over which the error of an interpolation and the scatter of repeats are averaged."""
_BEYOND = 1.05
"""Factor by which a resonance may lie outside the band."""
_SLOPE = 3.0
"""Smallest reduction of a slope's error by twice as many points if resonances are hardly resolved."""


@dataclass(frozen=True, eq=False)
class Resonances:
    """The resonances of a recording, as poles of its admittance."""

    poles: Complexes
    """1/s over 2 pi, shape (P,): Im p is the frequency in Hz, -Re p half of its width."""
    residues: Complexes
    """S Hz, shape (P,)."""
    _known: list[tuple[Frequencies, Complexes]] = field(default_factory=list[tuple[Frequencies, Complexes]])
    """Cache of the last result, because all hypotheses need the same."""

    @property
    def q(self) -> Reals:
        """Quality factors, shape (P,)."""
        return np.abs(self.poles) / (-2 * self.poles.real)

    def resolved(self, frequency: Frequencies) -> NDArray[np.bool_]:
        """Return which are as wide as the step of a grid, shape (P,).

        Between two points of the grid a narrower one is hardly seen, and its pole may be wrong, or one of two for one.
        """
        steps = np.interp(np.abs(self.poles), frequency[1:], np.diff(frequency))
        return np.asarray(-2 * self.poles.real >= steps, np.bool_)

    def seen(self, frequency: Frequencies) -> Complexes:
        """Return the admittance of each, S, shape (N, P)."""
        if not self._known or self._known[0][0] is not frequency:
            self._known[:] = [(frequency, pole_terms(frequency, self.poles, self.residues))]
        return self._known[0][1]

    def with_others(self, chosen: list[int], poles: Complexes, residues: Complexes) -> "Resonances":
        """Return the same with some of the resonances replaced; only these are recomputed."""
        p, r = self.poles.copy(), self.residues.copy()
        p[chosen], r[chosen] = poles, residues
        made = Resonances(p, r)
        if self._known:
            frequency, seen = self._known[0]
            seen = seen.copy()
            seen[:, chosen] = pole_terms(frequency, poles, residues)
            made._known.append((frequency, seen))
        return made


State = tuple[Impedances, Resonances]
"""The impedance (ohm) and its resonances."""


def pole_terms(frequency: Frequencies, poles: Complexes, residues: Complexes) -> Complexes:
    """Return r/(jf - p) + r*/(jf - p*), S, shape (N, P); poles and residues may differ from point to point."""
    s = 1j * frequency[:, None]
    return np.asarray(residues / (s - poles) + np.conj(residues) / (s - np.conj(poles)), np.complex128)


def changed(
    poles: Complexes, residues: Complexes, shift: float | Reals, q: float | Reals, strength: float | Reals
) -> tuple[Complexes, Complexes]:
    """Return poles and residues of branches after these changes of ln frequency, ln Q and ln capacitance.

    The residue of a branch with capacitance C is C |p|^2 p/(2j Im p).
    """
    size = np.abs(poles) * np.exp(shift)
    half = np.minimum(-poles.real / np.abs(poles) * np.exp(-q), 0.99)
    moved = np.asarray(size * (-half + 1j * np.sqrt(1 - half**2)), np.complex128)
    turn = (moved / moved.imag) / (poles / poles.imag)
    return moved, np.asarray(residues * turn * np.exp(strength + 2 * shift), np.complex128)


def fitted_poles(f: Frequencies, Z: Impedances, noise: Reals, start: PoleFit | None = None) -> PoleFit:
    """Return the rational fit to a recording, ohm, with this noise of ln Z, shapes (N,)."""
    sweep = Sweep(f, Z)
    frame = Frame.of(sweep, np.hypot(noise, _ERROR), np.ones(Z.size, np.bool_))
    return vector_fitted(frame_for_poles(frame), None if start is None else start.poles)


def resonances_of(fit: PoleFit, f: Frequencies, Z: Impedances) -> Resonances:
    """Return the poles of a fit that are resonances in the band."""
    middle = float(np.sqrt(f[0] * f[-1]))
    scale = float(np.median(np.abs(1 / Z)))
    poles = fit.poles * middle
    residues = fit.residues * -fit.poles.real * middle * scale
    chosen = (np.abs(poles) > -2 * _LEAST_Q * poles.real) & (poles.imag > f[0] / _BEYOND)
    chosen &= poles.imag < f[-1] * _BEYOND
    order = np.argsort(poles.imag[chosen])
    return Resonances(poles[chosen][order], residues[chosen][order])


@dataclass(frozen=True, eq=False)
class Remainder:
    """What of an admittance the resonances leave; a drift of theirs does not change it."""

    Y: Complexes
    """S, shape (N,)."""
    slope: Complexes
    """d Y / d ln f by a spline, S, shape (N,)."""
    error: Reals
    """Error of the slope, estimated from every other point, S, shape (N,)."""


def remainder_of(f: Frequencies, Y: Complexes, own: Resonances) -> Remainder:
    """Return what the resonances leave of an admittance, S, shape (N,)."""
    u, left = np.log(f), Y - np.sum(own.seen(f), axis=1)
    slope = np.asarray(make_interp_spline(u, left, 5)(u, 1), np.complex128)
    halves = [np.asarray(make_interp_spline(u[k::2], left[k::2], 5)(u, 1), np.complex128) for k in (0, 1)]
    return Remainder(left, slope, np.max([np.abs(half - slope) for half in halves], axis=0))


def slope_of(
    f: Frequencies, Z: Impedances, own: Resonances, remainder: Remainder | None = None
) -> tuple[Complexes, Complexes, Reals]:
    """Return the slope of ln Z over ln f, the change by a shift of the remainder, and its error, shape (N,).

    The remainder, computed unless it is given, is treated as that of a capacitance, which does not change when all
    frequencies shift. The slope of poles is exact; that of the remainder is a spline's.
    """
    Y = 1 / Z
    left = remainder or remainder_of(f, Y, own)
    s = 1j * f[:, None]
    exact = -s * (own.residues / (s - own.poles) ** 2 + np.conj(own.residues) / (s - np.conj(own.poles)) ** 2)
    error = left.error / np.abs(Y) / _SLOPE
    slope = np.asarray(-(left.slope + np.sum(exact, axis=1)) / Y, np.complex128)
    return slope, np.asarray((left.Y - left.slope) / -Y, np.complex128), np.sqrt(running(error**2))


def running(values: Reals) -> Reals:
    """Return the running mean over some points, shape (N,)."""
    kernel = np.ones(_SMOOTH)
    weight = np.convolve(np.ones_like(values), kernel, mode="same")
    return np.convolve(values, kernel, mode="same") / weight
