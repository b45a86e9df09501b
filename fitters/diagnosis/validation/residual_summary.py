"""Summary of the residual after all findings: its bands, resonances that would describe it, and its texture.

Three descriptions, none of which names physics: a scan for bands with more than noise; a matched scan for pole pairs,
orthogonal to the free parameters; and a Gaussian process (Matern 5/2; Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001)
425) with its standard deviation and correlation length.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import orth

from ....models.base.arrays import Complexes, Reals
from ...engine.recording import Recording
from ..findings import Leftover, Pole, Texture
from ..search.refit import Refit
from .whiteness_tests import uneven

_MOST_BANDS, _MOST_POLES = 5, 3
_PLACES, _QUALITIES = 60, (10.0, 30.0, 100.0, 300.0)
_POLE_PAYS = 30.0
_POLE_TAKES = 0.2
"""Smallest part of the excess over noise that a reported pole must explain."""
_TEXTURE = 0.1
"""Excess of chi2 per point above which the texture is described."""


@dataclass(frozen=True, eq=False)
class _Rest:
    """Residuals of one recording in units of its noise, and the tangent space of the free parameters."""

    recording: Recording
    residual: Complexes
    """ln(Z_model/Z) over noise, shape (N,)."""
    tangent: Reals
    """Orthonormal columns, shape (2N, M)."""


def remainder(found: Refit) -> Leftover:
    """Return a description of the residual of a fit; takes a few milliseconds per recording."""
    rests = _rests(found)
    bands = sorted((band for rest in rests for band in _bands(rest)), key=lambda one: -one[0])
    worst = max(rests, key=lambda rest: _excess(rest.residual))
    return Leftover(
        bands_Hz=tuple(band for _, band in bands[:_MOST_BANDS]),
        chi2_per_dof=found.chi2_per_dof,
        step=worst.recording.step,
        poles=tuple(_poles(worst)) if bands else (),
        texture=_texture(worst) if bands else None,
    )


def _rests(found: Refit) -> list[_Rest]:
    objective, x = found.objective, found.descent.x
    J, ratios = objective.jacobian(x), objective.log_ratios(x)
    rests: list[_Rest] = []
    at = 0
    for recording, ratio in zip(objective.recordings, ratios, strict=True):
        n = ratio.size
        rows = J[at : at + 2 * n] * np.tile(recording.sigma / recording.noise, 2)[:, None]
        size = np.linalg.norm(rows, axis=0)
        felt = rows[:, size > 0] / size[size > 0]
        tangent = np.asarray(orth(felt, 1e-8), np.float64)
        rests.append(_Rest(recording, ratio / recording.noise, tangent))
        at += 2 * n
    return rests


def _excess(residual: Complexes) -> float:
    """Return the sum of squares beyond its expectation from noise."""
    return float(np.sum(np.abs(residual) ** 2)) - 2 * residual.size


def _bands(rest: _Rest) -> list[tuple[float, tuple[float, float]]]:
    """Return disjoint stretches with more than noise, each with the logarithm of its likelihood ratio."""
    f = rest.recording.sweep.frequency
    return [(ratio, (float(f[a]), float(f[b - 1]))) for ratio, a, b in uneven(rest.residual, _MOST_BANDS)]


def _poles(rest: _Rest) -> list[Pole]:
    """Return up to three resonances that explain much of the residual, largest decrease first."""
    residual, tangent, found = rest.residual, rest.tangent, list[Pole]()
    before = _excess(residual)
    for _ in range(_MOST_POLES):
        pole, columns, takes = _best_pole(rest, residual, tangent)
        if takes < max(_POLE_PAYS, _POLE_TAKES * before):
            break
        found.append(pole)
        tangent = np.hstack([tangent, columns])
        r = np.concatenate([residual.real, residual.imag])
        r = r - tangent @ (tangent.T @ r)
        residual = r[: residual.size] + 1j * r[residual.size :]
    return found


def _best_pole(rest: _Rest, residual: Complexes, tangent: Reals) -> tuple[Pole, Reals, float]:
    f = rest.recording.sweep.frequency
    places = f[np.linspace(0, f.size - 1, _PLACES).astype(np.intp)]
    grid = list(product(places.tolist(), _QUALITIES))
    f_k, q, _ = max(((f, q, _takes(rest, residual, tangent, f, q)[0]) for f, q in grid), key=lambda one: one[2])
    spacing = float(places[1] - places[0]) / f_k
    finer = product(f_k * (1 + np.linspace(-1, 1, 17) * min(spacing, 0.1)), q * np.geomspace(0.4, 2.5, 7))
    f_k, q, _ = max(((f, q, _takes(rest, residual, tangent, f, q)[0]) for f, q in finer), key=lambda one: one[2])
    takes, columns, capacitance = _takes(rest, residual, tangent, f_k, q)
    return Pole(float(f_k), float(q), abs(capacitance), takes), columns, takes


def _takes(rest: _Rest, residual: Complexes, tangent: Reals, f_k: float, q: float) -> tuple[float, Reals, complex]:
    """Return the decrease of chi2 by a pole, its orthonormal columns, and its complex capacitance in F."""
    sweep = rest.recording.sweep
    x = sweep.frequency / f_k
    branch = 2j * np.pi * sweep.frequency / (1 - x**2 + 1j * x / q)
    # a parallel branch changes ln Z by -Z Y, so ln(Z_model / Z) of a model without it contains +Z Y
    shape = sweep.impedance * branch / rest.recording.noise
    columns = np.stack([np.concatenate([c.real, c.imag]) for c in (shape, 1j * shape)], axis=1)
    outside = columns - tangent @ (tangent.T @ columns)
    if float(np.min(np.linalg.norm(outside, axis=0) / np.linalg.norm(columns, axis=0))) < 1e-4:
        return 0.0, columns, 0j
    basis, r = np.linalg.qr(outside)
    along = basis.T @ np.concatenate([residual.real, residual.imag])
    size = np.linalg.solve(r, along)
    return float(along @ along), basis, complex(size[0], size[1])


def _texture(rest: _Rest) -> Texture | None:
    """Fit standard deviation and correlation length of a Gaussian process to the autocovariance of the residual.

    Lag zero, which contains the noise, is left out; the correlation length is searched on a grid.
    """
    ratio = rest.residual * rest.recording.noise
    if _excess(rest.residual) < _TEXTURE * 2 * ratio.size:
        return None
    f = rest.recording.sweep.frequency
    lags = np.unique(np.geomspace(1, f.size // 3, 24).astype(np.intp))
    covariance = np.array([float(np.real(np.mean(ratio[lag:] * np.conj(ratio[:-lag])))) / 2 for lag in lags])
    distance = lags * float(f[-1] - f[0]) / (f.size - 1)
    best, texture = np.inf, None
    longest = distance[-1] / distance[0]
    for length in (distance[0] / 2 * (2 * longest) ** (np.arange(40) / 39)).tolist():
        model = _matern(distance / length)
        variance = max(0.0, float(model @ covariance) / float(model @ model))
        left = float(np.sum((covariance - variance * model) ** 2))
        if left < best and variance > 0:
            best, texture = left, Texture(float(np.sqrt(variance)), float(length))
    return texture


def _matern(d: Reals) -> Reals:
    """Return the Matern 5/2 correlation at distances in correlation lengths."""
    r = np.sqrt(5) * d
    return (1 + r + r**2 / 3) * np.exp(-r)


def in_words(left: Leftover) -> str:
    """Return a sentence that describes the residual."""
    said: list[str] = []
    if left.bands_Hz:
        low, high = left.bands_Hz[0]
        said.append(f"most of it lies from {low / 1e6:.4g} to {high / 1e6:.4g} MHz")
    if left.texture is not None:
        size, length = 100 * left.texture.amplitude, left.texture.length_Hz / 1e3
        said.append(f"it amounts to {size:.2g} % and changes over {length:.3g} kHz")
    if left.poles:
        pole = left.poles[0]
        said.append(f"a resonance at {pole.frequency_Hz / 1e6:.4g} MHz with Q {pole.q:.2g} would explain much of it")
    return f"Residual of {left.step}: {'; '.join(said)}." if said else ""
