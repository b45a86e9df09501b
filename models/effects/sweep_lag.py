"""`sweep-lag`: swept faster than the resonance settles (bandwidth too wide for Q)."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Frequencies, Impedances
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.scale import resonance

_AGO, _WEIGHTS = np.polynomial.laguerre.laggauss(6)
"""How long ago, in time constants, and how much what was there then still counts."""


class SweepLag(Effect):
    """What is read at f is Y at frequencies that were passed a moment ago: below f upwards, above f downwards.

    Of the reading, the part `memory` forgets exponentially, as a filter does that settles; the rest comes late as it
    was.
    """

    name = "sweep-lag"
    stage = Stage.ACQUISITION
    says = "The sweep was too fast: each point was read before the device had settled."
    separates = "sweep up and down, halve the rate or narrow the bandwidth"
    references = ("left-out physics 4.1: Y(f - rate tau), tau the longer of Q/(pi f) and the filter's settling",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `sweep`."""
        return (SWEEP,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return by how many hertz the reading lags in the step's first sweep (its rate times the time to settle).

        And the part of it that settles exponentially.
        """
        f0 = resonance(stack)
        return (
            EffectParameter("lag", "Hz", typical=1e-4 * f0, upper=0.1 * f0),
            EffectParameter("memory", "1", typical=0.5, lower=0.0, upper=1.0, null=0.5),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as such a sweep records it."""
        ran = assembly.conditions
        lag, memory = values["lag"] * ran.pace * (1 if ran.direction == "up" else -1), values["memory"]
        if lag == 0:
            return assembly

        ago = np.array([*([1.0] if memory < 1 else []), *(_AGO if memory > 0 else [])])
        weights = np.array([*([1 - memory] if memory < 1 else []), *(memory * _WEIGHTS if memory > 0 else [])])

        def late(device: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            steps = np.gradient(frequency)  # a sweep takes as long for each point, so it is fastest where they are wide
            behind = lag * steps / np.mean(steps)
            then = np.maximum(frequency - ago[:, None] * behind, 0.5 * frequency)
            # all at once: a stack takes hardly longer for many points than for few
            read = weights @ (1 / device.steady(then.ravel())).reshape(then.shape)
            return Z / (read * device.steady(frequency))

        return assembly.recorded(late)


EFFECT = SweepLag()
