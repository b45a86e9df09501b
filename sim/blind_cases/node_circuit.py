"""The leads between the analyzer and the device: a circuit that is solved for its node voltages."""

from dataclasses import dataclass

import numpy as np

from .waves import Complexes, Reals

OHM_OF_CABLE = 50.0
"""Characteristic impedance of the cable."""
_SECTIONS = 24
_WIRE = 1e-4
"""ohm, of each wire, because a wire without impedance has no finite admittance; it is subtracted from the result."""


@dataclass(frozen=True)
class Path:
    """The circuit elements in the leads that the build file omits; zero means absent."""

    inductance: float = 0.0
    """H, in series."""
    resistance: float = 0.0
    """ohm, in series."""
    capacitance: float = 0.0
    """F, across the device."""
    conductance: float = 0.0
    """S, across the device."""
    delay: float = 0.0
    """s, one way through a cable."""
    branch: tuple[float, float, float] | None = None
    """A further resonance: Hz, Q, and its static capacitance in F."""
    coupled: tuple[float, float, float] | None = None
    """A loop that is coupled to the lead: its Hz, its Q, and M^2/L in H."""


def measured_impedance(omega: Reals, device: Complexes, path: Path) -> Complexes:
    """Return the impedance (ohm) that the analyzer sees for a device with this admittance (S); shape (N,)."""
    nodes = 2 + (_SECTIONS if path.delay > 0 else 0)
    Y = np.zeros((omega.size, nodes, nodes), np.complex128)
    last = nodes - 1
    series = 1j * omega * path.inductance + path.resistance + _induced(omega, path)
    _branch(Y, 0, 1, 1.0 / (series + _WIRE))
    if path.delay > 0:
        _ladder(Y, omega, path.delay)
    Y[:, last, last] += device + 1j * omega * path.capacitance + path.conductance + _resonator(omega, path)
    current = np.zeros((omega.size, nodes, 1), np.complex128)
    current[:, 0, 0] = 1.0
    return np.linalg.solve(Y, current)[:, 0, 0] - _WIRE


def _ladder(Y: Complexes, omega: Reals, delay: float) -> None:
    """Add a transmission line as many small sections, with half of each capacitance at either end."""
    L, C = OHM_OF_CABLE * delay / _SECTIONS, delay / OHM_OF_CABLE / _SECTIONS
    for k in range(1, _SECTIONS + 1):
        _branch(Y, k, k + 1, 1 / (1j * omega * L))
        Y[:, k, k] += 0.5j * omega * C
        Y[:, k + 1, k + 1] += 0.5j * omega * C


def _branch(Y: Complexes, a: int, b: int, value: Complexes) -> None:
    Y[:, a, a] += value
    Y[:, b, b] += value
    Y[:, a, b] -= value
    Y[:, b, a] -= value


def _resonator(omega: Reals, path: Path) -> Complexes:
    """Return the admittance of a series circuit of L, R, C."""
    if path.branch is None:
        return np.zeros_like(omega, np.complex128)
    f, Q, C = path.branch
    w = 2 * np.pi * f
    return 1 / (1j * omega / (w**2 * C) + 1 / (w * Q * C) + 1 / (1j * omega * C))


def _induced(omega: Reals, path: Path) -> Complexes:
    """Return the series impedance that a coupled loop adds to the lead: (w M)^2 over the impedance of the loop."""
    if path.coupled is None:
        return np.zeros_like(omega, np.complex128)
    f, Q, M2_L = path.coupled
    w = 2 * np.pi * f
    return omega**2 * M2_L / (1j * omega + w / Q + w**2 / (1j * omega))
