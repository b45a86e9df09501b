"""The sizes of a pair's errors: several at once have the densities of each alone."""

import numpy as np
import pytest

from pzctl.fitters.compare.errors.pair_sizes import densities_of_group, log_densities, log_density
from pzctl.models.base.arrays import Reals


def products(indefinite: bool) -> tuple[Reals, Reals]:
    """Return products of 21 columns, and sizes of 20 coefficients."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(400, 21)) * (1e9 if indefinite else 1.0)
    if indefinite:  # two columns that rounding cannot tell apart
        X[:, 20] = X[:, 19]
    return X.T @ X, 10 ** rng.uniform(-3, 1, 20)


@pytest.mark.parametrize("indefinite", [False, True])
def test_several_densities_are_those_of_each(indefinite: bool) -> None:
    (G, scale), noise = products(indefinite), np.linspace(0.6, 1.6, 5)
    found = log_densities(G, 3.0, scale, noise)
    np.testing.assert_allclose(found, [log_density(G / size**2, 3.0, scale) for size in noise], rtol=1e-10)


@pytest.mark.parametrize("indefinite", [False, True])
@pytest.mark.parametrize("group", [slice(1, 4), slice(9, 15), slice(18, 21), slice(20, 21)])
def test_densities_by_the_size_of_a_group_are_those_with_that_size(indefinite: bool, group: slice) -> None:
    (G, scale), trials = products(indefinite), np.array([0.0, 1e-3, 0.1, 10.0])
    found = densities_of_group(G, 3.0, scale, group, trials)
    each: list[float] = []
    for size in trials:
        scale[group.start - 1 : group.stop - 1] = size
        each.append(log_density(G, 3.0, scale))
    np.testing.assert_allclose(found, each, rtol=1e-10)
