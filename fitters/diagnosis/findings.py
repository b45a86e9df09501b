"""Results of a diagnosis: the content of `pzctl diagnose --json`, and the data for its figures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ...models.build import EffectSpec
from ..interface import Constant, Curve
from .data_quality.data_issues import DataCheck

Verdict = Literal["no-mismatch", "explained", "partly-explained", "unexplained"]
Bands = tuple[tuple[float, float], ...]
_BORNE_OUT = 1.6
"""Misfit per degree of freedom up to which another sample confirms the findings completely."""
_SHOWN_OFF = 2
"""Values of the build whose deviations a sentence tells; the JSON has all."""


@dataclass(frozen=True)
class Size:
    """Estimate of one parameter of an effect."""

    value: float
    u: float
    unit: str


@dataclass(frozen=True)
class Alternative:
    """An effect that the recordings do not distinguish well enough from a finding."""

    effect: str
    where: str
    probability: float


@dataclass(frozen=True)
class Finding:
    """Physics that the model lacked."""

    effect: str
    where: str
    step: str
    probability: float
    bands_Hz: Bands
    """Bands of the misfit that the effect explains."""
    parameters: Mapping[str, Size]
    chi2_per_dof_before: float
    chi2_per_dof_after: float
    held_out_before: float
    held_out_after: float
    alternatives: tuple[Alternative, ...]
    says: str
    share: float = float("nan")
    """Part of the misfit that it explains."""
    same_as: tuple[Alternative, ...] = ()
    """Look-alikes that the recordings cannot distinguish from it."""
    moves: float = float("nan")
    """Rms of ln Z that constants and the other effects leave of it, when they imitate it as well as they can."""


@dataclass(frozen=True)
class Remaining:
    """Residual of ln Z, relative rms."""

    total: float
    instrument: float
    """Part of it that the instrument's own error accounts for, with the residual of the fixture."""
    device: float | None = None
    """Part of imperfections that every device has (losses that change over the band, weak resonances), and of errors of
    the effects' formulas."""
    build: float | None = None
    """Part of values that the build states without an uncertainty and that may be off all the same, mostly of glue."""
    off: Mapping[str, float] = field(default_factory=dict[str, float])
    """By how much the device's value of each differs, relative; the one that changes ln Z most first."""
    constants: float | None = None
    """Part of smooth errors of the model, as changes of its constants over frequency."""
    noise: float | None = None
    """What none of these explains: noise, and rough errors of the model."""

    @property
    def erring(self) -> bool:
        """Whether the errors of instrument, device and model together are larger than what is left as noise."""
        errors = sum((part or 0.0) ** 2 for part in (self.instrument, self.device, self.build, self.constants))
        return errors > (self.noise or 0.0) ** 2

    @property
    def says(self) -> str:
        """What is left as a sentence, largest part first."""
        parts = {
            "instrument and fixture": self.instrument,
            "losses that change over the band, weak resonances and formulas of effects": self.device,
            f"values that the build states without u (the device's {self._most_off})": self.build,
            "smooth errors of the model": self.constants,
            "noise": self.noise,
        }
        shown = sorted(((size, name) for name, size in parts.items() if size), reverse=True)
        causes = ", ".join(f"{name} {100 * size:.2g} %" for size, name in shown)
        return f"The fit leaves {100 * self.total:.2g} % of Z (rms). Its most probable causes: {causes}."

    @property
    def _most_off(self) -> str:
        changes = list(self.off.items())[:_SHOWN_OFF]
        return ", ".join(f"{name} {100 * change:+.2g} %" for name, change in changes)


@dataclass(frozen=True)
class CorrectionCurve:
    """A dimensionless correction over frequency with its standard uncertainty."""

    frequency_Hz: tuple[float, ...]
    re: tuple[float, ...]
    im: tuple[float, ...]
    u_re: tuple[float, ...]
    u_im: tuple[float, ...]


@dataclass(frozen=True)
class MismatchPlace:
    """A place of the model at which a smooth correction would explain what is left."""

    where: str
    quantity: str
    """`stiffness`, `permittivity`, `coupling`, `compliance`, `inertia`, `impedance`, `series` or `shunt`."""
    step: str
    probability: float
    says: str
    correction: CorrectionCurve


@dataclass(frozen=True)
class NotDecidable:
    """An effect that may be present undetected because the constants absorb it."""

    effect: str
    where: str
    upper_limit: Mapping[str, Size]
    shifts: Mapping[str, float]
    """Relative change of each constant that an effect of that size would cause; `NAME.im` for its imaginary part."""
    would_decide: str


@dataclass(frozen=True)
class FitSummary:
    """The fit before or after the effects were added."""

    chi2_per_dof: float
    held_out: float
    constants: Mapping[str, Constant]


@dataclass(frozen=True)
class Pole:
    """A resonance that would describe much of the residual."""

    frequency_Hz: float
    q: float
    capacitance: float
    """F; size of its residue, as the capacitance of a branch in parallel with the device."""
    takes: float
    """Decrease of chi2."""


@dataclass(frozen=True)
class Texture:
    """The residual as a Gaussian process over frequency."""

    amplitude: float
    """Standard deviation of Re and Im of ln Z."""
    length_Hz: float
    """Correlation length."""


@dataclass(frozen=True)
class Leftover:
    """Residual that nothing explains."""

    bands_Hz: Bands
    """Bands with more than noise, most significant first."""
    chi2_per_dof: float
    step: str
    """Step with the largest residual; poles and texture describe its worst recording."""
    poles: tuple[Pole, ...]
    texture: Texture | None
    """None where only noise is left."""


@dataclass(frozen=True)
class OtherSample:
    """Test of the findings on another sample."""

    sample: str
    steps: tuple[str, ...]
    effects: tuple[str, ...]
    """Findings that have a place in its steps."""
    chi2_per_dof_before: float
    """Misfit per degree of freedom without effects, with the sample's own constants free."""
    chi2_per_dof_after: float
    """The same with the effects, whose sizes have the first sample's posterior as their prior."""

    @property
    def says(self) -> str:
        """The result as a sentence."""
        if not self.effects:
            return f"None of the effects found can be tested on sample {self.sample}."
        names = " and ".join(self.effects)
        fall = f"with its own constants free, chi2/dof {self.chi2_per_dof_before:.3g} -> {self.chi2_per_dof_after:.3g}"
        if max(self.chi2_per_dof_before, self.chi2_per_dof_after) < _BORNE_OUT:
            return f"Sample {self.sample} neither confirms nor contradicts {names}: {fall}."
        if self.chi2_per_dof_after >= self.chi2_per_dof_before:
            return f"Sample {self.sample} contradicts {names} as found here: {fall}."
        shown = "confirms this" if self.chi2_per_dof_after < _BORNE_OUT else "confirms part of this"
        return f"Sample {self.sample} {shown}: with {names} as found here, {fall}."


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Result of a diagnosis: where and why model and recording differ."""

    verdict: Verdict
    baseline: FitSummary
    final: FitSummary
    findings: tuple[Finding, ...]
    """Largest effect first."""
    not_decidable: tuple[NotDecidable, ...]
    leftover: Leftover
    says: tuple[str, ...]
    before: tuple[Curve, ...]
    """Measured and baseline curves; `start` is the baseline too."""
    after: tuple[Curve, ...]
    data: tuple[DataCheck, ...]
    """Data checks, one per recording."""
    seconds: float
    held_out_Hz: tuple[Bands, ...] = ()
    """Held-out bands of each recording, in the order of `before` and `after`."""
    others: tuple[OtherSample, ...] = ()
    remaining: Remaining | None = None
    remarks: tuple[Finding, ...] = ()
    """Findings that move no constant by its uncertainty and no point by more than the instrument's error."""
    places: tuple[MismatchPlace, ...] = ()
    """Where the physics that no effect of the catalogue describes acts, most probable place first."""
    effects: tuple[EffectSpec, ...] = ()
    """The findings as a build states them: those that a fit can use."""
    exact: bool = False
    """Whether the most probable explanation has no error but white noise, as of a simulation."""
