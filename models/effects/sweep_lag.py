"""`sweep-lag`: the sweep is faster than the resonance settles (bandwidth too wide for Q)."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Frequencies, Impedances
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.scale import resonance

_AGO, _WEIGHTS = np.polynomial.laguerre.laggauss(6)
"""Delays in time constants, and weights of the exponential memory (Gauss-Laguerre quadrature)."""


class SweepLag(Effect):
    """The reading at f is Y at frequencies passed a moment ago: below f in upward sweeps, above f in downward ones.

    The part `memory` of the reading decays exponentially, as in a settling filter; the rest is delayed without change.
    """

    name = "sweep-lag"
    stage = Stage.ACQUISITION
    says = "The sweep was too fast: each point was read before the device had settled."
    separates = "sweep up and down, halve the rate or narrow the bandwidth"
    references = ("left-out physics 4.1: Y(f - rate tau), tau the longer of Q/(pi f) and the filter's settling",)

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

        ago = np.array([*([1.0] if memory < 1 else []), *(_AGO if memory > 0 else [])])
        weights = np.array([*([1 - memory] if memory < 1 else []), *(memory * _WEIGHTS if memory > 0 else [])])

        def late(device: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            behind = lag * device.conditions.rate(frequency)
            then = np.maximum(frequency - ago[:, None] * behind, 0.5 * frequency)
            # all at once: a stack takes hardly longer for many points than for few
            read = weights @ (1 / device.steady(then.ravel())).reshape(then.shape)
            return Z / (read * device.steady(frequency))

        return assembly.recorded(late)


EFFECT = SweepLag()
