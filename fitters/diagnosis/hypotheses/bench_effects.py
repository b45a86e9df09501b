"""Effects at the terminals that are known from other samples of the same bench."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ....models.effects import Device, catalogue
from ....models.effects.base.effect import TERMINALS
from ...engine.recording import Recording
from .problem import Problem


@dataclass(frozen=True)
class BenchEffect:
    """An effect at the terminals with the values of its parameters."""

    name: str
    values: Mapping[str, float]


def with_bench_effects(problem: Problem, known: Sequence[BenchEffect]) -> Problem:
    """Return the problem of devices that have these effects at their terminals."""
    by_name = {one.name: one for one in catalogue()}

    def behind(own: Recording) -> Recording:
        device = own.model
        for one in known:
            if isinstance(device, Device):
                device = device.with_effect(by_name[one.name], TERMINALS, one.values)
        return replace(own, model=device)

    return replace(problem, recordings=tuple(map(behind, problem.recordings)))
