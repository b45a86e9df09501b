"""The wiring between device and analyzer: a chain of two-ports; a cable is very many short pieces of lossy line."""

import numpy as np

from ...waves import Complexes, Reals
from .flaws import FixtureResidue, Wiring

_HALVINGS = 9
"""A cable is cut into 2^9 pieces: the error of a piece shrinks with the square of its length."""


def at_analyzer(f: Reals, device: Complexes, wiring: Wiring, fixture: FixtureResidue, f0: float) -> Complexes:
    """Return the impedance in ohm at the analyzer of a device with this admittance (S); shape (N,)."""
    x, omega = f / f0, 2 * np.pi * f
    y = device + _stray(x, omega, wiring) + wiring.conductance * x**wiring.conductance_power
    z = 1 / (y + wiring.film * np.sqrt(1j * x))
    if wiring.delay > 0:
        z = _through_cable(z, omega, x, wiring)
    z = z + _lead(f, omega, wiring) + wiring.resistance * x**wiring.resistance_power
    z = z + wiring.contact * (1j * x) ** -0.8 + _loop(omega, wiring)
    shunt = 1j * omega * fixture.capacitance + fixture.conductance
    series = 1j * omega * fixture.inductance + fixture.resistance + fixture.skin * (1 + 1j) * np.sqrt(f / 1e6)
    return np.asarray(1 / (1 / (z + series) + shunt), np.complex128)


def _lead(f: Reals, omega: Reals, wiring: Wiring) -> Complexes:
    own = 1j * omega * wiring.inductance + wiring.skin * (1 + 1j) * np.sqrt(f / 1e6)
    return np.asarray(own / (1 + own * 1j * omega * wiring.winding), np.complex128)


def _stray(x: Reals, omega: Reals, wiring: Wiring) -> Complexes:
    """Return the admittance of a capacitance of constant loss angle: a constant-phase element."""
    power = 2 / np.pi * np.arctan(wiring.capacitance_tan)
    return 1j * omega * wiring.capacitance * (1j * x) ** -power


def _loop(omega: Reals, wiring: Wiring) -> Complexes:
    f, Q, mutual = wiring.loop
    w = 2 * np.pi * f
    return omega**2 * mutual / (1j * omega + w / Q + w**2 / (1j * omega))


def _through_cable(z: Complexes, omega: Reals, x: Reals, wiring: Wiring) -> Complexes:
    """Return the input impedance of a cable that ends in z: the chain matrix of a short piece, squared repeatedly."""
    pieces = 2.0**_HALVINGS
    series = (1j * omega * wiring.delay + wiring.cable_loss * (1 + 1j) * np.sqrt(x)) * wiring.cable_ohm / pieces
    shunt = 1j * omega * wiring.delay / wiring.cable_ohm / pieces
    a, b, c, d = 1 + series * shunt / 2, series * (1 + series * shunt / 4), shunt, 1 + series * shunt / 2
    for _ in range(_HALVINGS):
        a, b, c, d = a * a + b * c, b * (a + d), c * (a + d), d * d + b * c
    return (a * z + b) / (c * z + d)
