"""Distributions of sizes."""

import math

import numpy as np

Random = np.random.Generator


def lognormal(rng: Random, median: float, sd: float) -> float:
    """Draw a size whose logarithm is normal."""
    return median * math.exp(rng.normal(0.0, sd))


def loguniform(rng: Random, low: float, high: float) -> float:
    """Draw a size whose logarithm is uniform."""
    return low * math.exp(rng.uniform(0.0, math.log(high / low)))
