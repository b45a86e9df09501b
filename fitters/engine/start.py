"""Starting values from the recording itself: resonance, antiresonance, low-frequency capacitance."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Reals
from ...models.base.local_maxima import prominent_peaks
from ...models.sweep import Sweep
from ..interface import FitError
from .noise import noise_of

_CANDIDATES = 6
_COMBINED = 5
# Largest peaks of G/w and of wR that are tried as resonance and antiresonance. Lateral modes cause a few false ones;
# the thickness pair was among the six largest in every recording tried.
_ABOVE_NOISE = 10.0
# Smallest height of a peak in standard deviations; the largest of a thousand noise peaks reaches about five.
_LARGEST_RATIO = 1.6
# fp/fs of the fundamental is 1.28 at kt = 0.7, above every known material; the rest allows for lateral modes.
_QUALITIES = np.array([8.0, 25.0, 80.0, 250.0])
_ENOUGH = 200
# Points for comparing guesses; more do not change the choice.


@dataclass(frozen=True)
class DiskStart:
    """Thickness-mode constants estimated from one resonance pair, with their misfit."""

    fs: float
    fp: float
    c33D: complex
    h33: complex
    eps33S: complex
    misfit: float
    """Median of |ln(Z_model/Z_measured)|, which is insensitive to ripple on part of the band."""

    def parameters(self, layer: str) -> dict[str, float]:
        """Return the model parameters of this layer."""
        constants = {"c33D": self.c33D, "h33": self.h33, "eps33S": self.eps33S}
        return {
            f"{layer}.{name}.{part}": getattr(value, attribute)
            for name, value in constants.items()
            for part, attribute in (("re", "real"), ("im", "imag"))
        }


def largest_peaks(values: Reals, noise: Reals) -> list[int]:
    """Return the indices of the most prominent interior maxima above the noise, largest first."""
    peaks, prominences = prominent_peaks(values, _ABOVE_NOISE * noise)
    order = np.argsort(prominences)[::-1][:_CANDIDATES]
    return [int(k) for k in peaks[order]]


def resonance_pairs(sweep: Sweep) -> list[tuple[float, float]]:
    """Return candidates (fs, fp) in Hz: maxima of G/w and of wR, which the geometric capacitance does not shift.

    S. Sherrit et al., Ferroelectrics 134 (1992) 65.
    """
    w = 2 * np.pi * sweep.frequency
    _, (noise,) = noise_of([sweep])
    series = sweep.frequency[largest_peaks(sweep.admittance.real / w, noise * np.abs(sweep.admittance) / w)]
    parallel = sweep.frequency[largest_peaks(sweep.impedance.real * w, noise * np.abs(sweep.impedance) * w)]
    return [(fs, fp) for fs, fp in product(series, parallel) if fs < fp < _LARGEST_RATIO * fs]


def _free_plates(frequency: Frequencies, fp: Reals, kt2: Reals) -> Complexes:
    """Return jwC0 Z of free plates: 1 - kt^2 tan X / X, X = (pi/2) f/fp, with c33D (1 + j/Q), shape (P, Q, N)."""
    per_Hz = np.pi / 2 / (fp[:, None] * np.sqrt(1 + 1j / _QUALITIES))
    X = np.asarray(per_Hz[..., None] * frequency, np.complex128)
    return 1 - kt2[:, None, None] * np.tan(X) / X


def coupling_squared(fs: float, fp: float) -> float:
    """Return kt^2 = (pi/2)(fs/fp) tan[(pi/2)(fp - fs)/fp] (IEEE Std 176-1987)."""
    return float(np.pi / 2 * fs / fp * np.tan(np.pi / 2 * (fp - fs) / fp))


def disk_starts(sweep: Sweep, thickness: float, density: float, area: float) -> list[DiskStart]:
    """Return starting constants of a free disk, best first. SI units.

    Every pair of a resonance and an antiresonance is tried with a few qualities; the permittivity follows from the
    level of the whole curve. Raises FitError if the sweep shows no such pair.
    """
    few = slice(None, None, max(1, sweep.frequency.size // _ENOUGH))
    f, Z = sweep.frequency[few], sweep.impedance[few]
    level = thickness / (2j * np.pi * f * area * Z)
    starts: list[DiskStart] = []
    pairs = resonance_pairs(sweep)
    kt2s = [coupling_squared(fs, fp) for fs, fp in pairs]
    ratio = level * _free_plates(f, np.array([fp for _, fp in pairs]), np.array(kt2s))
    eps, angle = np.median(np.abs(ratio), axis=-1), np.median(np.angle(ratio), axis=-1)
    permittivity = eps * (1 - 1j * np.clip(-angle, 1e-3, 0.3))
    misfits = np.median(np.abs(np.log(ratio / permittivity[..., None])), axis=-1)
    for (fs, fp), kt2, permittivities, of_pair in zip(
        pairs, kt2s, permittivity.tolist(), misfits.tolist(), strict=True
    ):
        c = density * (2 * thickness * fp) ** 2
        for Q, eps33S, misfit in zip(_QUALITIES.tolist(), permittivities, of_pair, strict=True):
            h33 = complex(np.sqrt(kt2 * c / eps33S.real))
            starts.append(DiskStart(fs, fp, c * (1 + 1j / Q), h33, eps33S, misfit))
    if not starts:
        f = sweep.frequency
        raise FitError(
            f"{sweep.name or 'the recording'} shows no resonance with an antiresonance above it between "
            f"{f[0] / 1e6:.4g} and {f[-1] / 1e6:.4g} MHz; a band that holds at least one pair is needed"
        )
    return sorted(starts, key=lambda start: start.misfit)


def distinct(starts: list[DiskStart], count: int) -> list[DiskStart]:
    """Return the best start of each of the first `count` resonance pairs."""
    best: dict[tuple[float, float], DiskStart] = {}
    for start in starts:
        best.setdefault((start.fs, start.fp), start)
    return list(best.values())[:count]


def spread_starts(
    nominal: Mapping[str, float], uncertainty: Mapping[str, float], names: list[str]
) -> list[dict[str, float]]:
    """Return starts for passive layers: nominal, and one and a half uncertainties to either side of each name.

    Every combination is made, so three names give 27; of more than five, one changes at a time.
    """
    if len(names) > _COMBINED:
        single = (spread_starts(nominal, uncertainty, [name])[1:] for name in names)
        middle = {name: nominal[name] for name in names}
        return [middle, *(middle | one for starts in single for one in starts)]
    grids = [nominal[name] * np.exp(np.array([0.0, -1.5, 1.5]) * uncertainty[name] / nominal[name]) for name in names]
    return [dict(zip(names, map(float, values), strict=True)) for values in product(*grids)]
