"""Errors at a place of their own in a recording: weak resonances, and switches of the analyzer's range."""

from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Reals, j_omega
from ...models.effects.base.branch import branch
from ..engine.recording import Recording
from . import prior_scales as scales
from .instrument_share import accuracy_of


@dataclass(frozen=True)
class WeakLine:
    """A further resonance in the recordings of one step, too small to be named."""

    step: str
    frequency: float
    """Hz."""
    q: float

    def admittance(self, frequency: Frequencies, capacitance: float) -> Complexes:
        """Return the admittance of its branch in parallel with the device per unit of its prior, in phase, shape (N,).

        `capacitance` is the clamped one, F.
        """
        residue = scales.LINE / self.q * capacitance
        return np.asarray(residue * branch(j_omega(frequency), 2 * np.pi * self.frequency, self.q), np.complex128)

    def shifted(self, frequency: Frequencies, capacitance: float) -> Complexes:
        """Return by how much the admittance is changed by the usual error of the line's frequency, shape (N,).

        In quadrature it is the change by an error of Q.
        """
        off = scales.LINE_OFF / self.q
        above, below = (replace(self, frequency=self.frequency * (1 + way * off)) for way in (1, -1))
        return (above.admittance(frequency, capacitance) - below.admittance(frequency, capacitance)) / 2


@dataclass(frozen=True)
class RangeSwitch:
    """A level of |Z| at which the analyzer changes its range: its gain and phase differ on either side of it."""

    level: float
    """Ohm."""

    def step_of(self, recording: Recording) -> Reals:
        """Return the usual step of ln |Z| above the level at each point, shape (N,)."""
        above = np.abs(recording.sweep.impedance) > self.level
        return np.asarray(scales.SWITCH * accuracy_of(recording.sweep) * above, np.float64)


LocalError = WeakLine | RangeSwitch
"""An error at a place of its own, which a recording shows."""
