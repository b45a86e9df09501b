"""Matched filters for steps and short glitches: a generalised likelihood ratio test at every point of a pole fit.

A step multiplies Z by 1 + a from one point onwards, a glitch multiplies a few points; `a` is complex. The part that
poles could imitate is projected out first, so that no resonance is reported as a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ....models.base.arrays import Complexes, Reals
from .pole_fit import PoleFit, stacked

_Number = TypeVar("_Number", np.float64, np.complex128)
Indices = NDArray[np.intp]
_LENGTHS = (1, 2, 3, 4, 6, 8, 12)
"""Lengths of glitches, in points; a longer one counts as two steps."""
_NEAR = 25
"""Number of points on either side whose residuals set the scale of a glitch's score."""
_EDGE = 4
_STEP_SURVIVES, _GLITCH_SURVIVES = 1e-4, 0.03
"""Smallest part of a template's squared norm that must lie outside the span of the poles."""
_BY_CHANCE = 0.2
"""Correlation of neighbouring residuals that about fifty points of white noise may show by chance."""


@dataclass(frozen=True)
class Glitch:
    """A step or a glitch in a recording."""

    first: int
    """Index of the first point affected."""
    stop: int
    """Index after the last point affected; for a step, which lasts to the end, the number of points."""
    amplitude: complex
    """Factor on Z at these points, minus 1."""
    raw: float
    """Decrease of chi2 when it is taken into account."""
    score: float
    """`raw` over the residual chi2 per point nearby, corrected for correlated residuals."""
    plain: bool = False
    """Whether it stands out against its neighbourhood even without a pole fit."""

    def is_step(self, points: int) -> bool:
        """Return whether it lasts to the end of a recording with this many points."""
        return self.stop == points


def strongest(fit: PoleFit) -> list[Glitch]:
    """Return the best step, and the best glitch of every length, most significant first."""
    search = _Search.of(fit)
    n = search.residual.size
    found = [search.best(np.arange(_EDGE, n - _EDGE), np.full(n - 2 * _EDGE, n), _STEP_SURVIVES)]
    for length in _LENGTHS:
        first = np.arange(n - length + 1)
        found.append(search.best(first, first + length, _GLITCH_SURVIVES))
    return sorted(found, key=lambda flaw: -flaw.score)


def standing(fit: PoleFit, flaw: Glitch) -> Glitch:
    """Return a flaw with the score from a fit that already includes it: a step removed, a glitch's points still in."""
    search = _Search.of(fit)
    if not flaw.is_step(search.residual.size):
        return search.best(np.array([flaw.first]), np.array([flaw.stop]), _GLITCH_SURVIVES)
    step = stacked(np.where(np.arange(search.residual.size) >= flaw.first, flaw.amplitude * fit.frame.inverse, 0.0))
    # a step is known to be there, so that its information is needed even where the columns are nearly dependent
    basis = _directions(search.basis)
    outside = step - basis @ (basis.T @ step)
    raw = float(outside @ outside)
    near = slice(max(0, flaw.first - _NEAR), flaw.first + _NEAR)
    return replace(flaw, raw=raw, score=raw / _worth(search.residual[near][fit.frame.inverse[near] > 0]))


def adjusted(fit: PoleFit, flaws: Sequence[Glitch]) -> list[Glitch]:
    """Return the flaws with the heights of all steps re-estimated together from the residuals of a fit without them."""
    n = fit.frame.inverse.size
    steps = [flaw for flaw in flaws if flaw.is_step(n)]
    basis = _Search.of(fit).basis
    after = np.stack([np.where(np.arange(n) >= flaw.first, fit.frame.inverse, 0.0) for flaw in steps], axis=1)
    columns = np.hstack([stacked(after + 0j), stacked(1j * after)])
    outside = columns - basis @ (basis.T @ columns)
    x = np.linalg.lstsq(outside, fit.residual, rcond=1e-6)[0]
    found = dict(zip((flaw.first for flaw in steps), -x[: len(steps)] - 1j * x[len(steps) :], strict=True))
    return [
        replace(flaw, amplitude=flaw.amplitude + _held(complex(found[flaw.first]), flaw)) if flaw in steps else flaw
        for flaw in flaws
    ]


def _held(change: complex, flaw: Glitch) -> complex:
    """Return the change of a step's height, limited to half the height because the fit may still be poor."""
    return change * min(1.0, 0.5 * abs(flaw.amplitude) / max(abs(change), 1e-300))


@dataclass(frozen=True, eq=False)
class _Search:
    """Cumulative sums from which the scores of all contiguous templates follow."""

    fit: PoleFit
    basis: Reals
    """Orthonormal columns, including the tangent of the fit, shape (2N, M)."""
    residual: Complexes
    """Residuals outside the basis, shape (N,)."""
    real: Reals
    imag: Reals
    """Cumulative sums of basis rows over noise, shape (N + 1, M)."""
    left: Complexes
    """Cumulative sums of residuals over noise, shape (N + 1,)."""
    squares: Reals
    """Cumulative sums of 1 / noise^2, shape (N + 1,)."""

    @classmethod
    def of(cls, fit: PoleFit) -> "_Search":
        inverse, n = fit.frame.inverse, fit.frame.inverse.size
        basis = np.hstack([fit.basis, _directions(fit.tangent())])
        r = fit.residual - basis @ (basis.T @ fit.residual)
        residual = r[:n] + 1j * r[n:]
        real, imag = (_running(basis[half] * inverse[:, None]) for half in (slice(0, n), slice(n, 2 * n)))
        return cls(fit, basis, residual, real, imag, _running(residual * inverse), _running(inverse**2))

    def information(self, first: Indices, stop: Indices) -> tuple[Reals, Reals, Reals]:
        """Return the Fisher information of Re, of Im, and of both jointly, of the height of templates [first, stop)."""
        R, X = self.real[stop] - self.real[first], self.imag[stop] - self.imag[first]
        whole = self.squares[stop] - self.squares[first]
        return whole - np.sum(R**2, axis=1), whole - np.sum(X**2, axis=1), -np.sum(R * X, axis=1)

    def best(self, first: Indices, stop: Indices, survives: float) -> Glitch:
        """Return the best of the templates [first, stop); at least the part `survives` must lie outside the basis."""
        whole, pull = self.squares[stop] - self.squares[first], self.left[stop] - self.left[first]
        aa, bb, ab = self.information(first, stop)
        det = aa * bb - ab**2
        seen = (whole > 0) & (np.minimum(aa, bb) > survives * whole) & (det > 1e-6 * whole**2 * survives)
        a = np.where(seen, bb * pull.real - ab * pull.imag, 0.0) / np.where(seen, det, 1.0)
        b = np.where(seen, aa * pull.imag - ab * pull.real, 0.0) / np.where(seen, det, 1.0)
        raw = a * pull.real + b * pull.imag
        k = int(np.argmax(raw))
        # residuals are 1 - Y_fit / Y: a Z that is too large makes them negative
        return self._weighed(int(first[k]), int(stop[k]), -complex(a[k], b[k]), float(raw[k]))

    def _weighed(self, first: int, stop: int, amplitude: complex, raw: float) -> Glitch:
        n, inverse = self.residual.size, self.fit.frame.inverse
        template = np.zeros(n, np.complex128)
        template[first:stop] = -amplitude * inverse[first:stop]
        seen = stacked(template)
        outside = seen - self.basis @ (self.basis.T @ seen)
        left = self.residual - (outside[:n] + 1j * outside[n:])
        last = first if stop == n else stop
        low, high = max(0, first - _NEAR), min(n, last + _NEAR)
        near = left[low:high][inverse[low:high] > 0]
        return Glitch(first, stop, amplitude, raw, raw / _worth(near))


def _worth(near: Complexes) -> float:
    """Return chi2 per point of the residuals, times the number of correlated points that count as one."""
    total = float(np.sum(np.abs(near) ** 2))
    if total == 0:
        return 1.0
    rho = float(np.real(np.sum(near[1:] * np.conj(near[:-1])))) / total
    rho = min(max(0.0, rho - _BY_CHANCE), 0.99)
    return max(1.0, total / (2 * near.size)) * (1 + rho) / (1 - rho)


def _directions(J: Reals) -> Reals:
    """Return an orthonormal basis of the columns of J, without directions that are rounding only."""
    felt = J[:, np.linalg.norm(J, axis=0) > 1e-6]
    if not felt.size:
        return felt
    u, size, _ = np.linalg.svd(felt / np.linalg.norm(felt, axis=0), full_matrices=False)
    return np.asarray(u[:, size > 1e-6 * size[0]], np.float64)


def _running(values: NDArray[_Number]) -> NDArray[_Number]:
    return np.concatenate([np.zeros((1, *values.shape[1:]), values.dtype), np.cumsum(values, axis=0)])
