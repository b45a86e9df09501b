"""The thesis's disk with a permittivity that relaxes, which no effect of the catalogue describes."""

from dataclasses import replace

import numpy as np

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.interface import FitTask
from pzctl.models.stack import Piezo, Stack
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
F = np.linspace(1.5e6, 7.5e6, 301)
NOISE = 2e-4


def recorded(Z: np.ndarray) -> FitTask:
    """Return the task of a sweep of the disk with noise."""
    random = np.random.default_rng(3)
    noisy = Z * np.exp(NOISE * (random.normal(size=F.size) + 1j * random.normal(size=F.size)))
    return FitTask(BUILD, {"disk": (Sweep(F, noisy),)})


def relaxing(stack: Stack, strength: float, at: float) -> np.ndarray:
    """The disk, computed separately at each frequency with its permittivity there; no law of the library is used."""
    disk = next(layer for layer in stack.layers if isinstance(layer, Piezo))
    return np.array(
        [
            replace(
                stack,
                layers=tuple(
                    replace(layer, eps33S=disk.eps33S * (1 + strength / (1 + 1j * f / at))) if layer is disk else layer
                    for layer in stack.layers
                ),
            ).impedance(np.array([f]))[0]
            for f in F
        ]
    )
