"""Writing a recording: the project's CSV, Touchstone, NetCDF. A file appears whole or not at all."""

import contextlib
import io
import json
import os
from pathlib import Path

from scipy.io import netcdf_file  # pyright: ignore[reportMissingTypeStubs]

from ...models.sweep import Sweep
from .page import RecordingError
from .provenance import provenance_lines
from .touchstone import touchstone_text

HEADER = "frequency_Hz,R_ohm,X_ohm"


def csv_text(sweep: Sweep) -> str:
    """Return the recording as the project's CSV: settings and provenance, then numbers that read back exactly."""
    pairs = zip(sweep.frequency.tolist(), sweep.impedance.tolist(), strict=True)
    numbers = [f"{f!r},{z.real!r},{z.imag!r}" for f, z in pairs]
    comments = [f"# {line}" for line in provenance_lines(sweep, sweep.frequency.size)]
    return "\n".join((*comments, HEADER, *numbers)) + "\n"


def write_csv(sweep: Sweep, path: Path) -> None:
    """Write the project's CSV; `read_recording` gives the same sweep back. Raises RecordingError."""
    _write(path, csv_text(sweep).encode())


def write_touchstone(sweep: Sweep, path: Path) -> None:
    """Write Touchstone 1 (`# Hz S RI R 50`), provenance as comments. Raises RecordingError."""
    _write(path, touchstone_text(sweep).encode())


def write_netcdf(sweep: Sweep, path: Path) -> None:
    """Write NetCDF 3 (xarray, MATLAB, netCDF4 read it): `resistance` and `reactance` in ohm over `frequency` in Hz.

    Settings and notes are JSON in the global attributes `settings` and `notes`. Raises RecordingError.
    """
    provenance_lines(sweep, sweep.frequency.size)  # refuses what is no plain value
    columns = {"frequency": sweep.frequency, "resistance": sweep.impedance.real, "reactance": sweep.impedance.imag}
    memory = io.BytesIO()
    file = netcdf_file(memory, "w")
    attributes = {"time": sweep.time, "id": sweep.id, "settings": dict(sweep.settings), "notes": sweep.notes}
    for name, value in attributes.items():
        setattr(file, name, (value if isinstance(value, str) else json.dumps(value)) or " ")
    file.createDimension("frequency", sweep.frequency.size)
    for name, numbers in columns.items():
        variable = file.createVariable(name, "d", ("frequency",))
        variable[:] = numbers
        setattr(variable, "units", "Hz" if name == "frequency" else "ohm")  # noqa: B010 (its stub lacks it)
    file.flush()
    content = memory.getvalue()
    file.close()
    _write(path, content)


def _write(path: Path, content: bytes) -> None:
    """Put the content there in one step: whoever looks sees the old file or the whole new one."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
