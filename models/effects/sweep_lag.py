"""`sweep-lag`: the sweep is faster than the resonance settles (bandwidth too wide for Q)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..stack import Stack
from .base.assembly import Assembly, Record
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.scale import resonance

_MANY, _FEW = np.polynomial.laguerre.laggauss(6), np.polynomial.laguerre.laggauss(3)
"""Delays in time constants, and weights of the exponential memory (Gauss-Laguerre quadrature): for readings, and for
their derivatives."""


class SweepLag(Effect):
    """The reading at f is Y at frequencies passed a moment ago: below f in upward sweeps, above f in downward ones.

    The part `memory` of the reading decays exponentially, as in a settling filter; the rest is delayed without change.
    """

    name = "sweep-lag"
    stage = Stage.ACQUISITION
    says = "The sweep was too fast: each point was read before the device had settled."
    separates = "sweep up and down, halve the rate or narrow the bandwidth"
    references = (
        "Hok, J. Appl. Phys. 19 (1948) 242 (resonant systems under a frequency that varies linearly with time)",
    )

    @property
    def outside(self) -> bool:
        """It only delays the reading."""
        return True

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `sweep`."""
        return (SWEEP,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the lag of the reading in the step's first sweep in hertz (its rate times the settling time).

        The second parameter is the part of it that settles exponentially.
        """
        f0 = resonance(stack)
        return (
            EffectParameter("lag", "Hz", typical=1e-4 * f0, upper=0.1 * f0),
            EffectParameter("memory", "1", typical=0.5, lower=0.0, upper=1.0, null=0.5),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by such a sweep."""
        ran = assembly.conditions
        lag, memory = values["lag"] * ran.pace * (1 if ran.direction == "up" else -1), values["memory"]
        if lag == 0:
            return assembly

        return assembly.recorded(_Late(lag, memory))


@dataclass(frozen=True, eq=False)
class _Late(Record):
    """Readings of Y at frequencies passed a moment ago."""

    lag: float
    """Hz, of a sweep of the mean rate."""
    memory: float

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return Z as read over Z, shape (N,)."""
        then, weights = self._then(device, frequency, _MANY)
        # all at once: a stack takes hardly longer for many points than for few
        read = weights @ (1 / device.steady(then.ravel())).reshape(then.shape)
        return 1 / (read * device.steady(frequency))

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter, shape (P, N)."""
        then, weights = self._then(device, frequency, _FEW)
        Z, slopes = device.steady_jacobian(then.ravel(), names)
        Y, slopes = weights[:, None] / Z.reshape(then.shape), slopes.reshape(len(names), *then.shape)
        return np.einsum("kn,pkn->pn", Y / np.sum(Y, axis=0), slopes) - at_rest

    def _then(
        self, device: Assembly, frequency: Frequencies, quadrature: tuple[Reals, Reals]
    ) -> tuple[Frequencies, Reals]:
        """Return the frequencies that count at each point, shape (K, N), and their weights, shape (K,)."""
        ago, weights = quadrature
        ago = np.array([*([1.0] if self.memory < 1 else []), *(ago if self.memory > 0 else [])])
        weights = np.array(
            [*([1 - self.memory] if self.memory < 1 else []), *(self.memory * weights if self.memory > 0 else [])]
        )
        behind = self.lag * device.conditions.rate(frequency)
        return np.maximum(frequency - ago[:, None] * behind, 0.5 * frequency), weights


EFFECT = SweepLag()
