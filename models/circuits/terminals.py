"""Elements between an analyzer and a device: series and shunt elements, a line, an error of scale.

Each takes the impedance Z that it is loaded with, and gives what is seen through it, Z', with dZ'/dZ and the
derivatives of Z' by its own parameters. At its null value every element gives back Z itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from ..base.arrays import Complexes, Frequencies, Impedances, j_omega

Seen: TypeAlias = tuple[Impedances, Complexes, Mapping[str, Complexes]]
"""Z' in ohm, dZ'/dZ, and dZ'/dp by the element's field; each of shape (N,)."""

_SKIN_REFERENCE = 1e6


class Element(Protocol):
    """One element of the path; its dataclass fields are its parameters."""

    def see(self, Z: Impedances, frequency: Frequencies) -> Seen:
        """Return the impedance seen through the element."""
        ...


def skin(frequency: Frequencies) -> Complexes:
    """Return (1 + j) sqrt(f / 1 MHz), shape (N,): a thick conductor's resistance and its equal internal reactance.

    The reactance comes with the resistance; without it the element would not be causal.
    """
    return (1 + 1j) * np.sqrt(frequency / _SKIN_REFERENCE)


@dataclass(frozen=True)
class Series:
    """A wire, clip or fixture in series."""

    inductance: float = 0.0
    """H."""
    resistance: float = 0.0
    """ohm."""
    skin: float = 0.0
    """ohm at 1 MHz; it grows as the square root of frequency."""

    def see(self, Z: Impedances, frequency: Frequencies) -> Seen:
        """Return Z + jwL + R + skin (1 + j) sqrt(f/1 MHz)."""
        jw, rough, one = j_omega(frequency), skin(frequency), np.ones_like(Z)
        seen = Z + jw * self.inductance + self.resistance + self.skin * rough
        return seen, one, {"inductance": jw, "resistance": one, "skin": rough}


@dataclass(frozen=True)
class Shunt:
    """A capacitance and a conductance in parallel with the device."""

    capacitance: float = 0.0
    """F."""
    conductance: float = 0.0
    """S."""

    def see(self, Z: Impedances, frequency: Frequencies) -> Seen:
        """Return Z/[1 + Z (jwC + G)]."""
        jw = j_omega(frequency)
        divider = 1 + Z * (jw * self.capacitance + self.conductance)
        seen = Z / divider
        return seen, divider**-2, {"capacitance": -(seen**2) * jw, "conductance": -(seen**2)}


@dataclass(frozen=True)
class TransmissionLine:
    """A cable between analyzer and device."""

    length: float = 0.0
    """Length, m; 0 means no cable."""
    impedance: float = 50.0
    """Characteristic impedance, ohm."""
    velocity: float = 2e8
    """Wave velocity, m/s."""
    loss: float = 0.0
    """Attenuation in Np/m at 1 MHz; it grows as the square root of frequency."""

    def see(self, Z: Impedances, frequency: Frequencies) -> Seen:
        """Return Z0 (Z + Z0 T)/(Z0 + Z T), T = tanh(gamma length), gamma = jw/velocity + loss (1 + j) sqrt(f/1 MHz)."""
        jw, rough, Z0 = j_omega(frequency), skin(frequency), self.impedance
        gamma = jw / self.velocity + self.loss * rough
        T = np.tanh(gamma * self.length)
        below = Z0 + Z * T
        seen = Z0 * (Z + Z0 * T) / below
        by_angle = Z0 * (1 - T**2) * (Z0**2 - Z**2) / below**2  # d seen/d(gamma length)
        slopes = {
            "length": by_angle * gamma,
            "impedance": T * (Z**2 + 2 * Z * Z0 * T + Z0**2) / below**2,
            "velocity": by_angle * self.length * -jw / self.velocity**2,
            "loss": by_angle * self.length * rough,
        }
        return seen, Z0**2 * (1 - T**2) / below**2, slopes


@dataclass(frozen=True)
class Scale:
    """Errors that a load standard would have corrected: a scale factor and a delay."""

    gain: float = 1.0
    delay: float = 0.0
    """s; Z' = gain exp(jw delay) Z."""

    def see(self, Z: Impedances, frequency: Frequencies) -> Seen:
        """Return gain exp(jw delay) Z."""
        jw = j_omega(frequency)
        turn: Complexes = np.exp(jw * self.delay)
        factor = self.gain * turn
        return factor * Z, factor, {"gain": turn * Z, "delay": jw * factor * Z}
