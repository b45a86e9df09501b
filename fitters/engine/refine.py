"""Refinement of a rough start to the minimum of a free plate, in two or three Newton steps."""

from dataclasses import replace

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Reals
from ...models.sweep import Sweep
from .recording import along_curve, log_ratio
from .start import DiskStart

_STEPS, _STILL = 5, 1e-6


def refined(start: DiskStart, sweep: Sweep, thickness: float, density: float, area: float) -> DiskStart:
    """Return the constants of the nearest free plate, or the start itself if that is no improvement.

    SI units. A free plate has jw Z A/t = 1/eps33S - (h33^2/c33D) tan(X)/X, X = pi t f sqrt(density/c33D): linear in two
    complex numbers, holomorphic in the third. Multiplied by X cos X it has no poles, so that Newton steps for all three
    (weighted as ln Z, with the last step's weight) converge from where those of tan X would not.
    """
    at = along_curve(sweep.impedance)
    f, Z = sweep.frequency[at], sweep.impedance[at]
    y = np.asarray(2j * np.pi * area / thickness * f * Z, np.complex128)
    solution = np.array([0.0, 0.0, np.pi * thickness * np.sqrt(density / start.c33D)], np.complex128)
    try:
        with np.errstate(all="ignore"):
            for k in range(_STEPS):
                step = _step(y, f, solution, slice(0, 2 if k == 0 else 3))
                solution = solution + step
                if k and abs(step[2] / solution[2]) < _STILL:
                    break
    except np.linalg.LinAlgError:
        return start
    inverse_eps, ratio, s = solution.tolist()
    c33D = density * (np.pi * thickness / s) ** 2
    candidate = replace(start, c33D=c33D, h33=complex(np.sqrt(ratio * c33D)), eps33S=1 / inverse_eps)
    misfits = [_misfit(trial, y, f, thickness, density) for trial in (start, candidate)]
    return replace(candidate, misfit=misfits[1]) if misfits[1] < misfits[0] and _possible(candidate) else start


def _step(y: Complexes, f: Frequencies, at: Complexes, moving: slice) -> Complexes:
    """Return the Gauss-Newton step of (1/eps33S, h33^2/c33D, X/f), shape (3,); zero for those that are held."""
    X = at[2] * f
    cos, sin = np.cos(X), np.sin(X)
    weight: Reals = 1 / np.abs(y * X * cos)
    by = np.stack([-X * cos, sin, f * ((y - at[0]) * (cos - X * sin) + at[1] * cos)]) * weight
    rest = ((y - at[0]) * X * cos + at[1] * sin) * weight
    J = by[moving]
    step = np.zeros(3, np.complex128)
    step[moving] = np.linalg.solve(J.conj() @ J.T, -J.conj() @ rest)
    return step


def _misfit(start: DiskStart, y: Complexes, f: Frequencies, thickness: float, density: float) -> float:
    """Return the median of |ln(Z_model/Z)|."""
    X = np.asarray(np.pi * thickness * f * np.sqrt(density / start.c33D), np.complex128)
    model = 1 / start.eps33S - start.h33**2 / start.c33D * np.tan(X) / X
    return float(np.median(np.abs(log_ratio(model, y))))


def _possible(start: DiskStart) -> bool:
    """Return whether a passive material can have these constants."""
    return start.c33D.real > 0 and start.c33D.imag > 0 and start.eps33S.real > 0 and start.eps33S.imag < 0
