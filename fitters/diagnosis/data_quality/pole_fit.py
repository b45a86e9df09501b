"""Pole fit: approximate a recording by a rational function with stable poles, as any causal linear device allows.

Y(s) is a sum of resonances, each a pair of conjugate poles in the left half plane with a complex residue, plus a smooth
background of real poles on a logarithmic grid and the terms 1/s, 1 and s. All coefficients are real, as the
Kramers-Kronig relations require. RC ladders alone (the usual test in electrochemistry) miss a perfect disk by 21-31 %.
A matched scan adds poles one by one where they explain most, and variable projection refines all of them (Golub and
Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; Jacobian after Kaufman, BIT 15 (1975) 49), so that the optimiser never
sees the linear coefficients. No pole is narrower than the point spacing resolves, so that a single bad point is not
fitted as a resonance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth

from ....models.base.arrays import Complexes, Reals
from ....models.sweep import Sweep

_GROUND = 12
_REACH = 5.0
"""The grid of real poles extends beyond the recorded band by this factor."""
_LEAST_WIDTH = 0.5
"""Half width of the narrowest pole, in steps of the frequency grid."""
MOST_POLES = 14
_PAYS = 40.0
"""Smallest decrease of chi2, in units of the residual chi2 per degree of freedom, that justifies a pole (4 numbers)."""
_FREQUENCIES, _WIDTHS = 70, (0.004, 0.02, 0.1)
_FELT = 1e-6
"""Smallest part of a pole's column outside the background; anything less is rounding error of arbitrary direction."""
_FAR = 30.0
"""chi2 per degree of freedom above which a rough refinement is enough, because more poles will follow."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A recording scaled for the pole fit; residuals are relative to Z and in units of noise."""

    s: Complexes
    """j omega over the geometric mean frequency of the band, shape (N,)."""
    inverse: Reals
    """1 / noise; 0 for excluded points; shape (N,)."""
    weight: Complexes
    """`inverse` / Y, the factor on every column, shape (N,)."""
    ground: Reals
    """Orthonormal columns of the non-resonant background, shape (2N, M)."""
    narrowest: float = _LEAST_WIDTH
    """Half width of the narrowest pole, in steps of the frequency grid."""

    @classmethod
    def of(cls, sweep: Sweep, noise: Reals, good: NDArray[np.bool_]) -> "Frame":
        """Return the frame of a recording in which only the points marked `good` count."""
        f = sweep.frequency
        s: Complexes = np.multiply(1j / float(np.sqrt(f[0] * f[-1])), f, dtype=np.complex128)
        inverse = np.where(good, 1 / noise, 0.0)
        Y = sweep.admittance / float(np.median(np.abs(sweep.admittance)))
        weight = inverse / Y
        low, high = s[0].imag / _REACH, s[-1].imag * _REACH
        real_poles = [1 / (1 + s / a) for a in _spaced(low, high, _GROUND)]
        columns = np.column_stack([stacked(column * weight) for column in (np.ones_like(s), s, 1 / s, *real_poles)])
        ground = np.asarray(orth(columns / np.linalg.norm(columns, axis=0), 1e-12), np.float64)
        return cls(s, inverse, weight, ground)

    @property
    def points(self) -> int:
        """Number of points that count."""
        return int(np.count_nonzero(self.inverse))

    @property
    def least_width(self) -> Reals:
        """Half width of the narrowest pole at each point, shape (N,)."""
        steps = np.diff(self.s.imag)
        return self.narrowest * np.append(steps, steps[-1])


@dataclass(frozen=True, eq=False)
class PoleFit:
    """A fit of poles to a recording."""

    frame: Frame
    poles: Complexes
    """Poles in the upper half plane, shape (P,), in units of the frame's mean frequency."""
    basis: Reals
    """Orthonormal columns of all linear terms, shape (2N, M)."""
    residues: Complexes
    """Complex residues, shape (P,), of columns scaled by the poles' half widths."""
    residual: Reals
    """Real parts, then imaginary parts, shape (2N,)."""

    @property
    def cost(self) -> float:
        """chi2."""
        return float(self.residual @ self.residual)

    @property
    def chi2_per_dof(self) -> float:
        """Misfit per degree of freedom; 1 where only noise is left."""
        return self.cost / max(1.0, 2.0 * self.frame.points - self.basis.shape[1] - 2 * self.poles.size)

    def tangent(self) -> Reals:
        """Return d fit / d (ln half width, frequency in half widths) outside the basis, shape (2N, 2P)."""
        frame, width = self.frame, -self.poles.real
        rho = self.residues * width
        up = rho / (frame.s[:, None] - self.poles) ** 2 * width
        down = np.conj(rho) / (frame.s[:, None] - np.conj(self.poles)) ** 2 * width
        J = np.hstack(
            [stacked(-(up + down) * frame.weight[:, None]), stacked(1j * (up - down) * frame.weight[:, None])]
        )
        return J - self.basis @ (self.basis.T @ J)


def fit_poles(frame: Frame, start: Complexes | None = None) -> PoleFit:
    """Fit as many poles as the data justify, beginning with those in `start`."""
    best = linear_fit(frame, np.zeros(0, np.complex128) if start is None else start)
    if start is not None:
        best = refined(best)
    while best.poles.size < MOST_POLES:
        trial = linear_fit(frame, np.append(best.poles, _most_promising(best)))
        trial = refined(trial)
        if best.cost - trial.cost < _PAYS * max(1.0, trial.chi2_per_dof):
            break
        best = trial
    return best


def linear_fit(frame: Frame, poles: Complexes) -> PoleFit:
    """Fit the linear coefficients with the poles held fixed."""
    aim = stacked(np.asarray(frame.inverse, np.complex128))
    basis, residues = frame.ground, np.zeros(0, np.complex128)
    if poles.size:
        columns = np.hstack(_columns(frame, poles))
        outside = columns - frame.ground @ (frame.ground.T @ columns)
        felt = np.linalg.norm(outside, axis=0) > _FELT * np.linalg.norm(columns, axis=0)
        q, r = np.linalg.qr(outside[:, felt])
        q -= frame.ground @ (frame.ground.T @ q)
        basis = np.hstack([frame.ground, q])
        x = np.zeros(felt.size)
        x[felt] = np.linalg.lstsq(r, q.T @ aim, rcond=1e-12)[0]
        residues = x[: poles.size] + 1j * x[poles.size :]
    return PoleFit(frame, poles, basis, residues, aim - basis @ (basis.T @ aim))


def refined(fit: PoleFit) -> PoleFit:
    """Refine the poles by a few Levenberg-Marquardt steps."""
    damping = 1e-3
    for _ in range(14 if fit.chi2_per_dof < _FAR else 6):
        J, before = fit.tangent(), fit.cost
        normal, slope = J.T @ J, J.T @ fit.residual
        for _ in range(5):
            trial = _moved(fit, normal, slope, damping)
            if trial.cost < fit.cost:
                fit, damping = trial, max(damping / 5, 1e-7)
                break
            damping *= 8
        if before - fit.cost < 1e-3 * before:
            break
    return fit


def _moved(fit: PoleFit, normal: Reals, slope: Reals, damping: float) -> PoleFit:
    n, ridge = fit.poles.size, 1e-12 * float(np.trace(normal)) + 1e-300
    step = np.linalg.solve(normal + np.diag(damping * np.diag(normal) + ridge), slope)
    step = np.clip(step, -0.7, 0.7)
    width = -fit.poles.real
    place = np.abs(fit.poles.imag + step[n:] * width)
    least = np.interp(place, fit.frame.s.imag, fit.frame.least_width)
    return linear_fit(fit.frame, -np.maximum(width * np.exp(step[:n]), least) + 1j * place)


def _most_promising(fit: PoleFit) -> complex:
    """Return the pole of a grid that would explain most of the residual (a matched scan)."""
    frame = fit.frame
    places: Reals = _spaced(0.7 * frame.s[0].imag, 1.6 * frame.s[-1].imag, _FREQUENCIES)
    place, relative = (grid.ravel() for grid in np.meshgrid(places, _WIDTHS))
    width = np.maximum(relative * place, np.interp(place, frame.s.imag, frame.least_width))
    poles: Complexes = np.asarray(-width + 1j * place, np.complex128)
    return complex(poles[int(np.argmax(_gains(*_columns(frame, poles), fit.basis, fit.residual)))])


def _gains(A: Reals, B: Reals, basis: Reals, residual: Reals) -> Reals:
    """Return the decrease of chi2 from each pair of columns (A_k, B_k) added to the basis, shape (K,)."""
    a, b = basis.T @ A, basis.T @ B
    full = np.maximum(np.sum(A**2, axis=0), np.sum(B**2, axis=0))
    aa, bb = np.sum(A**2, axis=0) - np.sum(a**2, axis=0), np.sum(B**2, axis=0) - np.sum(b**2, axis=0)
    ab = np.sum(A * B, axis=0) - np.sum(a * b, axis=0)
    ra, rb = A.T @ residual, B.T @ residual
    det = aa * bb - ab**2
    seen = (aa > 1e-7 * full) & (bb > 1e-7 * full) & (det > 1e-6 * aa * bb)
    return np.where(seen, (bb * ra**2 - 2 * ab * ra * rb + aa * rb**2) / np.where(seen, det, 1.0), 0.0)


def stacked(values: Complexes) -> Reals:
    """Return the real parts followed by the imaginary parts."""
    return np.concatenate([values.real, values.imag])


def _columns(frame: Frame, poles: Complexes) -> tuple[Reals, Reals]:
    """Return the two columns of each pole, scaled by its half width, each of shape (2N, P)."""
    up, down = 1 / (frame.s[:, None] - poles), 1 / (frame.s[:, None] - np.conj(poles))
    scale = -poles.real * frame.weight[:, None]
    return stacked((up + down) * scale), stacked(1j * (up - down) * scale)


def _spaced(low: float, high: float, count: int) -> Reals:
    part = np.arange(count) / (count - 1)
    return low * (high / low) ** part
