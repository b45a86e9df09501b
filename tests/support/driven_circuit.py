"""A circuit whose branch softens and loses by its amplitude, at any drive level."""

import numpy as np

from pzctl.models.sweep import Sweep

F = np.linspace(0.9e6, 1.2e6, 81)
W = 2 * np.pi * F
CLAMPED, PEAK, Q = 5e-10, 1.02e6, 60.0


def noisy(f: np.ndarray, Z: np.ndarray, volt: float, seed: int) -> Sweep:
    """Return a recording of this impedance with the noise and the gain error of a bench."""
    rng = np.random.default_rng(seed)
    noise = 1e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
    return Sweep(f, Z * np.exp(noise + 1e-3 * rng.normal()), settings={"oscillator_V": volt})


def driven(volt: float, soft: float, lossy: float) -> tuple[np.ndarray, float]:
    """Return the impedance of a circuit whose branch softens and loses by its charge's voltage, and the largest one."""
    C = 0.08 * CLAMPED
    L = 1 / ((2 * np.pi * PEAK) ** 2 * C)
    R = 2 * np.pi * PEAK * L / Q
    over = np.zeros(F.size)
    for _ in range(500):
        z = R * (1 + lossy * over) + 1j * W * L + (1 - soft * over) / (1j * W * C)
        over = 0.7 * over + 0.3 * volt / np.abs(z) / (W * C)
    return 1 / (1j * W * CLAMPED * (1 - 0.01j) + 1 / z), float(over.max())
