"""What all samples of a bench share, as it is told."""

from collections.abc import Mapping
from dataclasses import dataclass

from ...models.build import EffectSpec, Quantity
from ...models.effects.base.effect import TERMINALS
from ...models.effects.fixture_residual import EFFECT as FIXTURE_RESIDUAL
from ..diagnosis.findings import Size
from ..diagnosis.hypotheses.bench_effects import BenchEffect


@dataclass(frozen=True)
class FixturePart(Size):
    """A part of the residual of open and short compensation."""

    probability: float
    """Probability that it is present."""


@dataclass(frozen=True)
class SharedEffect:
    """An effect that all samples share."""

    effect: str
    probability: float
    parameters: Mapping[str, Size]
    scatter: Mapping[str, float]
    """Posterior probability of each relative scatter of its size from sample to sample."""
    gain: float
    """ln evidence over all samples relative to the best explanation without it."""
    alone: Mapping[str, float]
    """ln evidence of it in each sample alone, by sample, as in a single diagnosis."""
    sizes: Mapping[str, tuple[float, float]]
    """Estimate of its size from each sample alone, with standard uncertainty."""
    alternatives: Mapping[str, float]
    """Probability of other effects in its place."""
    within_fixture: bool
    """Whether it is no larger than the usual residual of a compensation."""


@dataclass(frozen=True)
class SharedBench:
    """Everything that all samples share."""

    effects: tuple[SharedEffect, ...]
    known: tuple[BenchEffect, ...]
    """The same with the values of all parameters, and the fixture's residual, as prior knowledge for every sample."""
    fixture: Mapping[str, FixturePart]
    """Residual of open and short compensation, common to all samples; empty if there is no sign of one."""
    gain: float
    """Largest common gain error |d ln Z| beyond what constants could do, within the specification."""
    phase: float
    """The same of the phase, rad."""
    model_error: Mapping[str, float]
    """Sizes of the model's own error, common to all samples."""
    not_shared: tuple[str, ...]
    """Effects that would explain much, but with a different size in each sample."""

    @property
    def stated(self) -> tuple[EffectSpec, ...]:
        """Everything that all samples share as a build states it."""
        sizes: dict[str, Mapping[str, Size]] = {one.effect: one.parameters for one in self.effects}
        if self.fixture:
            sizes[FIXTURE_RESIDUAL.name] = self.fixture
        return tuple(
            EffectSpec(
                name, TERMINALS, {key: Quantity(one.value, u=one.u, source="diagnosis") for key, one in of.items()}
            )
            for name, of in sizes.items()
        )
