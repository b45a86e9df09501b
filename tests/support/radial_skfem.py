"""Recordings of the radial modes of a disk of the tests' own ceramic, solved by finite elements."""

import numpy as np
from complex_ceramic import TENSOR
from disk_skfem import SkfemDisk

from pzctl.models.base.arrays import Frequencies, Impedances
from pzctl.models.constants.causal import continued
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep


def solved(sizes: tuple[float, float, float], f: Frequencies) -> Impedances:
    """Return Z of a disk of finite thickness, by a package that shares no code with the project's models."""
    law = CausalConstantQ(220e3)
    over = np.array([continued(law, complex(getattr(TENSOR, name)), f)[0] for name in CONSTANTS]).T
    diameter, thickness, density = sizes
    disk = SkfemDisk(diameter / 2e3, thickness / 1e3, 1)
    return 1 / (2j * np.pi * f * disk.capacitance(over, density, f))


def recorded(f: Frequencies, Z: Impedances, seed: int, noise: float = 2e-4) -> Sweep:
    """Return the sweep with noise."""
    rng = np.random.default_rng(seed)
    return Sweep(f, Z * np.exp(noise * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))))
