"""`temperature-drift`: the device drifts while the sweep runs, or between segments."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..stack import Piezo, Stack
from .base.assembly import Assembly, ParallelSection, Record
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.modified_laws import Factor
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

        return assembly.recorded(_Drifting(2 * speed, permittivity, time))


@dataclass(frozen=True, eq=False)
class _Drifting(Record):
    """Every point is that of a device at its own instant: constants that depend on frequency in this sweep."""

    stiffness: float
    """Relative change over the step's first sweep."""
    permittivity: float
    time: float
    """Time constant, in durations of that sweep."""

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return Z as recorded over Z, shape (N,)."""
        steady = device.steady(frequency)
        return self._moved(device, frequency).steady(frequency) / steady

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter, shape (P, N)."""
        return self._moved(device, frequency).steady_jacobian(frequency, names)[1] - at_rest

    def _moved(self, device: Assembly, frequency: Frequencies) -> Assembly:
        """Return the device with what its constants are at each point."""
        tau = np.expm1(-device.conditions.elapsed(frequency.size) / self.time) / np.expm1(-1 / self.time)
        factors = _complex(1 + self.stiffness * tau), _complex(1 + self.permittivity * tau)
        stiffness = f"{active(device.nominal).name}.c33D.re"

        def moved(part: ParallelSection) -> ParallelSection:
            # a layer that an effect has cut in two drifts as a whole
            own = {name.partition(".")[0] for _, name, _ in part.moved_by([stiffness])}
            return replace(part, stack=_with_factors(part.stack, own, *factors))

        return device.with_parts(tuple(map(moved, device.parts)))


def _with_factors(stack: Stack, names: Collection[str], stiffness: Complexes, permittivity: Complexes) -> Stack:
    """Return a stack whose piezoelectric layers of these names have constants times these factors, shape (N,)."""
    layers = (
        replace(layer, c_law=Factor(layer.c_law, stiffness), eps_law=Factor(layer.eps_law, permittivity))
        if isinstance(layer, Piezo) and layer.name in names
        else layer
        for layer in stack.layers
    )
    return replace(stack, layers=tuple(layers))


def _complex(values: Reals) -> Complexes:
    return np.asarray(values, np.complex128)


EFFECT = TemperatureDrift()
