"""Effects at the terminals that are known beforehand, because other samples of the same bench have shown them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Complexes, Impedances
from ....models.effects import Device, Effect, EffectParameter, catalogue
from ....models.effects.base.assembly import Assembly
from ....models.effects.base.effect import TERMINALS, Stage
from ....models.stack import Stack
from ...error_model.prior_scales import FIXTURE
from .problem import Problem

FIXTURE_UNITS = dict(zip(FIXTURE, ("H", "ohm", "ohm", "F", "S"), strict=True))


class FixtureResidue(Effect):
    """What open and short compensation left, of either sign: the error model's fixture beyond first order."""

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
class KnownEffect:
    """An effect at the terminals with the values of its parameters."""

    name: str
    values: Mapping[str, float]


def with_known(problem: Problem, known: Sequence[KnownEffect]) -> Problem:
    """Return the problem of devices that have these effects at their terminals."""
    by_name = {one.name: one for one in (*catalogue(), FixtureResidue())}
    recordings = problem.recordings
    for one in known:
        recordings = tuple(
            replace(own, model=own.model.with_effect(by_name[one.name], TERMINALS, one.values))
            if isinstance(own.model, Device)
            else own
            for own in recordings
        )
    return replace(problem, recordings=recordings)
