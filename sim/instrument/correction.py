"""User calibration and fixture compensation: open, short and load standards are measured, stored and corrected for.

Compensation (COMA, COMB, COMC) and calibration (CALA, CALB, CALC) are the same arithmetic at two stages of the
data processing (PM p.63, p.81-83): first calibration, then compensation of its result.
"""

from dataclasses import dataclass, field

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Impedances
from ..language.messages import CommandError
from .axis import grid
from .state import State
from .traces import HUGE

FIXED_POINTS: Frequencies = grid(40.0, 110e6, 100, "LOG")
"""The frequencies of CALP FIXED, between which it is interpolated: 100 (PM p.320) [the manual does not print them]."""

FEMTO = 1e-15
"""DCOMOPENC and DCALOPENC are in fF (PM p.288, 293)."""

SHORTED = 1e-9
"""Impedance used in place of 0 where the inverse is stored, ohm."""

STANDARDS = ("A", "B", "C")
"""Open (kept as admittance G, B), short and load (kept as impedance R, X), by the last letter of the mnemonic."""


def as_kept(standard: str, z: Impedances) -> Complexes:
    """Return a standard's impedance as its array stores it: an open is stored as admittance."""
    if standard != "A":
        return z
    return np.asarray(1 / np.where(np.abs(z) < SHORTED, SHORTED, z), dtype=np.complex128)


@dataclass
class Correction:
    """Measured standards and which of them are on."""

    frequency: dict[str, Frequencies] = field(default_factory=dict[str, Frequencies])
    measured: dict[str, Complexes] = field(default_factory=dict[str, Complexes])
    on: set[str] = field(default_factory=set[str])
    prefix: str = "DCOM"
    """First letters of the mnemonics that define the standards."""

    def store(self, standard: str, frequency: Frequencies, z: Impedances) -> None:
        """Store the impedance measured with a standard connected, and switch its correction on."""
        self.put(standard, frequency, as_kept(standard, z))

    def drop(self) -> bool:
        """Delete all coefficients; return whether there were any."""
        lost = bool(self.measured)
        self.frequency.clear()
        self.measured.clear()
        self.on.clear()
        return lost

    def put(self, standard: str, frequency: Frequencies, values: Complexes) -> None:
        """Store a standard's array as the instrument does (open in S, the others in ohm), and switch it on."""
        self.frequency[standard], self.measured[standard] = frequency, values
        self.on.add(standard)

    def switch(self, standard: str, on: bool) -> None:
        """Switch a correction. Raises CommandError where the standard was never measured."""
        if on and standard not in self.measured:
            raise CommandError(11)
        (self.on.add if on else self.on.discard)(standard)

    def apply(self, frequency: Frequencies, z: Impedances, state: State) -> Impedances:
        """Return the impedance of the device, shape (N,), from the impedance measured through the fixture.

        Nonsensical standards (such as a short measured as the open) give HUGE.
        """
        if not self.on:
            return z
        with np.errstate(all="ignore"):
            return np.nan_to_num(self._solved(frequency, z, state), nan=HUGE, posinf=HUGE, neginf=-HUGE)

    def _solved(self, frequency: Frequencies, z: Impedances, state: State) -> Impedances:
        w = 2 * np.pi * frequency
        short = self._at("B", frequency) - (self._real(state, "SHORR") + 1j * w * self._real(state, "SHORL"))
        opened = self._at("A", frequency) - (self._real(state, "OPENG") + 1j * w * FEMTO * self._real(state, "OPENC"))
        series = short if "B" in self.on else np.zeros_like(z)
        # the open measures the shunt together with the series part, which lies nearer to the analyzer
        shunt = opened / (1 - opened * series) if "A" in self.on else np.zeros_like(z)

        def taken_out(seen: Impedances) -> Impedances:
            inner = seen - series
            return inner / (1 - inner * shunt)

        corrected = taken_out(z)
        if "C" in self.on:
            load = self._real(state, "LOADR") + 1j * w * self._real(state, "LOADL")
            corrected = corrected * load / taken_out(self._at("C", frequency))
        return corrected

    def _real(self, state: State, name: str) -> float:
        return state.real(self.prefix + name)

    def _at(self, standard: str, frequency: Frequencies) -> Complexes:
        """Return a stored standard at the sweep's frequencies: linear between points, as L and C are."""
        if standard not in self.measured:
            return np.zeros(frequency.size, dtype=np.complex128)
        known, values = self.frequency[standard], self.measured[standard]
        return np.interp(frequency, known, values.real) + 1j * np.interp(frequency, known, values.imag)
