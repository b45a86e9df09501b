"""A recording as other sciences keep numbers: NetCDF 3 and HDF5, with units, settings and provenance.

Both hold `resistance` and `reactance` in ohm over `frequency` in Hz, and the attributes `format`, `time`, `id`,
`settings` and `notes` of the file (the last two as JSON).
"""

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from ....models.base.arrays import Reals
from ....models.sweep import Sweep, SweepError
from ..atomic_file import read_sealed, sealed, write_whole
from ..provenance import FORMAT, provenance_lines
from ..text_file import RecordingError, clipped

COLUMNS = {"frequency": "Hz", "resistance": "ohm", "reactance": "ohm"}
ATTRIBUTES = ("format", "time", "id", "settings", "notes")
SUFFIXES = (".nc", ".h5", ".hdf5")

_Content = tuple[Mapping[str, Reals], Mapping[str, str]]
"""Columns, each of shape (N,), and attributes."""


def write_netcdf(sweep: Sweep, path: Path) -> None:
    """Write NetCDF 3 (xarray, MATLAB, netCDF4 read it). Raises RecordingError."""
    from scipy.io import netcdf_file  # pyright: ignore[reportMissingTypeStubs]

    columns, attributes = _content(sweep)
    memory = io.BytesIO()
    file = netcdf_file(memory, "w")
    for name, text in attributes.items():
        setattr(file, name, text.encode() or b" ")
    file.createDimension("frequency", sweep.frequency.size)
    for name, numbers in columns.items():
        variable = file.createVariable(name, "d", ("frequency",))
        variable[:] = numbers
        setattr(variable, "units", COLUMNS[name])  # noqa: B010 (its stub lacks it)
    file.flush()
    content = memory.getvalue()
    file.close()
    write_whole(path, sealed(content))


def write_hdf5(sweep: Sweep, path: Path) -> None:
    """Write HDF5 (MATLAB, xarray, Julia read it); `frequency` is the scale of the others. Raises RecordingError."""
    import h5py  # pyright: ignore[reportMissingTypeStubs]

    columns, attributes = _content(sweep)
    memory = io.BytesIO()
    with cast("Any", h5py).File(memory, "w") as file:
        file.attrs.update(attributes)
        for name, numbers in columns.items():
            file.create_dataset(name, data=numbers).attrs["units"] = COLUMNS[name]
        file["frequency"].make_scale("frequency")
        for name in ("resistance", "reactance"):
            file[name].dims[0].attach_scale(file["frequency"])
    write_whole(path, sealed(memory.getvalue()))


def read_archive(path: Path) -> tuple[Sweep, None]:
    """Return the recording in a NetCDF or HDF5 file that pzctl wrote, by its suffix. Raises RecordingError."""
    content = io.BytesIO(read_sealed(path))
    read: Callable[[io.BytesIO], _Content] = _netcdf if path.suffix.lower() == ".nc" else _hdf5
    try:
        columns, attributes = read(content)
        if attributes["format"] != FORMAT:
            raise RecordingError(f"{path}: its format is {attributes['format'][:60]!r}; {FORMAT!r} is known")
        settings, notes = json.loads(attributes["settings"]), json.loads(attributes["notes"])
        z = columns["resistance"] + 1j * columns["reactance"]
        return Sweep(columns["frequency"], z, settings, attributes["time"], attributes["id"], tuple(notes)), None
    except (KeyError, OSError, ValueError, TypeError, AttributeError, AssertionError, SweepError) as error:
        raise RecordingError(f"{path}: this is no recording: {' '.join(str(error).split())[:200]}") from None


def _content(sweep: Sweep) -> _Content:
    provenance_lines(sweep, sweep.frequency.size)  # refuses what is no plain value
    texts = (FORMAT, sweep.time, sweep.id, json.dumps(dict(sweep.settings)), json.dumps(sweep.notes))
    if any("\0" in text for text in texts):
        raise RecordingError(f"recording {clipped(sweep.id)!r} cannot be written: a NUL is no text")
    numbers = (sweep.frequency, np.ascontiguousarray(sweep.impedance.real), np.ascontiguousarray(sweep.impedance.imag))
    return dict(zip(COLUMNS, numbers, strict=True)), dict(zip(ATTRIBUTES, texts, strict=True))


def _netcdf(content: io.BytesIO) -> _Content:
    from scipy.io import netcdf_file  # pyright: ignore[reportMissingTypeStubs]

    with netcdf_file(content, "r", mmap=False) as opened:
        file = cast("Any", opened)
        columns = {name: np.array(file.variables[name][:], dtype=np.float64) for name in COLUMNS}
        texts = {name: getattr(file, name).decode() for name in ATTRIBUTES}
    return columns, {name: "" if text == " " else text for name, text in texts.items()}


def _hdf5(content: io.BytesIO) -> _Content:
    import h5py  # pyright: ignore[reportMissingTypeStubs]

    with cast("Any", h5py).File(content, "r") as file:
        columns = {name: np.array(file[name], dtype=np.float64) for name in COLUMNS}
        return columns, {name: str(file.attrs[name]) for name in ATTRIBUTES}
