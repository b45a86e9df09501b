"""Sherrit's non-iterative method: complex constants from the critical frequencies of one resonance.

S. Sherrit, H. D. Wiederick, B. K. Mukherjee: Ferroelectrics 134 (1992) 65 (thickness), 119 (1991) 17 (radial).
Frequencies are read on Y/w and wZ, in which the geometric capacitance has no slope of its own: f_s at the maximum of
G/w, f_p at the maximum of wR; f_plus and f_minus at the maximum and the minimum of B/w or of wX around them. For
exp(+jwt) the maximum is the lower of the two.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from scipy.special import jve

from ..base.arrays import Frequencies, Impedances, Reals
from .piezo_constants import Radial, Thickness

_SIGMA = (97.527023, -126.91730, 63.400384, -14.340444, 1.2312109)
_ETA1 = (11.2924, -7.63859, 2.13559, -0.215782)
# Polynomials in the ratio of the first two resonances; within 1.2e-4 and 7e-5 of the roots for sigma 0.2 to 0.5.


@dataclass(frozen=True)
class CriticalFrequencies:
    """Critical frequencies of one peak: its maximum and the extremes of the other component beside it, Hz."""

    top: float
    plus: float
    """At the maximum; for exp(+jwt) below `top`."""
    minus: float
    """At the minimum."""

    @property
    def complex(self) -> complex:
        """F [1 - j (f_minus - f_plus)/f]^(-1/2), Hz: its square is f^2/(1 - j/Q)."""
        return self.top / cmath.sqrt(1 - 1j * (self.minus - self.plus) / self.top)


def thickness_constants(
    fs: complex, fp: complex, thickness: float, density: float, at: tuple[float, complex], area: float
) -> Thickness:
    """Return thickness-mode constants from the complex first resonance and antiresonance (Hz).

    `thickness` m, `density` kg/m3, `area` m2; `at`: frequency (Hz) and impedance (ohm) of one point away from the
    resonance, which gives eps33S. The closed form stands for moderate loss: at Q 80 it errs by 1e-4 in c33D and
    1.5e-3 in kt^2, at Q 20 by 2e-3 and 2e-2.
    """
    kt2 = coupling_squared(fs, fp)
    c33D = 4 * density * (thickness * fp) ** 2
    frequency, Z = at
    X = math.pi / 2 * frequency / fp
    eps33S = thickness / (2j * math.pi * frequency * area * Z) * (1 - kt2 * cmath.tan(X) / X)
    return Thickness.from_coupling(c33D, cmath.sqrt(kt2), eps33S)


def coupling_squared(fs: complex, fp: complex) -> complex:
    """Return kt^2 = (pi/2)(fs/fp) tan[(pi/2)(fp - fs)/fp].

    The thesis's (2.18) leaves out fs/fp, which makes kt^2 11 % too large for Pz27.
    """
    return math.pi / 2 * fs / fp * cmath.tan(math.pi / 2 * (fp - fs) / fp)


def radial_constants(
    fs1: complex, fs2: complex, fp1: complex, eps33T: complex, radius: float, density: float
) -> Radial:
    """Return radial-mode constants from the complex first two resonances and the first antiresonance (Hz).

    `eps33T` (F/m) from a frequency far below; `radius` m, `density` kg/m3.
    """
    r = fs2 / fs1
    sigma = sum(a * r**k for k, a in enumerate(_SIGMA))
    eta1 = sum(a * r**k for k, a in enumerate(_ETA1))
    c11p = density * (2 * math.pi * radius * fs1 / eta1) ** 2
    coupling2 = (1 - sigma - bessel_quotient(eta1 * fp1 / fs1)) / 2
    eps33p = eps33T / (1 + 2 * coupling2 / (1 + sigma))
    return Radial.from_sherrit(c11p, sigma, cmath.sqrt(coupling2), eps33p)


def bessel_quotient(eta: complex) -> complex:
    """Return J(eta) = eta J0(eta)/J1(eta)."""
    at = np.array([eta], np.complex128)
    return complex((at * jve(0, at) / jve(1, at))[0])


def resonance_frequencies(frequency: Frequencies, impedance: Impedances) -> CriticalFrequencies:
    """Return the critical frequencies of the largest resonance of a clean sweep, from Y/w.

    "Clean" means without noise: the extremes are refined by parabolas through three points.
    """
    return _critical(frequency, 1 / (impedance * 2 * np.pi * frequency))


def antiresonance_frequencies(frequency: Frequencies, impedance: Impedances) -> CriticalFrequencies:
    """Return the critical frequencies of the largest antiresonance of a clean sweep, from wZ."""
    return _critical(frequency, impedance * 2 * np.pi * frequency)


def _critical(frequency: Frequencies, curve: Impedances) -> CriticalFrequencies:
    top = int(np.argmax(curve.real))
    reach = _half_width(curve.real, top)
    low, high = max(0, top - 3 * reach), min(frequency.size, top + 3 * reach + 1)
    plus = low + int(np.argmax(curve.imag[low : top + 1]))
    minus = top + int(np.argmin(curve.imag[top:high]))
    return CriticalFrequencies(
        _refined(frequency, curve.real, top),
        _refined(frequency, curve.imag, plus),
        _refined(frequency, -curve.imag, minus),
    )


def _half_width(values: Reals, top: int) -> int:
    """Return the number of points below the peak until its value has fallen to half."""
    below = np.flatnonzero(values[:top] < values[top] / 2)
    return top - int(below[-1]) if below.size else max(1, top)


def _refined(frequency: Frequencies, values: Reals, k: int) -> float:
    """Return the vertex of a parabola through the maximum and its neighbours; the point itself at an end."""
    if not 0 < k < values.size - 1:
        return float(frequency[k])
    back, ahead = frequency[k - 1] - frequency[k], frequency[k + 1] - frequency[k]
    rise_back, rise_ahead = (values[k - 1] - values[k]) / back, (values[k + 1] - values[k]) / ahead
    bend = (rise_ahead - rise_back) / (ahead - back)  # the parabola is rise s + bend s^2
    return float(frequency[k] - (rise_back - bend * back) / (2 * bend))
