"""The resonant factor of radial motion, with exact derivatives, for complex arguments."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from ..base.arrays import Complexes


@dataclass(frozen=True, eq=False)
class RadialResonance:
    """F = 1/(J(eta) - 1 + sigma) with J(eta) = eta J0(eta)/J1(eta); all of shape (N,)."""

    F: Complexes
    by_log_eta: Complexes
    """dF/d ln eta."""
    by_sigma: Complexes
    """dF/d sigma."""

    @classmethod
    def at(cls, eta: Complexes, sigma: Complexes) -> Self:
        """Evaluate at complex arguments: finite where J1 vanishes, and without overflow however lossy the disk is."""
        from scipy.special import jve  # a third of a simulator's start, for a motion that few of its devices have

        J0, J1 = jve(0, eta), jve(1, eta)  # both scaled by exp(-|Im eta|), which cancels below
        denominator = eta * J0 - (1 - sigma) * J1
        F = np.divide(J1, denominator, dtype=np.complex128)
        # dJ/d ln eta = 2 J - J^2 - eta^2, from J0' = -J1 and J1' = J0 - J1/eta
        by_log_eta = (eta**2 * (J0**2 + J1**2) - 2 * eta * J0 * J1) / denominator**2
        return cls(F, by_log_eta.astype(np.complex128), -(F**2))
