"""Accuracy and noise of the 4294A as functions of |Z|, frequency, bandwidth and level (reference 8.2, 8.3).

E[%] = Ep' + 100 (Zs'/|Z| + Yo' |Z|) bounds the systematic error; repeatability is 10 to 30 times better.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals

NOISE = 4e-5 * 5.0 ** (np.arange(4, -1, -1) / 4)
"""Relative complex noise per point by BWFACT 1 to 5: 2e-4 falling to 4e-5, as measured on real exports."""

_BAND_EDGES = np.array([100.0, 800.0, 200e3, 1e6, 15e6])
_YO = np.array([10e-9, 2.5e-9, 2.5e-9, 5e-9, 50e-9, 500e-9])
_ZS = np.array([10e-3, 2.5e-3, 2.5e-3, 2.5e-3, 2.5e-3, 2.5e-3])
_EP = np.array([0.5, 0.3, 0.075, 0.075, np.nan, 1.5])
_EP_BANDWIDTH_HIGH = np.array([0.4, 0.2, 0.1, 0.03, 0.0])
_EP_BANDWIDTH_LOW = np.array([0.8, 0.4, 0.2, 0.06, 0.0])
_K_BANDWIDTH_HIGH = np.array([10.0, 5.0, 4.0, 1.0, 1.0])
_K_BANDWIDTH_LOW = np.array([6.0, 4.0, 3.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Terms:
    """The three terms of the accuracy formula, each of shape (N,)."""

    proportional: Reals
    """Ep', percent."""
    series: Reals
    """Zs', ohm."""
    parallel: Reals
    """Yo', S."""
    level_factor: Reals
    """Kzosc: factor by which the level increases the error of small impedances and the noise; 1 at 0.5 V."""

    def percent(self, z: Impedances) -> Reals:
        """Return E in percent at impedances of shape (N,)."""
        size = np.maximum(np.abs(z), 1e-12)
        return self.proportional + 100 * (self.series / size + self.parallel * size)


def terms(frequency: Frequencies, bandwidth: Reals, level_V: Reals) -> Terms:
    """Return the accuracy terms at frequencies (Hz), BWFACT and oscillator level (V), each of shape (N,)."""
    band = np.searchsorted(_BAND_EDGES, frequency, side="left")
    index = bandwidth.astype(int) - 1
    ep = np.where(band == 4, 0.1 * frequency / 1e6, _EP[band])
    ep_bandwidth = np.where(frequency >= 50e3, _EP_BANDWIDTH_HIGH[index], _EP_BANDWIDTH_LOW[index])
    k_bandwidth = np.where(frequency > 1e6, _K_BANDWIDTH_HIGH[index], _K_BANDWIDTH_LOW[index])
    ep_level, ky, kz = _level_terms(frequency, ep_bandwidth, level_V)
    return Terms(ep_bandwidth + ep_level + ep, k_bandwidth * kz * _ZS[band], k_bandwidth * ky * _YO[band], kz)


def _level_terms(frequency: Frequencies, ep_bandwidth: Reals, level: Reals) -> tuple[Reals, Reals, Reals]:
    """Return Eposc (percent), Kyosc and Kzosc."""
    above = [level > 0.5, level > 0.25, level > 0.125, level > 0.064]
    ep = [
        0.03 * (1 / level - 1) + frequency / 1e8,
        0.03 * (0.5 / level - 1),
        0.03 * (0.25 / level - 1),
        0.03 * (0.125 / level - 1),
    ]
    lowest = (0.03 + ep_bandwidth) * (0.064 / level - 1)
    ky = [1 / level, 0.5 / level, 0.5 / level, 0.5 / level]
    kz = [2 * np.ones_like(level), 0.5 / level, 0.25 / level, 0.125 / level]
    return np.select(above, ep, lowest), np.select(above, ky, 0.5 / level), np.select(above, kz, 0.064 / level)


def noise_sigma(z: Impedances, frequency: Frequencies, bandwidth: Reals, level_V: Reals, averages: Reals) -> Reals:
    """Return the standard deviation of the relative complex noise per point, shape (N,).

    It grows with the level factor, and where the terms Zs'/|Z| and Yo'|Z| exceed the proportional term.
    """
    t = terms(frequency, bandwidth, level_V)
    size = np.maximum(np.abs(z), 1e-12)
    flat = np.maximum(t.proportional, 0.075) / 100
    extremes = np.hypot(1.0, np.hypot(t.series / size, t.parallel * size) / flat)
    index: NDArray[np.int_] = bandwidth.astype(int) - 1
    return NOISE[index] * t.level_factor * extremes / np.sqrt(averages)


def noisy(z: Impedances, sigma: Reals, random: np.random.Generator) -> Impedances:
    """Return impedances with relative complex noise of total standard deviation `sigma`."""
    return z * (1 + sigma / np.sqrt(2) * (random.standard_normal(z.shape) + 1j * random.standard_normal(z.shape)))


def systematic(z: Impedances, t: Terms, direction: Complexes) -> Impedances:
    """Return impedances with the systematic error of this instrument: at most E, the same in every sweep.

    An error of gain and phase, an impedance that remains in series, and an admittance that remains in parallel.
    `direction`, shape (3,), is the fraction of each term that this instrument errs by; each has magnitude at most 1.
    """
    safe = np.where(np.abs(z) < 1e-12, 1e-12, z)
    error = direction[0] * t.proportional / 100 + direction[1] * t.series / safe + direction[2] * t.parallel * safe
    return z * (1 + error)
