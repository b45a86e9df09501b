"""Accuracy, noise and sweep time compared with figures by others, and their basic properties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.drivers.agilent4294a import accuracy, sweep_time


@pytest.mark.parametrize(
    ("MHz", "bandwidth", "percent"),
    [
        # |Z| = 10, 100, 1k, 10k, 100k ohm at 0.5 V: the formula's authors' own table
        (1, 5, [0.10, 0.078, 0.076, 0.080, 0.125]),
        (1, 1, [0.63, 0.49, 0.48, 0.51, 0.78]),
        (3, 5, [0.33, 0.30, 0.31, 0.35, 0.80]),
        (3, 1, [0.95, 0.73, 0.75, 1.20, 5.7]),
        (10, 5, [1.03, 1.00, 1.01, 1.05, 1.50]),
    ],
)
def test_accuracy_equals_that_of_the_operation_manual(MHz, bandwidth, percent):
    Z = np.array([10, 100, 1e3, 10e3, 100e3]) * np.exp(0.3j)
    f = np.full(5, MHz * 1e6)
    # the table is rounded to two or three digits
    np.testing.assert_allclose(100 * accuracy.relative_accuracy(f, Z, bandwidth, 0.5), percent, rtol=0.02, atol=0.0051)


def test_noise_equals_that_of_recordings_by_others():
    f, Z = np.array([50e3]), np.array([1000 + 0j])
    assert accuracy.relative_noise(f, Z, 5, 0.5, 1)[0] == pytest.approx(4e-5, rel=0.01)
    assert accuracy.relative_noise(f, Z, 1, 0.5, 1)[0] == pytest.approx(2e-4, rel=0.05)
    assert accuracy.relative_noise(f, Z, 5, 0.5, 64)[0] == pytest.approx(5e-6, rel=0.01)


@given(
    f=st.floats(40, 110e6),
    magnitude=st.floats(0.01, 100e6),
    bandwidth=st.integers(1, 5),
    volts=st.floats(0.005, 1),
    averages=st.integers(1, 256),
)
def test_noise_stays_below_accuracy_and_falls_with_averaging(f, magnitude, bandwidth, volts, averages):
    f, Z = np.array([f]), np.array([magnitude + 0j])
    one = accuracy.relative_noise(f, Z, bandwidth, volts, 1)
    assert 0 < one[0] < accuracy.relative_accuracy(f, Z, bandwidth, volts)[0]
    np.testing.assert_allclose(accuracy.relative_noise(f, Z, bandwidth, volts, averages), one / np.sqrt(averages))


@pytest.mark.parametrize(("bandwidth", "seconds"), [(1, 2.6), (2, 6.3), (3, 11.6), (4, 41), (5, 128)])
def test_sweep_time_of_801_points_from_1_to_3_MHz(bandwidth, seconds):
    f = np.linspace(1e6, 3e6, 801)
    assert sweep_time.estimated(f, bandwidth, 1, 1, 0, 0) == pytest.approx(seconds, rel=0.02)
    assert sweep_time.estimated(f, bandwidth, 2, 4, 0.01, 2) == pytest.approx(4 * (2 * seconds + 8.01 + 2), rel=0.02)


@pytest.mark.parametrize(("bandwidth", "factor", "recorded"), [(4, 64, 1795.2), (3, 32, 482.1), (2, 2, 33.5)])
def test_recorded_runs_are_within_timeout_and_estimate(bandwidth, factor, recorded):
    f = np.geomspace(40, 110e6, 400)
    estimate = sweep_time.estimated(f, bandwidth, factor, 1, 0, 0)
    assert recorded < estimate < 2 * recorded < sweep_time.timeout(1.5 * estimate)
