"""A constant against temperature, or against another number noted at the measurements: polynomial and coefficients.

value(x) = value(x0) [1 + a1 (x - x0) + a2 (x - x0)^2 ...], by least squares with equal weights. Its uncertainties come
from the scatter around the curve: an error common to all measurements of a series, such as that of a micrometer,
changes value(x0) but hardly a1 and a2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.errors import CannotError


class TrendError(CannotError):
    """The measurements give no trend."""


@dataclass(frozen=True)
class Coefficient:
    """A coefficient with its standard uncertainty."""

    value: float
    u: float


@dataclass(frozen=True)
class Trend:
    """A fitted polynomial."""

    reference: float
    value: Coefficient
    """At the reference, in the unit of the constant."""
    relative: tuple[Coefficient, ...]
    """a1, a2 ...: relative change per unit of x, and per its powers."""
    scatter: float
    """Standard deviation of the measurements around the curve."""
    n: int

    def at(self, x: float) -> float:
        """Return the value of the polynomial."""
        away = x - self.reference
        return self.value.value * (1 + sum(a.value * away ** (k + 1) for k, a in enumerate(self.relative)))


def trend(x: Sequence[float], y: Sequence[float], degree: int, reference: float) -> Trend:
    """Return the trend of y over x. Raises TrendError."""
    if len(x) < degree + 2:
        raise TrendError(f"{len(x)} measurement(s); a trend of degree {degree} needs at least {degree + 2}")
    if len(set(x)) <= degree:
        raise TrendError(f"all measurements are at {len(set(x))} different value(s); degree {degree} needs more")
    values, scale = np.array(y), max(abs(one - reference) for one in x)
    columns = np.vander((np.array(x) - reference) / scale, degree + 1, increasing=True)
    solved, *_ = np.linalg.lstsq(columns, values, rcond=None)
    scatter = float(np.sqrt(np.sum((values - columns @ solved) ** 2) / (len(x) - degree - 1)))
    covariance = scatter**2 * np.linalg.inv(columns.T @ columns)
    at_reference = float(solved[0])
    if at_reference == 0:
        raise TrendError("the value at the reference is 0, so there is no relative change")
    relative: list[Coefficient] = []
    for k in range(1, degree + 1):
        ratio = solved[k] / at_reference
        slopes = np.zeros(degree + 1)
        slopes[0], slopes[k] = -ratio / at_reference, 1 / at_reference
        u = float(np.sqrt(slopes @ covariance @ slopes))
        relative.append(Coefficient(float(ratio) / scale**k, u / scale**k))
    first = Coefficient(at_reference, float(np.sqrt(covariance[0, 0])))
    return Trend(reference, first, tuple(relative), scatter, len(x))
