"""The resonances of a device as they are without amplitude, fitted to its recordings at two drive levels.

A resonance that bends is none of a few poles. So R, L and C of each, the law of `amplitude_law` and a smooth ground are
fitted to both recordings at once. As the law moves, the resonances follow, so that they always describe the recording
at the lower level; what they leave of it is in both and cancels.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ....models.base.arrays import Complexes, Frequencies, Reals
from ..pair import Pair
from ..resonances import Resonances, changed, slope_of
from .amplitude_law import SIZES, Law, bent, strongest

_MOST, _STRIDE, _NEAR, _GROUND = 8, 4, 4.0, 4
"""Most resonances; one of how many points, and within how many widths of a resonance all of them; polynomials of the
ground's capacitance and conductance. Budgets."""
_SHARP = 8.0
"""Q of a resonance; what is broader is a curvature like that of a capacitance."""
_APART = (1.0, 0.5, 0.25)
"""Distances below which poles describe one resonance, in the sum of their half widths."""
_ROUNDS, _ACCURACY, _STEP = 30, 1e-4, 1e-4
_FORM, _DRIFT = 3e-4, 1e-4
"""Errors of ln Y by the form of the resonances, and of ln f."""
_SPREADS = np.array([1.0, 0.5, 0.3])
"""Of each resonance's frequency (half widths), ln Q and ln strength about their starts."""
_FURTHEST = 5.0
"""Largest softening at which the fit begins, in standard deviations of its prior."""
_PART = 0.8
"""Amplitude of a moderately bent resonance, relative to that without a bend."""
_LAW, _DRIFTS = 3, 4
"""Numbers of the law's coordinates, and of these and the drift."""


@dataclass(frozen=True, eq=False)
class BothLevels:
    """Both recordings on a part of their points, and a model of them by its coordinates.

    Coordinates are softening, loss, exponent, drift of all frequencies, and each resonance's frequencies, ln Q and
    ln strengths, shape (4 + 3P,); each has a unit normal prior.
    """

    frequency: Frequencies
    Y: tuple[Complexes, Complexes]
    sigma: tuple[Reals, Reals]
    """Standard deviation of ln Y."""
    start: Resonances
    ratios: tuple[float, float]
    """The levels, relative to the higher one."""

    def resonances(self, x: Reals) -> Resonances:
        """Return the resonances without amplitude."""
        moved = x[_DRIFTS:].reshape(3, -1) * _SPREADS[:, None]
        moved[0] /= 2 * self.start.q
        return Resonances(*changed(self.start.poles, self.start.residues, moved[0], moved[1], moved[2]))

    def law(self, x: Reals) -> Law:
        """Return softening, loss and exponent."""
        softening, loss, exponent = (size.value(float(z)) for size, z in zip(SIZES, x[:_LAW], strict=True))
        return softening, loss, exponent

    def residuals(self, x: Reals) -> Reals:
        """Return misfits beside the best ground and gain, and the coordinates, each of a unit normal prior."""
        drift = float(np.exp(_DRIFT * x[_LAW]))
        rows = np.concatenate([self._misfit(x, 0, 1.0), self._misfit(x, 1, drift)])
        return np.concatenate([_beside(rows, self._ground), x])

    def followed(self, x: Reals) -> Reals:
        """Return d resonances' coordinates / d law's for the recording at the lower level alone, shape (3P, 3)."""
        lower = int(self.ratios[1] < self.ratios[0])

        def misfit(at: Reals) -> Reals:
            return _beside(self._misfit(at, lower, 1.0), self._grounds[lower])

        here = misfit(x)
        J: Reals = np.column_stack([(misfit(x + step) - here) / _STEP for step in _STEP * np.eye(x.size)])
        count = x.size - _DRIFTS
        own = np.vstack([J[:, _DRIFTS:], np.eye(count)])
        law = np.vstack([J[:, :_LAW], np.zeros((count, _LAW))])
        return np.asarray(-np.linalg.lstsq(own, law, rcond=None)[0], np.float64)

    def _misfit(self, x: Reals, k: int, drift: float) -> Complexes:
        """Return the misfit of one recording in units of its error, shape (N,)."""
        seen = np.sum(bent(self.resonances(x), self.frequency / drift, self.law(x), self.ratios)[k], axis=1)
        return np.asarray((self.Y[k] - seen) / self.Y[k] / self.sigma[k], np.complex128)

    @cached_property
    def _columns(self) -> list[Complexes]:
        """The ground in each recording's misfit, shapes (N, M)."""
        u = np.log(self.frequency)
        place = (2 * u - u[0] - u[-1]) / (u[-1] - u[0])
        polynomials = np.cos(np.arange(_GROUND) * np.arccos(np.clip(place, -1, 1))[:, None]).astype(np.complex128)
        ground = np.hstack([1j * self.frequency[:, None] * polynomials, polynomials])
        return [np.asarray(ground / (Y * s)[:, None]) for Y, s in zip(self.Y, self.sigma, strict=True)]

    @cached_property
    def _grounds(self) -> list[Reals]:
        return [_basis(one) for one in self._columns]

    @cached_property
    def _ground(self) -> Reals:
        """Basis of a ground common to both, and of a gain between them."""
        gain = np.concatenate([np.zeros(self.frequency.size), 1 / self.sigma[1]])[:, None]
        return _basis(np.asarray(np.hstack([np.vstack(self._columns), gain, 1j * gain]), np.complex128))


def _stacked(columns: Complexes) -> Reals:
    return np.concatenate([columns.real, columns.imag])


def _beside(misfit: Complexes, basis: Reals) -> Reals:
    """Return the real and imaginary parts of a misfit beside a basis."""
    real = _stacked(misfit)
    return real - basis @ (basis.T @ real)


def _basis(columns: Complexes) -> Reals:
    """Return an orthonormal basis of the real combinations of columns: real parts, then imaginary parts."""
    real = _stacked(columns)
    return np.linalg.qr(real / np.linalg.norm(real, axis=0))[0]


@dataclass(frozen=True, eq=False)
class LevelFit:
    """The fit to both recordings, and how the resonances follow the law."""

    both: BothLevels
    x: Reals
    inverse: Reals
    """Covariance of all coordinates, shape (4 + 3P, 4 + 3P)."""
    follow: Reals

    @property
    def law(self) -> Law:
        """The law found."""
        return self.both.law(self.x)

    def at(self, law: Law) -> Resonances:
        """Return the resonances that describe the recording at the lower level, if this is the law."""
        x = self.x.copy()
        there = [(value - size.median) / size.spread for value, size in zip(law, SIZES, strict=True)]
        x[_DRIFTS:] += self.follow @ (np.array(there) - x[:_LAW])
        return self.both.resonances(x)


def merged(own: Resonances, apart: float = 1.0) -> Resonances:
    """Return the strongest resonances; poles this near to a stronger one, in widths, are a part of it.

    Broad poles describe the ground, unless there are no others.
    """
    peak = np.abs(own.residues / own.poles.real)
    sharp = own.q > min(_SHARP, float(np.max(own.q)) * 0.999)
    free: list[int] = [k for k in np.argsort(-peak).tolist() if sharp[k]]
    poles: list[complex] = []
    residues: list[complex] = []
    while free and len(poles) < _MOST:
        p = complex(own.poles[free[0]])
        group = [k for k in free if abs(own.poles[k] - p) <= -apart * (own.poles[k].real + p.real)]
        free = [k for k in free if k not in group]
        poles.append(p)
        residues.append(abs(complex(np.sum(own.residues[group]))) * p / (1j * p.imag))
    return Resonances(np.array(poles, np.complex128), np.array(residues, np.complex128))


def fitted_to_both(pair: Pair, resonances: tuple[Resonances, Resonances], ratios: tuple[float, float]) -> LevelFit:
    """Return the fit to both recordings, with as many resonances as pay for their numbers (Akaike).

    The recording at the lower level has at least one resonance.
    """
    lower = resonances[int(ratios[1] < ratios[0])]
    f, kept = pair.frequency, _chosen(pair.frequency, resonances)
    sides = (pair.before, pair.noise_before), (pair.after, pair.noise_after)
    sigma = [
        np.sqrt(noise**2 + _FORM**2 + (_DRIFT * np.abs(slope_of(f, Z, own)[0])) ** 2)[kept]
        for (Z, noise), own in zip(sides, resonances, strict=True)
    ]
    Y = 1 / pair.before[kept], 1 / pair.after[kept]
    found: list[tuple[float, BothLevels, Any]] = []
    for start in {one.poles.size: one for one in (merged(lower, apart) for apart in _APART)}.values():
        both = BothLevels(f[kept], Y, (sigma[0], sigma[1]), start, ratios)
        for x in _starts(both, resonances):
            end: Any = least_squares(both.residuals, x, max_nfev=_ROUNDS, xtol=_ACCURACY, ftol=_ACCURACY)
            found.append((float(end.cost) + 3 * start.poles.size, both, end))
    _, both, end = min(found, key=lambda one: one[0])
    x, J = np.asarray(end.x, np.float64), np.asarray(end.jac, np.float64)
    inverse = np.asarray(np.linalg.inv(J.T @ J), np.float64)
    return LevelFit(both, x, inverse, both.followed(x))


def _chosen(f: Frequencies, resonances: tuple[Resonances, Resonances]) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return which points are used: all near resonances, some of the others."""
    kept = np.arange(f.size) % _STRIDE == 0
    for own in resonances:
        kept |= np.any(np.abs(f[:, None] - own.poles.imag) < -2 * _NEAR * own.poles.real, axis=1)
    return kept


def _starts(both: BothLevels, resonances: tuple[Resonances, Resonances]) -> list[Reals]:
    """Return the coordinates where the fit begins: no bend, and that by which the strongest resonance moved."""
    none = np.zeros(_DRIFTS + 3 * both.start.poles.size)
    if not all(own.poles.size for own in resonances):
        return [none]
    first, second = (own.poles[strongest(own)].imag for own in resonances)
    bend = -np.log(second / first) / (_PART * (both.ratios[1] - both.ratios[0])) / SIZES[0].spread
    moved = none.copy()
    moved[0] = np.clip(bend, -_FURTHEST, _FURTHEST)
    return [none, moved]
