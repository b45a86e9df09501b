"""Poles of a recording by vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14 (1999) 1052).

Poles begin spread over the band, more than needed, and move all at once to the zeros of a weighting function, so that
one sharp resonance gets one pole. One-by-one search puts several poles that cancel each other at a resonance sharper
than its grid, and such poles do not drift as resonances do. Poles that do not pay for their numbers are then removed.
"""

from dataclasses import replace

import numpy as np

from ....models.base.arrays import Complexes, Reals
from .pole_fit import MOST_POLES, Frame, PoleFit, linear_fit, refined, stacked

_START, _WIDTH, _BEYOND = 16, 0.01, 1.1
"""Number of starting poles, their half width over their frequency, and how far beyond the band they lie."""
_ROUNDS, _SETTLED = 12, 1e-3
"""Most relocations, and the largest movement (half widths) that ends them."""
_PAYS = 40.0
"""Smallest decrease of chi2, in units of chi2 per degree of freedom, that justifies a pole (4 numbers)."""
_NARROWEST = 0.05
"""Half width of the narrowest pole in steps of the frequency grid: the wings of an unresolved resonance show its
strength, and its width hardly matters."""


def vector_fitted(frame: Frame, start: Complexes | None = None) -> PoleFit:
    """Return the poles that a recording justifies; the search begins at those in `start` as well."""
    low, high = float(frame.s[0].imag) / _BEYOND, float(frame.s[-1].imag) * _BEYOND
    places: Reals = low * (high / low) ** (np.arange(_START) / (_START - 1))
    poles: Complexes = np.asarray(places * (1j - _WIDTH), np.complex128)
    if start is not None and start.size:
        poles = np.concatenate([start, _apart(poles, start)])
    for _ in range(_ROUNDS):
        moved = relocated(frame, poles)
        same = moved.size == poles.size
        step = np.max(np.abs(moved - poles) / -moved.real) if same and moved.size else np.inf
        poles = moved
        if step < _SETTLED:
            break
    return _pruned(refined(linear_fit(frame, poles)))


def _apart(poles: Complexes, others: Complexes) -> Complexes:
    """Return the poles that are not within the widths of others."""
    gap = np.abs(poles.imag[:, None] - others.imag) + 3 * others.real
    return poles[np.min(gap, axis=1) > 0]


def relocated(frame: Frame, poles: Complexes) -> Complexes:
    """Return poles at the zeros of sigma = 1 + sum c/(s - p), where sigma Y has the poles `poles`."""
    if not poles.size:
        return poles
    up, down = 1 / (frame.s[:, None] - poles), 1 / (frame.s[:, None] - np.conj(poles))
    width = -poles.real
    basis = np.stack([(up + down) * width, 1j * (up - down) * width], axis=2).reshape(frame.s.size, -1)
    known = np.hstack([frame.ground, stacked(basis * frame.weight[:, None])])
    sigma, aim = stacked(-basis * frame.inverse[:, None]), stacked(np.asarray(frame.inverse, np.complex128))
    scale = np.linalg.norm(known, axis=0)
    q, _ = np.linalg.qr(known / np.where(scale > 0, scale, 1.0))
    sigma, aim = sigma - q @ (q.T @ sigma), aim - q @ (q.T @ aim)
    c = np.linalg.lstsq(sigma, aim, rcond=1e-12)[0] * np.repeat(width, 2)
    blocks = np.diag(np.repeat(poles.real, 2))
    upper, lower = np.arange(0, 2 * poles.size, 2), np.arange(1, 2 * poles.size, 2)
    blocks[upper, lower], blocks[lower, upper] = poles.imag, -poles.imag
    zeros = np.asarray(np.linalg.eigvals(blocks - np.outer(np.tile([2.0, 0.0], poles.size), c)), np.complex128)
    return _stable(frame, np.asarray(zeros[zeros.imag > 0], np.complex128))


def _stable(frame: Frame, poles: Complexes) -> Complexes:
    """Return poles in the left half plane, none narrower than the narrowest."""
    least = np.interp(poles.imag, frame.s.imag, frame.least_width)
    return np.asarray(-np.maximum(np.abs(poles.real), least) + 1j * poles.imag, np.complex128)


def _pruned(fit: PoleFit) -> PoleFit:
    """Return the fit without the poles that do not pay, the least useful removed first."""
    while fit.poles.size:
        losses = losses_without(fit)
        k = int(np.argmin(losses))
        pays = _PAYS * max(1.0, fit.chi2_per_dof)
        if losses[k] > 4 * pays and fit.poles.size <= MOST_POLES:
            break
        trial = refined(linear_fit(fit.frame, np.delete(fit.poles, k)))
        if trial.cost - fit.cost > pays and fit.poles.size <= MOST_POLES:
            break
        fit = trial
    return fit


def losses_without(fit: PoleFit) -> Reals:
    """Return by how much chi2 grows if one pole is removed and only the linear coefficients are fitted again."""
    frame, poles = fit.frame, fit.poles
    up, down = 1 / (frame.s[:, None] - poles), 1 / (frame.s[:, None] - np.conj(poles))
    weight = -poles.real * frame.weight[:, None]
    columns = np.hstack([stacked((up + down) * weight), stacked(1j * (up - down) * weight)])
    columns = columns - frame.ground @ (frame.ground.T @ columns)
    inverse = np.linalg.pinv(columns.T @ columns, rcond=1e-13, hermitian=True)
    x = np.concatenate([fit.residues.real, fit.residues.imag])
    count = poles.size
    made = np.empty(count)
    for k in range(count):
        own = [k, k + count]
        made[k] = x[own] @ np.linalg.pinv(inverse[np.ix_(own, own)]) @ x[own]
    return made


def frame_for_poles(frame: Frame) -> Frame:
    """Return a frame in which poles may be narrower than the grid resolves."""
    return replace(frame, narrowest=_NARROWEST)
