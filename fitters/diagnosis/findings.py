"""What a diagnosis answers: DESIGN's `pzctl diagnose --json`, and what its pictures need."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ..interface import Constant, Curve
from .data_quality.data_issues import DataCheck

Verdict = Literal["no-mismatch", "explained", "partly-explained", "unexplained"]
Bands = tuple[tuple[float, float], ...]
_BORNE_OUT = 1.6
"""Misfit per degree of freedom up to which another sample shows what was found, and nothing else."""


@dataclass(frozen=True)
class Size:
    """A parameter of an effect as it was found."""

    value: float
    u: float
    unit: str


@dataclass(frozen=True)
class Alternative:
    """An effect that this recording cannot tell apart well enough."""

    effect: str
    where: str
    probability: float


@dataclass(frozen=True)
class Finding:
    """Physics that was left out."""

    effect: str
    where: str
    step: str
    probability: float
    bands_Hz: Bands
    """Where the mismatch that it explains sits."""
    parameters: Mapping[str, Size]
    chi2_per_dof_before: float
    chi2_per_dof_after: float
    held_out_before: float
    held_out_after: float
    alternatives: tuple[Alternative, ...]
    says: str
    share: float = float("nan")
    """Part of the misfit that it takes."""
    same_as: tuple[Alternative, ...] = ()
    """Look-alikes that the recordings cannot tell from it."""
    moves: float = float("nan")
    """What it does to ln Z that no constant could do, root mean square."""


@dataclass(frozen=True)
class Remaining:
    """What is left of ln Z, root mean square, relative."""

    total: float
    instrument: float
    """How much of it the instrument's own error accounts for."""


@dataclass(frozen=True)
class NotDecidable:
    """An effect that may be there unseen, because the constants absorb it."""

    effect: str
    where: str
    upper_limit: Mapping[str, Size]
    shifts: Mapping[str, float]
    """Relative change of each constant that an effect of that size would cause; `NAME.im`: of its imaginary part."""
    would_decide: str


@dataclass(frozen=True)
class Fitted:
    """One side of before and after."""

    chi2_per_dof: float
    held_out: float
    constants: Mapping[str, Constant]


@dataclass(frozen=True)
class Pole:
    """A resonance that would describe much of what is left."""

    frequency_Hz: float
    q: float
    capacitance: float
    """F; size of its residue as that of a branch beside the device."""
    takes: float
    """Fall of chi2."""


@dataclass(frozen=True)
class Texture:
    """What is left, as a Gaussian process over frequency."""

    amplitude: float
    """Standard deviation of Re and Im of ln Z."""
    length_Hz: float
    """Correlation length."""


@dataclass(frozen=True)
class Leftover:
    """What nothing explains."""

    bands_Hz: Bands
    """With more in them than noise, the surest first."""
    chi2_per_dof: float
    step: str
    """Where most is left; poles and texture are of the worst recording of this step."""
    poles: tuple[Pole, ...]
    texture: Texture | None
    """None where there is nothing but noise."""


@dataclass(frozen=True)
class OtherSample:
    """What another sample says of effects that were found in the first."""

    sample: str
    steps: tuple[str, ...]
    effects: tuple[str, ...]
    """Those of the findings that have a place in its steps."""
    chi2_per_dof_before: float
    """Misfit per degree of freedom without effects, its own constants free."""
    chi2_per_dof_after: float
    """The same with the effects as large as they were found in the first sample, no more uncertain than there."""

    @property
    def says(self) -> str:
        """A sentence for people."""
        if not self.effects:
            return f"Nothing was found here that sample {self.sample} could bear out."
        names = " and ".join(self.effects)
        fall = f"its own constants free, chi2/dof {self.chi2_per_dof_before:.3g} -> {self.chi2_per_dof_after:.3g}"
        if max(self.chi2_per_dof_before, self.chi2_per_dof_after) < _BORNE_OUT:
            return f"Sample {self.sample} cannot tell whether it has {names}: {fall}."
        if self.chi2_per_dof_after >= self.chi2_per_dof_before:
            return f"Sample {self.sample} does not have {names} as found here: {fall}."
        shown = "bears it out" if self.chi2_per_dof_after < _BORNE_OUT else "bears part of it out"
        return f"Sample {self.sample} {shown}: with {names} as found here, {fall}."


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Where model and recording differ, and why."""

    verdict: Verdict
    baseline: Fitted
    final: Fitted
    findings: tuple[Finding, ...]
    """In the order of their weight."""
    not_decidable: tuple[NotDecidable, ...]
    leftover: Leftover
    says: tuple[str, ...]
    before: tuple[Curve, ...]
    """Measured and fitted by the baseline; `start` is the baseline too."""
    after: tuple[Curve, ...]
    data: tuple[DataCheck, ...]
    """What the gates found of each recording."""
    seconds: float
    held_out_Hz: tuple[Bands, ...] = ()
    """By recording, as `before` and `after`: where it took no part in the fits that prove the explanation."""
    others: tuple[OtherSample, ...] = ()
    remaining: Remaining | None = None
    remarks: tuple[Finding, ...] = ()
    """Findings that move no constant by its uncertainty and no point by more than the instrument's error."""
