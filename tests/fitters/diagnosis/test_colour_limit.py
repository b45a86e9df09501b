"""How much of a misfit may count as coloured noise: no more than a pole fit leaves."""

import numpy as np
import pytest

from pzctl.fitters.diagnosis.data_quality.colour_limit import colour_limit
from pzctl.fitters.diagnosis.data_quality.pole_fit import Frame, fit_poles
from pzctl.fitters.engine.noise import noise_from_smoothness
from pzctl.fitters.error_model.prior_scales import COLOURS
from pzctl.models.sweep import Sweep
from pzctl.sim.blind_cases.device_under_test import random_device
from pzctl.sim.blind_cases.recording_process import SweepSpec, record
from pzctl.sim.blind_cases.scenario import NOTHING


def recorded(seed: int, colour: float, points: int = 801) -> Sweep:
    """Return a flawless recording with noise of that correlation between neighbours, by formulas of no model."""
    rng = np.random.default_rng(seed)
    device = random_device(rng, "x", 1, backed=False)
    f = np.linspace(0.12, 3.4, points) * device.disk.f0
    white = rng.normal(size=points) + 1j * rng.normal(size=points)
    from scipy.signal import lfilter  # imported late: it takes half a second, in every process of a test run

    noise = lfilter([2e-4 * np.sqrt(1 - colour**2)], [1.0, -colour], white)
    return Sweep(f, record(device, NOTHING, SweepSpec(device.steps[-1], f)) * np.exp(noise))


def limit(sweep: Sweep) -> float:
    noise = noise_from_smoothness(sweep)
    assert noise is not None
    return colour_limit(fit_poles(Frame.of(sweep, noise, np.isfinite(noise))))


@pytest.mark.parametrize("colour", COLOURS[1::2])
def test_the_right_colour_is_allowed(colour: float) -> None:
    assert all(limit(recorded(seed, colour)) >= colour for seed in range(2))  # one of a hundred is excluded


@pytest.mark.parametrize("seed", range(2))
def test_white_noise_is_not_coloured(seed: int) -> None:
    assert limit(recorded(seed, 0.0)) <= 0.15


def test_a_short_recording_says_nothing() -> None:
    assert limit(recorded(1, 0.0, points=41)) == COLOURS[-1]
