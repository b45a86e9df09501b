"""Noise is found in the recording, beside the sharpest resonances."""

import numpy as np
import pytest

from pzctl.fitters.noise import noise_from_repeats, noise_from_smoothness, relative_noise
from pzctl.models.sweep import Sweep

F = np.linspace(1e6, 9e6, 801)


def disk_sweep(noise: float, seed: int, drift: float = 0.0) -> Sweep:
    """A free plate (thickness mode, kt 0.47, Q 80) with noise."""
    X = np.pi / 2 * F / (4.3e6 * (1 + drift) * np.sqrt(1 + 1j / 80))
    Z = (1 - 0.22 * np.tan(X) / X) / (2j * np.pi * F * 3e-9)
    rng = np.random.default_rng(seed)
    return Sweep(F, Z * (1 + noise * (rng.standard_normal(801) + 1j * rng.standard_normal(801))))


@pytest.mark.parametrize("noise", [1e-5, 2e-4, 3e-3])
def test_smoothness_is_blind_to_resonances(noise: float) -> None:
    found = [noise_from_smoothness(disk_sweep(noise, seed)) for seed in range(8)]
    assert np.mean([value for value in found if value]) == pytest.approx(noise, rel=0.05)


def test_repeats_are_blind_to_drift() -> None:
    found = noise_from_repeats([disk_sweep(2e-4, 1), disk_sweep(2e-4, 2, drift=1e-4)])
    assert found == pytest.approx(2e-4, rel=0.15)


def test_the_source_is_named() -> None:
    sweep = disk_sweep(1e-3, 3)
    assert relative_noise([sweep]).source == "smoothness"
    assert relative_noise([sweep, disk_sweep(1e-3, 4)]).source == "repeats"
    short = Sweep(F[:10], sweep.impedance[:10])
    assert relative_noise([short]).source == "analyzer accuracy"
