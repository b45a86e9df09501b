"""Whether the whole device with a learned law absorbs power, in the recorded band and beyond it.

Each law is causal and passive where it acts. The whole need not be: a law that takes loss from a layer which has little
may leave it a source, within the band or where nobody has recorded. Chains of passive two-ports are passive, so that
Re Z < 0 at the terminals tells of an active part.
"""

from dataclasses import dataclass

import numpy as np

from ....models.base.true_runs import true_runs
from ....models.effects import Device
from ...engine.recording import recorded_band
from ..hypotheses.hypothesis import Hypothesis

_BEYOND = 10.0
"""Factor by which it is looked at beyond the recorded band, on both sides."""
_POINTS = 4000
"""Frequencies, evenly in ln f: a step of 0.2 % for a band of one decade."""
_ROUNDING = 1e-9
"""Part of |Z| below which a negative resistance is one of rounding."""


@dataclass(frozen=True)
class WholeDevice:
    """Where the whole device absorbs power and where it would be a source."""

    low: float
    """Lowest frequency looked at, Hz."""
    high: float
    """Highest, Hz."""
    active: tuple[tuple[str, float, float], ...]
    """Bands where Re Z is negative: step, lowest and highest frequency in Hz."""

    @property
    def says(self) -> str:
        """What that means."""
        if not self.active:
            return (
                "With what was learned the whole device absorbs power at all frequencies from "
                f"{self.low / 1e6:.3g} to {self.high / 1e6:.3g} MHz, as every passive one does."
            )
        bands = ", ".join(f"{low / 1e6:.3g} to {high / 1e6:.3g} MHz ({step})" for step, low, high in self.active)
        return f"With what was learned the whole device would be a source of power at {bands}: do not use it there."


def whole_device(found: Hypothesis) -> WholeDevice:
    """Return where the device of a hypothesis, at rest in all its steps, absorbs power."""
    recordings = found.objective.recordings
    lowest, highest = recorded_band(recordings)
    low, high = lowest / _BEYOND, highest * _BEYOND
    f = np.geomspace(low, high, _POINTS)
    active: dict[tuple[str, float, float], None] = {}
    for one, model in zip(recordings, found.objective.models(found.fit.x), strict=True):
        if isinstance(model, Device):
            Z = model.assembly.steady(f)
            runs = true_runs(Z.real < -_ROUNDING * np.abs(Z))
            active.update(dict.fromkeys((one.step, float(f[a]), float(f[b - 1])) for a, b in runs))
    return WholeDevice(low, high, tuple(active))
