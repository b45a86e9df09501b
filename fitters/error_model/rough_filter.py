"""Whitening by a Kalman filter: white noise beside an error that is exponentially correlated from point to point.

Each point is predicted from those before it. What is left, in units of its standard deviation, is white, and takes half
the time of a product with the inverse of the covariance, which is not symmetric in its factors.
"""

from dataclasses import dataclass
from itertools import accumulate
from typing import Self

import numpy as np
from scipy.linalg.lapack import dtbtrs

from ...models.base.arrays import Reals


@dataclass(frozen=True, eq=False)
class RoughFilter:
    """The filter of one recording, in units of its white noise: K = 1 + A T^-1 A as in `point_covariance`."""

    amplitude: Reals
    """Size A of the error at each point, shape (N,)."""
    gain: Reals
    """Next prediction per reading, shape (N-1,)."""
    memory: Reals
    """Unit lower bidiagonal matrix that predictions are multiplied by, in LAPACK's band storage, shape (2, N)."""
    deviation: Reals
    """Standard deviation of what is left of each point, shape (N,)."""

    @classmethod
    def of(cls, amplitude: Reals, step: Reals, between: Reals) -> Self:
        """Return the filter; `step`: correlation of neighbours, `between`: variance that is new, both (N-1,)."""
        rows = zip((step**2).tolist(), (amplitude[:-1] ** 2).tolist(), between.tolist(), strict=True)
        predicted = np.array(list(accumulate(rows, _next_variance, initial=1.0)))
        variance = 1 + amplitude**2 * predicted
        memory = np.ones((2, amplitude.size), order="F")
        memory[1, :-1] = -step / variance[:-1]
        gain = step * (predicted * amplitude / variance)[:-1]
        return cls(amplitude, gain, memory, np.sqrt(variance))

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of K."""
        return 2 * float(np.sum(np.log(self.deviation)))

    def whitened(self, X: Reals) -> Reals:
        """Return L^-1 X along the last axis, L L^T = K."""
        predictions = np.zeros_like(X)
        np.multiply(self.gain, X[..., :-1], out=predictions[..., 1:])
        if X.size:
            columns = predictions.reshape(-1, X.shape[-1]).T
            solved, _ = dtbtrs(self.memory, columns, uplo="L", diag="U", overwrite_b=1)
            predictions = np.asarray(solved.T, np.float64).reshape(X.shape)
        predictions *= -self.amplitude
        predictions += X
        predictions *= 1 / self.deviation
        return predictions


def _next_variance(variance: float, row: tuple[float, float, float]) -> float:
    """Return the variance of the next prediction of the error of unit size."""
    squared_step, squared_amplitude, between = row
    return squared_step * variance / (1 + squared_amplitude * variance) + between
