"""Reading a recording in any format, which is determined by the file's extension and content."""

from dataclasses import replace
from pathlib import Path

from ...models.sweep import Sweep
from .formats.ascii4294a import is_4294a, read_4294a
from .formats.csv_table import read_table
from .formats.keysight import is_keysight, read_keysight
from .formats.netcdf_hdf5 import SUFFIXES as ARCHIVES
from .formats.netcdf_hdf5 import read_archive
from .formats.touchstone import SUFFIXES, read_touchstone
from .text_file import RecordingError, clipped, read_bytes, read_page

TEXTS = (".csv", ".txt", ".tsv")


def read_recording(path: Path, columns: str | None = None) -> Sweep:
    """Read a recording; one file is one sweep. Raises RecordingError with one sentence for a person.

    `columns`: names of the columns of a table, such as `frequency_Hz,R_ohm,X_ohm`, in place of its header row.

    `.txt`, `.csv`, `.tsv`: a 4294A's ASCII export, a Keysight E4990A's CSV, or a table with known column names, such as
    the project's own CSV, distinguished by their first lines. `.s1p`, `.z1p`, `.y1p`: Touchstone 1. `.nc`, `.h5`,
    `.hdf5`: NetCDF 3 and HDF5 written by pzctl.
    """
    return replace(_read(path, columns)[0], file=path.name)


def read_memory_trace(path: Path) -> Sweep | None:
    """Read the memory trace of a recording, or return None if none was saved. Raises RecordingError."""
    memory = _read(path)[1]
    return None if memory is None else replace(memory, file=f"{path.name}@memory")


def _read(path: Path, columns: str | None = None) -> tuple[Sweep, Sweep | None]:
    suffix = path.suffix.lower()
    if suffix == ".dat":
        read_bytes(path)
        raise RecordingError(f"{path}: a binary data trace holds no frequencies; save as ASCII (.txt) on the 4294A")
    if columns is not None and suffix in (*SUFFIXES, *ARCHIVES):
        raise RecordingError(f"{path}: {suffix} files name their quantities; --columns is for tables")
    if suffix in ARCHIVES:
        return read_archive(path)
    if suffix not in (*TEXTS, *SUFFIXES):
        read_bytes(path)  # report a missing file before its unknown extension
        allowed = ", ".join((*TEXTS, *SUFFIXES, *ARCHIVES))
        raise RecordingError(f"{path}: {clipped(suffix) or 'no extension'} is not known; known are {allowed}")
    page = read_page(path)
    if suffix in SUFFIXES:
        return read_touchstone(page)
    if columns is not None:
        return read_table(page, columns)
    if is_4294a(page):
        return read_4294a(page)
    if is_keysight(page):
        return read_keysight(page)
    return read_table(page)
