"""Recordings as NetCDF 3 and HDF5 files, with units, settings and provenance.

Both hold `resistance` and `reactance` in ohm over `frequency` in Hz, and the file attributes `format`, `time`, `id`,
`settings` and `notes` (the last two as JSON).
"""

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from ....models.base.arrays import Reals
from ....models.sweep import Sweep
from ..atomic_file import read_sealed, sealed, write_whole
from ..provenance import FORMAT, per_point_fault, provenance_lines, setting_fault
from ..text_file import LARGEST, RecordingError, clipped

COLUMNS = {"frequency": "Hz", "resistance": "ohm", "reactance": "ohm"}
ATTRIBUTES = ("format", "time", "id", "settings", "notes")
SUFFIXES = (".nc", ".h5", ".hdf5")

_Content = tuple[Mapping[str, Reals], Mapping[str, str]]
"""Columns, each of shape (N,), and attributes."""


def write_netcdf(sweep: Sweep, path: Path) -> None:
    """Write NetCDF 3, which xarray, MATLAB and netCDF4 can read. Raises RecordingError."""
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
    """Write HDF5, which MATLAB, xarray and Julia can read; `frequency` is the scale. Raises RecordingError."""
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
    """Return the recording in a NetCDF or HDF5 file of pzctl; its suffix says which. Raises RecordingError."""
    content = io.BytesIO(read_sealed(path))
    read: Callable[[io.BytesIO], _Content] = _netcdf if path.suffix.lower() == ".nc" else _hdf5
    try:
        return _sweep(path, *read(content)), None
    except RecordingError:
        raise
    except Exception as error:  # libraries raise many kinds of errors for invalid bytes
        says = clipped(" ".join(str(error).split()) or type(error).__name__, 200)
        raise RecordingError(f"{path}: not a recording: {says}") from None


def _sweep(path: Path, columns: Mapping[str, Reals], attributes: Mapping[str, str]) -> Sweep:
    """Return the recording. Raises RecordingError, SweepError or ValueError if the content is not valid."""
    if attributes["format"] != FORMAT:
        raise RecordingError(f"{path}: its format is {clipped(attributes['format'])!r}; {FORMAT!r} is known")
    settings: Any = json.loads(attributes["settings"])
    notes: Any = json.loads(attributes["notes"])
    if not isinstance(settings, dict) or not isinstance(notes, list):
        raise ValueError("its settings are not a table, or its notes not a list")
    settings, notes = cast("dict[str, Any]", settings), cast("list[object]", notes)
    faults = (setting_fault(key, value) for key, value in settings.items())
    if fault := next(filter(None, faults), "") or per_point_fault(settings, len(columns["frequency"])):
        raise ValueError(fault)
    z = columns["resistance"] + 1j * columns["reactance"]
    return Sweep(columns["frequency"], z, settings, attributes["time"], attributes["id"], tuple(map(str, notes)))


def _content(sweep: Sweep) -> _Content:
    provenance_lines(sweep, sweep.frequency.size)  # refuses settings that are not plain values
    texts = (FORMAT, sweep.time, sweep.id, json.dumps(dict(sweep.settings)), json.dumps(sweep.notes))
    if any("\0" in text for text in texts):
        raise RecordingError(f"recording {clipped(sweep.id)!r} cannot be written: a text contains a NUL character")
    numbers = (sweep.frequency, np.ascontiguousarray(sweep.impedance.real), np.ascontiguousarray(sweep.impedance.imag))
    return dict(zip(COLUMNS, numbers, strict=True)), dict(zip(ATTRIBUTES, texts, strict=True))


def _column(name: str, dataset: Any) -> Reals:
    """Return the numbers of a data set; check its shape before allocating memory. Raises ValueError."""
    shape = tuple(getattr(dataset, "shape", ()))
    if len(shape) != 1 or 8 * shape[0] > LARGEST:
        raise ValueError(f"{name} has the shape {shape}; one row of at most {LARGEST // 8} numbers is needed")
    return np.array(dataset[:], dtype=np.float64)


def _netcdf(content: io.BytesIO) -> _Content:
    from scipy.io import netcdf_file  # pyright: ignore[reportMissingTypeStubs]

    with netcdf_file(content, "r", mmap=False) as opened:
        file = cast("Any", opened)
        columns = {name: _column(name, file.variables[name]) for name in COLUMNS}
        texts = {name: getattr(file, name).decode() for name in ATTRIBUTES}
    return columns, {name: "" if text == " " else text for name, text in texts.items()}


def _hdf5(content: io.BytesIO) -> _Content:
    import h5py  # pyright: ignore[reportMissingTypeStubs]

    with cast("Any", h5py).File(content, "r") as file:
        columns = {name: _column(name, file[name]) for name in COLUMNS}
        return columns, {name: str(file.attrs[name]) for name in ATTRIBUTES}
