"""One recording of an impedance analyzer."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from .base.arrays import Frequencies, Impedances, Reals
from .base.errors import PzctlError

PER_POINT = ("noise_relative", "accuracy_relative", "gain_accuracy_relative")
"""Settings with one number for each point, relative to Z: the analyzer's expected noise, its specified accuracy, and
that of gain and phase alone, without residues in series and in parallel."""


class SweepError(PzctlError):
    """Data that cannot be a recording."""


def now_utc() -> str:
    """Return the time as RFC 3339 in UTC, with milliseconds."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@dataclass(frozen=True, eq=False)
class Sweep:
    """Complex impedance over frequency, as recorded.

    Raises SweepError where the numbers are no recording: fewer than two points, lengths that differ, values that
    are not finite, frequencies that are not positive and strictly rising.
    """

    frequency: Frequencies
    """Hz, shape (N,), strictly increasing whatever the direction of the sweep was."""
    impedance: Impedances
    """ohm, shape (N,)."""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Measuring conditions as read back: `oscillator_V`, `bandwidth`, `direction`, `sweep_seconds` ..."""
    time: str = field(default_factory=now_utc)
    """Start of the sweep, RFC 3339, UTC."""
    id: str = ""
    """uuid7 given by the daemon; the file name for a recording that was read from a file without such an id."""
    notes: tuple[str, ...] = ()
    """Notes for the user, a sentence each (inverted polarity, memory trace, corrupt date ...)."""
    file: str = ""
    """Name of the file that the recording was read from; empty for others."""

    def __post_init__(self) -> None:
        f = np.array(self.frequency, dtype=np.float64, order="C")
        z = np.array(self.impedance, dtype=np.complex128, order="C")
        f.flags.writeable = z.flags.writeable = False  # what was recorded stays as it was
        object.__setattr__(self, "frequency", f)
        object.__setattr__(self, "impedance", z)
        where = f"recording {self.id!r}" if self.id else "recording"
        if f.ndim != 1 or f.shape != z.shape:
            raise SweepError(f"{where}: frequency has shape {f.shape} and impedance {z.shape}; both must be (N,)")
        if f.size < 2:
            raise SweepError(f"{where}: {f.size} point(s) found; at least 2 are needed")
        for name, values in (("frequency", f), ("impedance", z)):
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise SweepError(
                    f"{where}: {name} of point {bad[0] + 1} is {values[bad[0]]}; only finite numbers allowed"
                )
        if f[0] <= 0:
            raise SweepError(f"{where}: frequency of point 1 is {f[0]:g} Hz; only positive frequencies are allowed")
        falls = np.flatnonzero(np.diff(f) <= 0)
        if falls.size:
            k = int(falls[0])
            word = "equals" if f[k + 1] == f[k] else "is below"
            raise SweepError(
                f"{where}: frequency of point {k + 2} ({f[k + 1]:.12g} Hz) {word} that of point {k + 1} "
                f"({f[k]:.12g} Hz); frequencies must rise strictly"
            )

    @property
    def name(self) -> str:
        """What messages call the recording: its file, else its id; empty if it has neither."""
        return self.file or self.id

    def at(self, points: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Self:
        """Return the recording at some of its points, with its settings there."""
        there = {name: self.per_point(name) for name in PER_POINT}
        settings = {**self.settings, **{name: own[points].tolist() for name, own in there.items() if own is not None}}
        return replace(self, frequency=self.frequency[points], impedance=self.impedance[points], settings=settings)

    def per_point(self, name: str) -> Reals | None:
        """Return a setting of `PER_POINT`, shape (N,); None unless there is a positive number for each point."""
        given = self.settings.get(name)
        if not isinstance(given, list) or len(given := cast("list[object]", given)) != self.frequency.size:
            return None
        if not all(isinstance(one, (int, float)) and 0 < one < np.inf for one in given):
            return None
        return np.array(given, np.float64)

    @property
    def admittance(self) -> Impedances:
        """Complex admittance in siemens, shape (N,)."""
        return 1.0 / self.impedance
