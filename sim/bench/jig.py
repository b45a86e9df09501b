"""The fixture between the analyzer and the device: Z = R + j w L + (device parallel to C and G) (reference 8.5)."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Impedances

OPEN = 1e-15
"""Admittance of an empty fixture, S; it keeps 1/Y finite."""


@dataclass(frozen=True)
class Jig:
    """Residuals of the fixture, in SI."""

    resistance: float = 0.0
    """Series, ohm."""
    inductance: float = 0.0
    """Series, H."""
    capacitance: float = 0.0
    """Parallel, F."""
    conductance: float = 0.0
    """Parallel, S."""

    def through(self, frequency: Frequencies, admittance: Complexes) -> Impedances:
        """Return the impedance seen through the fixture, shape (N,), for a device of this admittance (S)."""
        w = 2 * np.pi * frequency
        shunt = self.conductance + 1j * w * self.capacitance + admittance
        inner = 1 / np.where(np.abs(shunt) < OPEN, OPEN, shunt)
        return np.asarray(self.short(frequency) + inner, dtype=np.complex128)

    def short(self, frequency: Frequencies) -> Impedances:
        """Return the impedance with the contacts joined: only the series residuals, shape (N,)."""
        return np.asarray(self.resistance + 2j * np.pi * frequency * self.inductance, dtype=np.complex128)

    def scaled(self, share: float) -> Self:
        """Return a jig whose residuals are this fraction of the given ones."""
        return replace(
            self,
            resistance=self.resistance * share,
            inductance=self.inductance * share,
            capacitance=self.capacitance * share,
            conductance=self.conductance * share,
        )


COAX = Jig(resistance=30e-3, inductance=40e-9, capacitance=1.5e-12)
"""A short coax with BNC, not compensated."""

CLIPS = Jig(resistance=60e-3, inductance=150e-9, capacitance=3e-12)
"""Clip leads of 15 cm, not compensated."""

COMPENSATED = COAX.scaled(1e-6)
"""The residual of the coax after open/short compensation with perfect standards, averaged until it is below what noise
lets any sweep show: 2 pH, as much as the noise of single standards leaves, were named as a lead."""

JIGS = {"compensated": COMPENSATED, "coax": COAX, "clips": CLIPS, "ideal": Jig()}
"""The jigs of the bench by name."""

LOAD_STANDARD_OHM = 50.0
"""The load standard on the bench: an ideal 50 ohm resistor."""
