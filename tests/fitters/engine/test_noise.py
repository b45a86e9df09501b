"""Noise is estimated from the recording, even with the sharpest resonances."""

import numpy as np
import pytest

from pzctl.fitters.engine.noise import noise_from_repeats, noise_from_smoothness, noise_of, reflection_noise
from pzctl.models.sweep import Sweep

F = np.linspace(1e6, 9e6, 801)


def disk_sweep(noise: float, seed: int, drift: float = 0.0) -> Sweep:
    """A free plate (thickness mode, kt 0.47, Q 80) with noise."""
    X = np.pi / 2 * F / (4.3e6 * (1 + drift) * np.sqrt(1 + 1j / 80))
    Z = (1 - 0.22 * np.tan(X) / X) / (2j * np.pi * F * 3e-9)
    rng = np.random.default_rng(seed)
    return Sweep(F, Z * (1 + noise * (rng.standard_normal(801) + 1j * rng.standard_normal(801))))


@pytest.mark.parametrize("noise", [1e-5, 2e-4, 3e-3])
def test_the_smoothness_estimate_ignores_resonances(noise: float) -> None:
    found = [noise_from_smoothness(disk_sweep(noise, seed)) for seed in range(8)]
    assert np.median(np.array(found)) == pytest.approx(noise, rel=0.05)


def test_noise_that_grows_where_the_impedance_is_small() -> None:
    clean = disk_sweep(0.0, 0)
    sigma = 1e-4 * np.hypot(1.0, 15.0 / np.abs(clean.impedance))
    ratios = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        noisy = clean.impedance * (1 + sigma * (rng.standard_normal(801) + 1j * rng.standard_normal(801)))
        found = noise_from_smoothness(Sweep(F, noisy))
        assert found is not None
        ratios.append(found / sigma)
    assert np.all(np.abs(np.mean(ratios, axis=0) - 1) < 0.15)


def test_the_estimate_from_repeats_ignores_drift() -> None:
    found = noise_from_repeats([disk_sweep(2e-4, 1), disk_sweep(2e-4, 2, drift=1e-4)])
    assert found is not None
    assert np.median(found[0]) == pytest.approx(2e-4, rel=0.1)


def test_the_source_is_named() -> None:
    sweep = disk_sweep(1e-3, 3)
    short = Sweep(F[:10], sweep.impedance[:10])
    assert noise_of([sweep])[0].source == "smoothness"
    assert noise_of([sweep, disk_sweep(1e-3, 4)])[0].source == "repeats"
    assert noise_of([short])[0].source == "analyzer accuracy"
    told = Sweep(F[:10], sweep.impedance[:10], {"accuracy_relative": [0.001 * k for k in range(1, 11)]})
    np.testing.assert_array_equal(noise_of([told])[1][0], told.settings["accuracy_relative"])


def test_the_noise_of_a_network_analyzer_is_that_of_its_reflection() -> None:
    bridge, clean = disk_sweep(1e-3, 5), disk_sweep(0.0, 0)
    rng = np.random.default_rng(6)
    S = (clean.impedance - 50) / (clean.impedance + 50) + 1e-4 * (rng.normal(size=801) + 1j * rng.normal(size=801))
    analyzer = Sweep(F, 50 * (1 + S) / (1 - S))
    assert reflection_noise([analyzer, analyzer]) == pytest.approx(1e-4, rel=0.1)
    assert reflection_noise([bridge, bridge]) == 0.0, "it is proportional to |Z|"
