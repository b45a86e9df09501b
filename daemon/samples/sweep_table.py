"""The sweeps of a sample as tables: a pandas DataFrame, or an xarray Dataset.

pzctl.sweeps("S4", step="disk").to_xarray()
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.sweep import Sweep
from ..wire.events import SweepEvent, decode
from .constant_table import optional
from .sample_record import UnknownSampleError
from .sample_selection import open_journal

_SETTINGS = ("oscillator_V", "bias_V", "bandwidth")


@dataclass(frozen=True, eq=False)
class StoredSweep:
    """A sweep of the journal with its place."""

    step: str
    segment: int
    measurement: str
    sweep: Sweep


@dataclass(frozen=True, eq=False)
class SweepTable:
    """The sweeps of one sample, the oldest first."""

    sample: str
    sweeps: tuple[StoredSweep, ...]

    def to_pandas(self) -> Any:
        """Return a DataFrame with one row per point; impedance in ohm. Raises TableError if pandas is missing."""
        pandas = optional("pandas")
        frames = [
            pandas.DataFrame(
                {
                    "sample": self.sample,
                    "step": stored.step,
                    "segment": stored.segment,
                    "time": stored.sweep.time,
                    "measurement": stored.measurement,
                    "sweep": stored.sweep.id,
                    "frequency_Hz": stored.sweep.frequency,
                    "R_ohm": stored.sweep.impedance.real,
                    "X_ohm": stored.sweep.impedance.imag,
                }
            )
            for stored in self.sweeps
        ]
        return pandas.concat(frames, ignore_index=True)

    def to_xarray(self) -> Any:
        """Return a Dataset: `impedance` (ohm, complex) over `sweep` and `frequency` (Hz).

        Sweeps of different frequencies share one frequency axis, with NaN where one of them has no point. Raises
        TableError if xarray is missing.
        """
        xarray = optional("xarray")
        axis = np.unique(np.concatenate([stored.sweep.frequency for stored in self.sweeps]))
        z = np.full((len(self.sweeps), axis.size), complex(np.nan, np.nan))
        for k, stored in enumerate(self.sweeps):
            z[k, np.searchsorted(axis, stored.sweep.frequency)] = stored.sweep.impedance
        coordinates = {
            "frequency": ("frequency", axis, {"units": "Hz"}),
            "sweep": [stored.sweep.id for stored in self.sweeps],
            "step": ("sweep", [stored.step for stored in self.sweeps]),
            "segment": ("sweep", [stored.segment for stored in self.sweeps]),
            "time": ("sweep", np.array([stored.sweep.time.rstrip("Z") for stored in self.sweeps], "datetime64[ns]")),
            "measurement": ("sweep", [stored.measurement for stored in self.sweeps]),
            **{
                name: ("sweep", [_number(stored.sweep.settings.get(name)) for stored in self.sweeps])
                for name in _SETTINGS
            },
        }
        impedance = (("sweep", "frequency"), z, {"units": "ohm", "long_name": "electrical impedance"})
        return xarray.Dataset({"impedance": impedance}, coordinates, {"sample": self.sample})


def sweeps(sample: str, step: str | None = None, segment: int | None = None) -> SweepTable:
    """Return every sweep of a sample (of one step, of one segment) in the journal, the oldest first.

    Raises UnknownSampleError, NoSamplesError, JournalError.
    """
    journal = open_journal()
    stored: list[StoredSweep] = []
    try:
        for measurement in journal.measurements("sample = ? AND state = 'measured'", sample):
            if step not in (None, measurement.sample.step):
                continue
            for received in map(decode, journal.sweeps(measurement.id)):
                if isinstance(received.event, SweepEvent) and segment in (None, received.event.segment):
                    place = measurement.sample.step, received.event.segment, measurement.id
                    stored.append(StoredSweep(*place, received.sweep()))
    finally:
        journal.close()
    if not stored:
        where = "".join(f", {name} {value!r}" for name, value in (("step", step), ("segment", segment)) if value)
        raise UnknownSampleError(f"sample {sample!r}{where}: the journal holds no such sweep; see `pzctl samples`")
    return SweepTable(sample, tuple(stored))


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
