"""The result of a comparison, in the form of a diagnosis as far as the contents agree."""

from dataclasses import dataclass
from typing import Literal

from ...models.base.arrays import Frequencies, Impedances
from ..diagnosis.findings import Bands, Finding, Remaining, Size

Verdict = Literal["unchanged", "explained", "partly-explained", "unexplained"]


@dataclass(frozen=True)
class ChangeFinding(Finding):
    """A change between the recordings."""

    removed: bool = False
    """Whether it was present before and was removed."""


@dataclass(frozen=True)
class DescribedBy:
    """The build with which changes inside of the device were sought."""

    build: str
    step: str
    rms_log_error: float
    """Of the model fitted to the recording before: what cancels, because it is the same afterwards."""


@dataclass(frozen=True)
class Limit:
    """Largest size of an undetected change."""

    effect: str
    where: str
    upper_limit: dict[str, Size]
    """At 95 %; `u` is the standard uncertainty from which the limit follows."""


@dataclass(frozen=True)
class Repeatability:
    """The difference of the recordings in a band."""

    band_Hz: tuple[float, float]
    magnitude: float
    """Root mean square of ln |Z|."""
    phase: float
    """Root mean square, rad."""
    noise: float
    """The contribution of both recordings' noise to either."""


@dataclass(frozen=True)
class ResonanceShift:
    """A resonance common to both recordings."""

    frequency_Hz: float
    """Before."""
    q: float
    shift: float
    """Relative change of its frequency."""
    u_shift: float
    q_ratio: float
    """Q after over Q before."""
    u_q_ratio: float
    strength_ratio: float
    u_strength_ratio: float


@dataclass(frozen=True, eq=False)
class ComparedCurve:
    """Both recordings in their common range, and the first one transformed by the findings."""

    frequency: Frequencies
    before: Impedances
    after: Impedances
    explained: Impedances


@dataclass(frozen=True, eq=False)
class Comparison:
    """The changes between two recordings, with probabilities."""

    verdict: Verdict
    probability: float
    """Probability of the verdict's explanation, or of no change; of something else if unexplained."""
    change: float
    """Root mean square of ln(after/before)."""
    findings: tuple[ChangeFinding, ...]
    """From the device to the analyzer."""
    limits: tuple[Limit, ...]
    repeatability: tuple[Repeatability, ...]
    resonances: tuple[ResonanceShift, ...]
    remaining: Remaining
    chi2_per_dof_before: float
    chi2_per_dof_after: float
    held_out_before: float
    held_out_after: float
    held_out_Hz: Bands
    says: tuple[str, ...]
    curve: ComparedCurve
    seconds: float
    leftover_Hz: Bands = ()
    """Bands in which the findings leave more than two recordings usually differ by; none if they explain the change."""
    remarks: tuple[ChangeFinding, ...] = ()
    """Fitting changes that move no point by more than the usual difference of two recordings of one device."""
    described_by: DescribedBy | None = None
    """None if no build was given."""
