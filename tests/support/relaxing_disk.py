"""The thesis's disk with a permittivity that relaxes, which no effect of the catalogue describes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.interface import FitTask
from pzctl.models.stack import Piezo, Stack
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
F = np.linspace(1.5e6, 7.5e6, 151)
NOISE = 2e-4


def recorded(Z: np.ndarray, f: np.ndarray = F, noise: float = NOISE) -> FitTask:
    """Return the task of a sweep of the disk with noise."""
    random = np.random.default_rng(3)
    noisy = Z * np.exp(noise * (random.normal(size=f.size) + 1j * random.normal(size=f.size)))
    return FitTask(BUILD, {"disk": (Sweep(f, noisy),)})


def relaxing(stack: Stack, strength: float, at: float, f: np.ndarray = F) -> np.ndarray:
    """Return the impedance of the disk with a permittivity that relaxes, ohm, shape (N,)."""
    return with_permittivity(stack, lambda at_one: strength / (1 + 1j * at_one / at), f)


def with_permittivity(stack: Stack, change: Callable[[float], complex], f: np.ndarray = F) -> np.ndarray:
    """The disk, computed separately at each frequency with its permittivity there; no law of the library is used."""
    disk = next(layer for layer in stack.layers if isinstance(layer, Piezo))

    def there(at_one: float) -> Stack:
        eps = disk.eps33S * (1 + change(at_one))
        return replace(stack, layers=tuple(replace(one, eps33S=eps) if one is disk else one for one in stack.layers))

    return np.array([there(one).impedance(np.array([one]))[0] for one in f])
