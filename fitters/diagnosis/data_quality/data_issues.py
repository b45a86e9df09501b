"""What the gates found of a recording, in words that a technician understands."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal["step", "glitch", "not passive", "not causal", "too coarse", "not repeated"]


@dataclass(frozen=True)
class DataIssue:
    """Something that is not right with a recording."""

    kind: Kind
    band_Hz: tuple[float, float]
    seconds: float | None = None
    """When it happened, since the sweep began; None where the sweep's pace is not known."""
    size: float | None = None
    """Relative height of a step or glitch; points per linewidth where they are too coarse; chi2 between repeats."""

    @property
    def says(self) -> str:
        """One sentence."""
        low, high = self.band_Hz
        place = (
            f"at {high / 1e6:.4g} MHz" if high - low < 0.01 * high else f"from {low / 1e6:.4g} to {high / 1e6:.4g} MHz"
        )
        when = "" if self.seconds is None else f", {self.seconds:.3g} s after the sweep began"
        size = "" if self.size is None else f"{100 * self.size:.2g} %"
        count = f"{self.size or 0:.2g}"
        few = f"{count} point" if count == "1" else f"{count} points"
        return {
            "step": f"it jumps by {size} {place}{when} (a range switch or a contact); the jump was taken out",
            "glitch": f"a glitch of {size} {place}{when}; its points were left out",
            "not passive": f"Re Z is negative beyond noise {place}, as if it gave energy; check the compensation",
            "not causal": f"{place} no linear device at rest was found to look like this: driven too hard, swept too "
            "fast, drifting, disturbed, or a great many resonances",
            "too coarse": f"only {few} within the width of the resonance {place}; take more",
            "not repeated": f"{place} this sweep differs from the one before it by more than noise",
        }[self.kind]


@dataclass(frozen=True)
class DataCheck:
    """One recording's data, before any physics."""

    step: str
    index: int
    """Which of the step's recordings, from 0."""
    points: int
    noise: float | None = None
    """Relative, of Re and Im of ln Z; None where there are too few points to tell."""
    causal_chi2_per_dof: float | None = None
    """Misfit of the best causal, linear, time-invariant device, whatever it may be made of."""
    points_per_linewidth: float | None = None
    """Of the sharpest resonance in the band."""
    turned: str = ""
    """`inverted` or `conjugated`, and put right."""
    troubles: tuple[DataIssue, ...] = ()

    @property
    def abrupt(self) -> tuple[DataIssue, ...]:
        """What happened to the data and not to the device: steps and glitches."""
        return tuple(one for one in self.troubles if one.kind in ("step", "glitch"))
