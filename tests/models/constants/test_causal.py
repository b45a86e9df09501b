"""Causality of the radial disk: Kramers-Kronig between real and imaginary part of Y/jw, over the whole band."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.models.constants.causal import continued
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL
from pzctl.models.stack import CONSTANT, CausalConstantQ

DISK = RadialDisk.of("disk", SHERRIT_RADIAL, np.pi * 5e-3**2, 0.5e-3, 7800.0)
LAW = CausalConstantQ(2e5)
CAUSAL = RadialDisk(replace(DISK.arm, laws=dict.fromkeys(("s11E", "s12E", "d31"), LAW)), DISK.eps33T, LAW)


def capacitance(disk, f):
    return 1 / (2j * np.pi * f * disk.impedance(f))


def drop_by_kramers_kronig(disk, a, b):
    """C'(a) - C'(b) from the losses only: -(2/pi) P int x C''(x) [1/(x^2 - a^2) - 1/(x^2 - b^2)] dx."""
    u = np.linspace(np.log(10), np.log(1e9), 200_001)
    x = np.exp(u)
    loss = capacitance(disk, x).imag

    def integral(at):
        own = capacitance(disk, np.array([at])).imag[0]  # P int dx/(x^2 - a^2) vanishes, so a C''(a) may be subtracted
        return np.trapezoid((x * loss - at * own) / (x**2 - at**2) * x, u)

    return -2 / np.pi * (integral(a) - integral(b))


# 30 and 150 kHz below, 213 kHz between resonance and antiresonance, 1.5 MHz above several overtones
@pytest.mark.parametrize("b", [1.5e5, 2.13e5, 1.5e6])
def test_causal_laws_make_a_causal_disk(b):
    a = 3e4
    drop = (capacitance(CAUSAL, np.array([a])) - capacitance(CAUSAL, np.array([b]))).real[0]
    assert drop_by_kramers_kronig(CAUSAL, a, b) == pytest.approx(drop, rel=2e-3)


def test_constant_loss_is_not_causal():
    a, b = 3e4, 1.5e6
    drop = (capacitance(DISK, np.array([a])) - capacitance(DISK, np.array([b]))).real[0]
    assert abs(drop_by_kramers_kronig(DISK, a, b) / drop - 1) > 0.02


@pytest.mark.parametrize("value", [2e-9 - 3e-11j, -2e-9 + 3e-11j, -2e9 - 1e7j])
def test_a_negative_constant_mirrors_the_positive_one(value):
    f = np.array([1e4, 2e5, 3e6])
    there, slopes = continued(LAW, value, f)
    opposite, _ = continued(LAW, -value, f)
    assert there == pytest.approx(-opposite, rel=1e-14)
    assert there[1] == pytest.approx(value, rel=1e-14)
    assert np.diff(np.abs(there)).max() * np.diff(np.abs(there)).min() > 0  # monotonic
    h = 1e-6 * abs(value)
    for part, unit in (("re", 1), ("im", 1j)):
        difference = (continued(LAW, value + h * unit, f)[0] - continued(LAW, value - h * unit, f)[0]) / (2 * h)
        assert slopes[part] == pytest.approx(difference, rel=1e-8)


def test_a_constant_of_zero_has_derivatives():
    values, slopes = continued(CONSTANT, 0j, np.array([1e5, 2e5]))
    assert values.tolist() == [0, 0]
    assert slopes["re"].tolist() == [1, 1]
    assert slopes["im"].tolist() == [1j, 1j]
