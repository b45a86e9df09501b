"""`sweep-lag`: swept faster than the resonance settles (bandwidth too wide for Q)."""

from collections.abc import Mapping

import numpy as np

from ..arrays import Frequencies, Impedances
from ..stack import Stack
from .assembly import Assembly
from .effect import SWEEP, Effect, Knob, Stage
from .scale import resonance


class SweepLag(Effect):
    """What is read at f is Z at a frequency that was passed a moment ago: below f upwards, above f downwards."""

    name = "sweep-lag"
    stage = Stage.RECORD
    says = "The sweep was too fast: each point was read before the device had settled."
    separates = "sweep up and down, halve the rate or narrow the bandwidth"
    references = ("left-out physics 4.1: Y(f - rate tau), tau the longer of Q/(pi f) and the filter's settling",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `sweep`."""
        return (SWEEP,)

    def knobs(self, stack: Stack, where: str) -> tuple[Knob, ...]:
        """Return by how many hertz the reading lags in the step's first sweep: its rate times the time to settle."""
        f0 = resonance(stack)
        return (Knob("lag", "Hz", typical=1e-4 * f0, upper=0.1 * f0),)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as such a sweep records it."""
        ran = assembly.conditions
        lag = values["lag"] * ran.pace * (1 if ran.direction == "up" else -1)
        if lag == 0:
            return assembly

        def late(device: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            steps = np.gradient(frequency)  # a sweep takes as long for each point, so it is fastest where they are wide
            past = np.maximum(frequency - lag * steps / np.mean(steps), 0.5 * frequency)
            return Z * (device.steady(past) / device.steady(frequency))

        return assembly.recorded(late)


EFFECT = SweepLag()
