"""Two recordings of different devices are no change of one."""

from collections.abc import Iterable

import numpy as np

from pzctl.fitters.compare.compare import compare
from pzctl.models.sweep import Sweep

F = np.linspace(0.8e6, 1.4e6, 61)
Branches = Iterable[tuple[float, float, float]]
"""Frequency in Hz, Q, capacitance in F of each resonance."""


def device(capacitance: float, branches: Branches) -> np.ndarray:
    """Impedance in ohm of a capacitance with resonances."""
    Y = 2j * np.pi * F * capacitance * (1 - 0.01j)
    for f0, q, c in branches:
        Y = Y + 2j * np.pi * F * c / (1 - (F / f0) ** 2 + 1j * F / f0 / q)
    return 1 / Y


def recorded(Z: np.ndarray, seed: int) -> Sweep:
    """Add the noise and the gain error of a bench."""
    rng = np.random.default_rng(seed)
    noise = 1e-4 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
    return Sweep(F, Z * np.exp(noise + 1e-3 * rng.normal()))


def test_two_different_devices_are_not_described_as_changes_of_one() -> None:
    rng = np.random.default_rng(4)
    one = device(5e-10, [(0.98e6, 120, 6e-11), (1.13e6, 90, 9e-12), (1.27e6, 150, 3e-12)])
    other = device(4e-10, [(f0, 100, 10 ** rng.uniform(-12, -10.5)) for f0 in rng.uniform(0.85e6, 1.35e6, 4)])
    found = compare([recorded(one, 1)], [recorded(other, 2)])
    assert found.verdict == "unexplained"
    assert not found.findings
    assert found.probability > 0.9
    assert any("two" in sentence for sentence in found.says)
