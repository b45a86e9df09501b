"""The sizes of a pair's errors: several at once have the densities of each alone."""

import numpy as np
import pytest

from pzctl.fitters.compare.errors.pair_sizes import log_densities, log_density


@pytest.mark.parametrize("indefinite", [False, True])
def test_several_densities_are_those_of_each(indefinite: bool) -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(400, 21)) * (1e9 if indefinite else 1.0)
    if indefinite:  # two columns that rounding cannot tell apart
        X[:, 20] = X[:, 19]
    G, scales, noise = X.T @ X, 10 ** rng.uniform(-3, 1, (5, 20)), rng.uniform(0.6, 1.6, 5)
    found = log_densities(G, 3.0, scales, noise)
    each = [log_density(G / size**2, 3.0, scale) for scale, size in zip(scales, noise, strict=True)]
    np.testing.assert_allclose(found, each, rtol=1e-10)
