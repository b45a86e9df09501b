"""Critical frequencies are recovered from noisy data with valid uncertainties."""

import numpy as np
import pytest

from pzctl.fitters.disk.critical_frequencies import admittance_trace, critical, tops
from pzctl.fitters.interface import FitError
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.sweep import Sweep

FS, Q = 200e3, 80.0
CIRCUIT = Lumped(1e-9, (Branch.from_resonance(FS, Q, 2e-10),))


def read(spacing: float, noise: float, seed: int = 0, start: float = 150e3):
    f = np.arange(start, 250e3, spacing)
    rng = np.random.default_rng(seed)
    Z = CIRCUIT.impedance(f) * np.exp(noise * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)))
    trace, k, _ = tops([admittance_trace(Sweep(f, Z), np.full(f.size, noise))], 1.9e5, 2.1e5)[0]
    return critical(trace, k, "the resonance")


def test_without_noise_critical_frequencies_are_those_of_the_circuit():
    found = read(50.0, 1e-9)
    # of 1/(1 + jx), x = Q (f/fs - fs/f): the maximum is at x = 0, the extremes beside it at x = -1 and 1, times 1/w
    assert found.at.top == pytest.approx(FS, rel=5e-5)
    assert found.at.minus - found.at.plus == pytest.approx(FS / Q, rel=2e-3)
    assert found.points_per_linewidth == pytest.approx(FS / Q / 50, rel=0.01)


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 5e-3])
def test_uncertainties_cover_the_error(noise: float):
    exact = read(5.0, 1e-9)
    pulls = []
    for seed in range(40):
        found = read(60.0, noise, seed)
        pulls += [
            (found.at.top - exact.at.top) / found.u_top,
            (found.at.plus - exact.at.plus) / found.u_plus,
            (found.at.minus - exact.at.minus) / found.u_minus,
        ]
    assert 0.4 < np.sqrt(np.mean(np.square(pulls))) < 2.0


def test_too_few_points_are_refused_with_the_spacing_that_is_needed():
    with pytest.raises(FitError, match=r"the resonance at .* kHz has 2\.\d points in its linewidth .* sweep it every"):
        read(1000.0, 1e-4)


def test_a_peak_that_is_cut_off_is_refused():
    with pytest.raises(FitError, match=r"is cut off: the recording holds 199\.5 to 249\.95 kHz, and more .* below"):
        read(50.0, 1e-5, start=199.5e3)
