"""`temperature-drift`: the device drifts while the sweep runs, or between segments."""

from collections.abc import Mapping

import numpy as np

from ..arrays import Frequencies, Impedances
from ..stack import Piezo, Stack
from .assembly import Assembly
from .effect import SWEEP, Effect, Knob, Stage


class TemperatureDrift(Effect):
    """Resonance frequencies and permittivity drift linearly with time; a downward sweep sees the opposite order.

    The constants are those at the beginning of the step's first sweep, where the device is as in the other steps.
    """

    name = "temperature-drift"
    stage = Stage.RECORD
    sizes = 2
    says = "The device drifted while the sweep ran: the later points belong to a warmer (or colder) device."
    separates = "sweep up and down, or wait until two sweeps agree"
    references = ("left-out physics 4.4; vendors state 50-1200 ppm/K for the resonance of soft PZT",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `sweep`."""
        return (SWEEP,)

    def knobs(self, stack: Stack, where: str) -> tuple[Knob, ...]:
        """Return the relative drift of resonance frequencies and of permittivity over one sweep."""
        return (
            Knob("relative", "1", typical=2e-4, lower=-0.05, upper=0.05),
            Knob("permittivity", "1", typical=1e-3, lower=-0.2, upper=0.2),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as a sweep during the drift records it."""
        speed, permittivity = values["relative"], values["permittivity"]
        if speed == 0 and permittivity == 0:
            return assembly

        def drifting(device: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            tau = device.conditions.elapsed(frequency.size)
            drifts = _drifts(device.nominal, 2 * speed, permittivity)
            now = device.stack.parameters()
            change = np.array([now[name] * relative for name, relative in drifts.items()])
            _, dlnZ = device.steady_jacobian(frequency, list(drifts))
            return Z * np.exp(tau * (change @ dlnZ))

        return assembly.recorded(drifting)


def _drifts(stack: Stack, stiffness: float, permittivity: float) -> dict[str, float]:
    """Return the relative drift of each parameter: both parts of a complex constant alike."""
    piezo = max((layer for layer in stack.layers if isinstance(layer, Piezo)), key=lambda layer: layer.thickness).name
    return {f"{piezo}.c33D.{part}": stiffness for part in ("re", "im")} | {
        f"{piezo}.eps33S.{part}": permittivity for part in ("re", "im")
    }


EFFECT = TemperatureDrift()
