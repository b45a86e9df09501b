"""`temperature-drift`: the device drifts while the sweep runs, or between segments."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..base.arrays import Complexes, Frequencies, Impedances, Reals
from ..stack import Stack
from .base.assembly import Assembly, ParallelSection
from .base.effect import SWEEP, Effect, EffectParameter, Stage
from .base.scale import active

_FEW, _MANY = 3, 6
"""Number of instants at which the drifting device is evaluated; between them ln Z is a polynomial in time."""
_OVER = 1e-9
"""Part of the drift below which nothing more of it happens during a sweep: one instant stands for all."""
_SLIGHT = 0.05
"""Largest drift, in half linewidths, for which few instants suffice."""
_STEADY = 1e3
"""Time constant, in sweeps, of a drift that is steady."""


class TemperatureDrift(Effect):
    """Resonance frequencies and permittivity drift, steadily or towards an end; a downward sweep sees that in reverse.

    The constants refer to the beginning of the step's first sweep, where the device is as in the other steps.
    """

    name = "temperature-drift"
    stage = Stage.ACQUISITION
    sizes = 2
    says = "The device drifted while the sweep ran: the later points belong to a warmer (or colder) device."
    separates = "sweep up and down, or wait until two sweeps agree"
    references = ("left-out physics 4.4; vendors state 50-1200 ppm/K for the resonance of soft PZT",)

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

        def drifting(device: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            tau = np.expm1(-device.conditions.elapsed(frequency.size) / time) / np.expm1(-1 / time)
            drifts = _drifts(device.nominal, 2 * speed, permittivity)
            nodes = np.polynomial.chebyshev.chebpts1(_instants(device.nominal, speed, np.ptp(tau)))
            instants = np.mean([tau[0], tau[-1]]) + nodes * np.ptp(tau) / 2

            def at(instant: float) -> Impedances:
                factors = [1 + relative * instant for relative in drifts.values()]
                moved = tuple(_moved(part, list(drifts), factors) for part in device.parts)
                return replace(device, parts=moved).steady(frequency)

            steady = Z if len(device.records) == 1 else device.steady(frequency)
            courses = np.array([np.log(at(float(instant)) / steady) for instant in instants])
            return Z * np.exp(_between(tau, instants, courses))

        return assembly.recorded(drifting)


def _instants(stack: Stack, speed: float, lasting: float) -> int:
    """Return the number of instants needed for the drift of the lines in half widths."""
    if lasting < _OVER:
        return 1
    c33D = active(stack).c33D
    return _FEW if abs(speed) * lasting < _SLIGHT * c33D.imag / (2 * c33D.real) else _MANY


def _moved(part: ParallelSection, names: Sequence[str], factors: Sequence[float]) -> ParallelSection:
    """Return the part with these parameters times their factors."""
    now = part.stack.parameters()
    moved = {parameter: now[parameter] * factors[k] for k, parameter, _ in part.moved_by(names)}
    return replace(part, stack=part.stack.replace(moved))


def _between(tau: Reals, instants: Reals, courses: Complexes) -> Complexes:
    """Interpolate `courses`, shape (K, N), given at K instants, to each point's own instant tau, shape (N,)."""
    interpolated = np.zeros(tau.size, np.complex128)
    for k, course in enumerate(courses):
        others = np.delete(instants, k)
        interpolated += course * np.prod((tau[:, None] - others) / (instants[k] - others), axis=1)
    return interpolated


def _drifts(stack: Stack, stiffness: float, permittivity: float) -> dict[str, float]:
    """Return the relative drift of each parameter; both parts of a complex constant drift alike."""
    piezo = active(stack).name
    return {f"{piezo}.c33D.{part}": stiffness for part in ("re", "im")} | {
        f"{piezo}.eps33S.{part}": permittivity for part in ("re", "im")
    }


EFFECT = TemperatureDrift()
