"""What a comparison answers: the form of a diagnosis, where it has the same to say."""

from dataclasses import dataclass
from typing import Literal

from ...models.base.arrays import Frequencies, Impedances
from ..diagnosis.findings import Bands, Finding, Remaining, Size

Verdict = Literal["unchanged", "explained", "partly-explained", "unexplained"]


@dataclass(frozen=True)
class ChangeFinding(Finding):
    """Something that happened between the recordings."""

    removed: bool = False
    """Whether it was there before, and is no longer."""


@dataclass(frozen=True)
class Limit:
    """How large a change could be and yet not be seen."""

    effect: str
    where: str
    upper_limit: dict[str, Size]
    """At 95 %; `u` is the standard uncertainty from which the limit follows."""


@dataclass(frozen=True)
class Repeatability:
    """By how much the recordings differ in a band."""

    band_Hz: tuple[float, float]
    magnitude: float
    """Root mean square of ln |Z|."""
    phase: float
    """Root mean square, rad."""
    noise: float
    """What the noise of both recordings makes of either."""


@dataclass(frozen=True)
class ResonanceShift:
    """A resonance that both recordings have."""

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
    """Both recordings where they have frequencies in common, and what the findings make of the first."""

    frequency: Frequencies
    before: Impedances
    after: Impedances
    explained: Impedances


@dataclass(frozen=True, eq=False)
class Comparison:
    """What changed between two recordings, and how sure that is."""

    verdict: Verdict
    probability: float
    """Of the verdict's explanation, or of nothing having changed; of something else where it is unexplained."""
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
    remarks: tuple[ChangeFinding, ...] = ()
    """What fits, and moves no point by more than two recordings of one device may differ by."""
