"""Populations: false alarms and power of the outlier test, and coverage of the interval of tau."""

import math

import numpy as np
import pytest

from pzctl.fitters.population.random_effects import outliers, random_effects

DRAWS = 1000


def mad(x: np.ndarray) -> bool:
    """The usual rule: |x - median| > 3.5 scaled median deviations."""
    off = abs(x - np.median(x))
    return bool(np.any(0.6745 * off > 3.5 * np.median(off)))


@pytest.mark.parametrize("n", [3, 4, 6, 10, 20])
def test_false_alarms_of_the_outlier_test_and_of_the_median_rule(n: int) -> None:
    rng = np.random.default_rng(n)
    good = rng.normal(size=(DRAWS, n))
    odd = good.copy()
    odd[:, 0] += 10
    alarm, rule = (np.mean([bool(test(x)) for x in good]) for test in (lambda x: outliers(x, np.zeros(n)), mad))
    power = np.mean([0 in outliers(x, np.zeros(n)) for x in odd])
    print(f"\nn = {n}: false alarms {alarm:.1%} (3.5 MAD: {rule:.1%}); one sample 10 sd off is named in {power:.0%}")
    assert alarm < rule


@pytest.mark.parametrize("n", [3, 4, 8])
@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_coverage_of_the_intervals(n: int, ratio: float) -> None:
    """tau/u is `ratio`; u differs between samples by a factor of 3."""
    from scipy.stats import t

    rng = np.random.default_rng(n)
    u = np.geomspace(1, 3, n) / ratio
    inside, mean_inside = 0, 0
    for _ in range(DRAWS):
        found = random_effects(rng.normal(0, np.sqrt(1 + u**2)), u)
        inside += found.tau_low <= 1 <= found.tau_high
        mean_inside += abs(found.mean) <= t.ppf(0.975, n - 1) * found.u
    print(
        f"\nn = {n}, tau/u = {ratio}: 95 % intervals hold tau in {inside / DRAWS:.1%}, mean {mean_inside / DRAWS:.1%}"
    )
    assert abs(inside / DRAWS - 0.95) < 5 * math.sqrt(0.95 * 0.05 / DRAWS)
