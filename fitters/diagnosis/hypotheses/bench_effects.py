"""Effects at the terminals that are known from other samples of the same bench."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Complexes, Impedances
from ....models.effects import Device, Effect, EffectParameter, catalogue
from ....models.effects.base.assembly import Assembly
from ....models.effects.base.effect import TERMINALS, Stage
from ....models.stack import Stack
from ...engine.recording import Recording
from ...error_model.prior_scales import FIXTURE
from .problem import Problem

FIXTURE_UNITS = dict(zip(FIXTURE, ("H", "ohm", "ohm", "F", "S"), strict=True))


class FixtureResidue(Effect):
    """Residual of open and short compensation, of either sign: the error model's fixture beyond first order."""

    name = "fixture-residual"
    stage = Stage.CABLE
    says = "Open and short compensation left a residue."
    separates = "compensate again, and sweep open and short"
    references = ("Keysight Impedance Measurement Handbook, section 4",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the parts of the residue, with their prior scales."""
        return tuple(
            EffectParameter(name, FIXTURE_UNITS[name], scale, lower=-np.inf) for name, scale in FIXTURE.items()
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the shunt, behind the series impedance."""

        def through(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            Y = values["conductance"] + jw * values["capacitance"]
            skin = values["skin"] * (1 + 1j) * np.sqrt(jw.imag / (2e6 * np.pi))
            return Z / (1 + Z * Y) + values["resistance"] + skin + jw * values["inductance"], 1 / (1 + Z * Y) ** 2

        return assembly.behind(through)


@dataclass(frozen=True)
class BenchEffect:
    """An effect at the terminals with the values of its parameters."""

    name: str
    values: Mapping[str, float]


def with_bench_effects(problem: Problem, known: Sequence[BenchEffect]) -> Problem:
    """Return the problem of devices that have these effects at their terminals."""
    by_name = {one.name: one for one in (*catalogue(), FixtureResidue())}

    def behind(own: Recording) -> Recording:
        device = own.model
        for one in known:
            if isinstance(device, Device):
                device = device.with_effect(by_name[one.name], TERMINALS, one.values)
        return replace(own, model=device)

    return replace(problem, recordings=tuple(map(behind, problem.recordings)))
