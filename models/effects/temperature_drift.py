"""`temperature-drift`: the device drifts while the sweep runs, or between segments."""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Reals
from ..stack import Stack
from .base.assembly import Assembly
from .base.drifting import Course, Drifting
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.scale import active

_STEADY = 1e3
"""Time constant, in sweeps, of a drift that is steady."""


class TemperatureDrift(Effect):
    """Resonance frequencies and permittivity drift, steadily or towards an end; a downward sweep sees that in reverse.

    The constants refer to the beginning of the step's first sweep, where the device is as in the other steps.
    """

    name = "temperature-drift"
    stage = Stage.ACQUISITION
    sizes = 2
    errs_in_time = True
    says = "The device drifted while the sweep ran: the later points belong to a warmer (or colder) device."
    separates = "sweep up and down, or wait until two sweeps agree"
    references = ("vendors state 50-1200 ppm/K for the resonance of soft PZT",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `sweep`."""
        return (SWEEP,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the relative drift of resonance frequencies and of permittivity over one sweep, and its time constant.

        The time constant is in durations of the step's first sweep: what was touched or moved takes on the temperature
        of its surroundings exponentially.
        """
        return (
            EffectParameter("relative", "1", typical=2e-4, lower=-0.05, upper=0.05, prior=(0.0, 1e-3)),
            EffectParameter("permittivity", "1", typical=1e-3, lower=-0.2, upper=0.2, prior=(0.0, 3e-3)),
            EffectParameter("time", "1", typical=1.0, lower=0.1, upper=_STEADY, null=_STEADY, scan=(0.7, 7.0)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by a sweep during the drift."""
        speed, permittivity, time = values["relative"], values["permittivity"], values.get("time", _STEADY)
        if speed == 0 and permittivity == 0:
            return assembly

        def course(elapsed: Reals) -> Reals:
            return np.asarray(np.expm1(-elapsed / time) / np.expm1(-1 / time), np.float64)

        courses: Mapping[str, Course] = {
            "stiffness": lambda elapsed: 2 * speed * course(elapsed),
            "permittivity": lambda elapsed: permittivity * course(elapsed),
        }
        return assembly.recorded(Drifting(active(assembly.nominal).name, courses))


EFFECT = TemperatureDrift()
