"""Array types whose names state content and unit."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Frequencies: TypeAlias = NDArray[np.float64]
"""Frequency in Hz, shape (N,)."""

Impedances: TypeAlias = NDArray[np.complex128]
"""Complex electrical impedance in ohm, shape (N,)."""

Reals: TypeAlias = NDArray[np.float64]
"""Real numbers; the docstring says unit and shape."""

Complexes: TypeAlias = NDArray[np.complex128]
"""Complex numbers; the docstring says unit and shape."""


def j_omega(frequency: Frequencies) -> Complexes:
    """Return j 2 pi f in 1/s, shape (N,), for frequencies in Hz, shape (N,)."""
    return np.multiply(2j * np.pi, frequency, dtype=np.complex128)


def complex_log(values: Complexes) -> Complexes:
    """Return ln of complex numbers, imaginary part in (-pi, pi].

    Uses real functions, which NumPy vectorises; np.log of complex numbers took a quarter of a fit.
    """
    logarithm = np.empty(values.shape, np.complex128)
    logarithm.real = 0.5 * np.log(values.real**2 + values.imag**2)
    logarithm.imag = np.arctan2(values.imag, values.real)
    return logarithm


def softened(damping: float) -> complex:
    """Return what multiplies a stiffness that acts at a real frequency f as its own does at f (1 - j damping/2).

    All resonances have a loss tangent that is larger by `damping`, but for its third power.
    """
    return 1 / (1 - 0.5j * damping) ** 2
