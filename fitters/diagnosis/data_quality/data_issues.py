"""Problems that the data checks find in a recording, in words that a technician understands."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal["step", "glitch", "not passive", "not causal", "too coarse", "not repeated"]


@dataclass(frozen=True)
class DataIssue:
    """A problem in a recording."""

    kind: Kind
    band_Hz: tuple[float, float]
    seconds: float | None = None
    """Time since the sweep began, s; None if the duration of the sweep is unknown."""
    size: float | None = None
    """Relative height of a step or glitch; points per linewidth where too coarse; chi2 between repeated sweeps."""
    moves: float = 0.0
    """Rms change of ln Z over the recording by a step or glitch, apart from a constant factor."""

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
            "step": f"it jumps by {size} {place}{when} (a range switch or a bad contact); the jump was removed",
            "glitch": f"a glitch of {size} {place}{when}; its points were excluded",
            "not passive": f"Re Z is negative beyond noise {place}, as of a source; check the compensation",
            "not causal": f"no linear, time-invariant device looks like this {place}: level too high, sweep too fast, "
            "drift, a disturbance, or very many resonances",
            "too coarse": f"only {few} within the width of the resonance {place}; measure with more points",
            "not repeated": f"this sweep differs from the previous one by more than noise {place}",
        }[self.kind]


@dataclass(frozen=True)
class DataCheck:
    """Result of the data checks of one recording, before any physics."""

    step: str
    index: int
    """Position among the step's recordings, from 0."""
    points: int
    noise: float | None = None
    """Relative standard deviation of Re and Im of ln Z; None if there are too few points to estimate it."""
    causal_chi2_per_dof: float | None = None
    """Misfit of the best causal, linear, time-invariant model, whatever the device is made of."""
    points_per_linewidth: float | None = None
    """For the sharpest resonance in the band."""
    turned: str = ""
    """`inverted` or `conjugated` if the recording was, and has been corrected; else empty."""
    troubles: tuple[DataIssue, ...] = ()

    @property
    def abrupt(self) -> tuple[DataIssue, ...]:
        """Disturbances of the data rather than of the device: steps and glitches."""
        return tuple(one for one in self.troubles if one.kind in ("step", "glitch"))
