"""What is no noise is seen where chi2 says nothing, and noise is left alone."""

import numpy as np
import pytest

from pzctl.fitters.diagnosis.validation.whiteness_tests import period, uneven
from pzctl.models.base.arrays import Complexes

N = 801


def noise(seed: int) -> Complexes:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(N) + 1j * rng.standard_normal(N)


def chi2(residual: Complexes) -> float:
    return float(np.mean(np.abs(residual) ** 2)) / 2


def test_noise_has_no_structure() -> None:
    assert not any(uneven(noise(seed), 1) or period(noise(seed)) for seed in range(300))


@pytest.mark.parametrize("seed", range(5))
def test_a_ripple_below_the_noise_is_told_by_its_period(seed: int) -> None:
    hum = noise(seed) + 0.6 * np.sin(2 * np.pi * np.arange(N) / 13.0)
    assert chi2(hum) < 1.2
    found = period(hum)
    assert found is not None
    assert found == pytest.approx(13.0, rel=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_a_few_points_out_of_place_are_found_where_they_are(seed: int) -> None:
    moved = noise(seed)
    moved[400:406] += 4 + 4j
    assert chi2(moved) < 1.3
    ((_, first, stop),) = uneven(moved, 1)
    assert first <= 402
    assert stop >= 404
    assert stop - first < 20


def test_a_noise_twice_as_large_as_told_has_no_period() -> None:
    assert not any(period(2 * noise(seed)) for seed in range(50))
