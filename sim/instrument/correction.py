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

FIXED_POINTS: Frequencies = grid(40.0, 110e6, 201, "LOG")
"""The frequencies of CALP FIXED [the instrument's own were not reachable]; between them it is interpolated."""

SHORTED = 1e-9
"""Impedance that stands for 0 where its inverse is kept, ohm."""

STANDARDS = ("A", "B", "C")
"""Open (kept as admittance G, B), short and load (kept as impedance R, X), by the last letter of the mnemonic."""


@dataclass
class Correction:
    """Measured standards and which of them are on."""

    frequency: dict[str, Frequencies] = field(default_factory=dict[str, Frequencies])
    measured: dict[str, Complexes] = field(default_factory=dict[str, Complexes])
    on: set[str] = field(default_factory=set[str])

    def store(self, standard: str, frequency: Frequencies, z: Impedances) -> None:
        """Keep the impedance that was seen with a standard connected, and switch its correction on."""
        inverse: Complexes = 1 / np.where(np.abs(z) < SHORTED, SHORTED, z).astype(np.complex128)
        self.put(standard, frequency, inverse if standard == "A" else z)

    def put(self, standard: str, frequency: Frequencies, values: Complexes) -> None:
        """Keep a standard's array as the instrument does (open in S, the others in ohm), and switch it on."""
        self.frequency[standard], self.measured[standard] = frequency, values
        self.on.add(standard)

    def switch(self, standard: str, on: bool) -> None:
        """Switch a correction. Raises CommandError where the standard was never measured."""
        if on and standard not in self.measured:
            raise CommandError(-221, "SETTINGS CONFLICT; NO COEFFICIENTS")
        (self.on.add if on else self.on.discard)(standard)

    def apply(self, frequency: Frequencies, z: Impedances, state: State) -> Impedances:
        """Return the impedance of the device, shape (N,), from what was seen through the fixture.

        Standards that make no sense (such as a short measured as the open) give HUGE.
        """
        if not self.on:
            return z
        with np.errstate(all="ignore"):
            return np.nan_to_num(self._solved(frequency, z, state), nan=HUGE, posinf=HUGE, neginf=-HUGE)

    def _solved(self, frequency: Frequencies, z: Impedances, state: State) -> Impedances:
        w = 2 * np.pi * frequency
        short = self._at("B", frequency) - (state.real("DCOMSHORR") + 1j * w * state.real("DCOMSHORL"))
        opened = self._at("A", frequency) - (state.real("DCOMOPENG") + 1j * w * state.real("DCOMOPENC"))
        series = short if "B" in self.on else np.zeros_like(z)
        # seen from the analyzer, the open shows the shunt behind the series part
        shunt = opened / (1 - opened * series) if "A" in self.on else np.zeros_like(z)

        def taken_out(seen: Impedances) -> Impedances:
            inner = seen - series
            return inner / (1 - inner * shunt)

        corrected = taken_out(z)
        if "C" in self.on:
            load = state.real("DCOMLOADR") + 1j * w * state.real("DCOMLOADL")
            corrected = corrected * load / taken_out(self._at("C", frequency))
        return corrected

    def _at(self, standard: str, frequency: Frequencies) -> Complexes:
        """Return a stored standard at the sweep's frequencies: linear between points, as L and C are."""
        if standard not in self.measured:
            return np.zeros(frequency.size, dtype=np.complex128)
        known, values = self.frequency[standard], self.measured[standard]
        return np.interp(frequency, known, values.real) + 1j * np.interp(frequency, known, values.imag)
