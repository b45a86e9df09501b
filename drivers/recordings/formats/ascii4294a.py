"""The 4294A's own ASCII export (`SAVDASC`, `.TXT`): a quoted header, then trace A, then trace B.

The layout is that of real exports and of the operation manual, p. 283-287. Columns are found by name, since a memory
trace adds two and a saved data array two more.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ....models.sweep import Sweep
from ..assemble import Points, assemble
from ..columns import notes_on, sign_lost
from ..convert import SIGN_LOST, to_impedance
from ..provenance import check_points
from ..text_file import RecordingError, TextFile, clipped
from .csv_table import MEMORY_NOTE
from .header4294a import parameter_of, settings_of, time_of

FIRST_LINE = re.compile(r'"?4294A\b')
ARRAYS = {"data": "Data Trace", "memory": "Memory Trace", "raw": "Data"}
"""Pairs of columns `... Real`, `... Imag`: the traces as displayed, and the array behind them (always R, X)."""


@dataclass
class ExportTrace:
    """One of the two traces, as in the file."""

    names: list[str] = field(default_factory=list[str])
    numbers: list[list[float]] = field(default_factory=list[list[float]])
    lines: list[int] = field(default_factory=list[int])

    def has(self, array: str) -> bool:
        """Return whether the trace has both columns of an array."""
        return {f"{ARRAYS[array]} {part}" for part in ("Real", "Imag")} <= set(self.names)

    def frequency(self) -> Reals:
        """Return the frequencies in Hz, shape (N,)."""
        return np.array([row[0] for row in self.numbers], dtype=np.float64)

    def complex_of(self, array: str) -> Complexes:
        """Return an array in the units of the trace, shape (N,)."""
        real, imag = (self.names.index(f"{ARRAYS[array]} {part}") for part in ("Real", "Imag"))
        return np.array([complex(row[real], row[imag]) for row in self.numbers], dtype=np.complex128)

    def real_data(self) -> Reals:
        """Return the real part of the displayed data, shape (N,); of shape (0,) if it was not saved."""
        return self.complex_of("data").real if self.has("data") else np.zeros(0)


def is_4294a(page: TextFile) -> bool:
    """Return whether the file is an export of the 4294A."""
    return FIRST_LINE.match(page.lines[0]) is not None


def read_4294a(page: TextFile) -> tuple[Sweep, Sweep | None]:
    """Return the recording, and the memory trace if one was saved. Raises RecordingError."""
    header, traces = _parsed(page)
    settings = settings_of(page, header)
    time, notes = time_of(header)
    if time is not None:
        settings["clock"] = "analyzer, date only"
    a = _checked(page, traces, "A", header)
    points = Points(a.lines, a.frequency(), _impedance(page, traces, header, "data"))
    parameter = parameter_of(page, header)
    shown = (traces[name].real_data() if name in traces else np.zeros(0) for name in ("A", "B"))
    main = assemble(page, points, settings, time, notes=(*notes, *notes_on(parameter, *shown)))
    if not a.has("memory"):
        return main, None
    points = Points(a.lines, a.frequency(), _impedance(page, traces, header, "memory"))
    return main, assemble(page, points, settings, time, notes=(MEMORY_NOTE, *notes))


def _parsed(page: TextFile) -> tuple[dict[str, str], dict[str, ExportTrace]]:
    """Return the header's `KEY: value` lines and the traces."""
    header: dict[str, str] = {"IDN": page.lines[0].strip().strip('"')}
    traces: dict[str, ExportTrace] = {}
    trace: ExportTrace | None = None
    for n, line in _written_lines(page):
        cells = [cell.strip().strip('"') for cell in line.split("\t")]
        key, colon, value = line.strip().strip('"').partition(":")
        if colon and len(cells) == 1:
            if key.strip() == "TRACE":
                trace = traces.setdefault(value.strip(), ExportTrace())
            elif trace is None and (known := header.get(key.strip().upper(), value.strip())) != value.strip():
                raise page.error(
                    n, f"{clipped(key.strip())} is {clipped(value.strip())!r} here, {clipped(known)!r} above; keep one"
                )
            else:
                header.setdefault(key.strip().upper(), value.strip())
        elif trace is None and line.startswith('"') and len(cells) == 1:
            header.setdefault("TITLE", cells[0])
        elif trace is None:
            raise page.error(n, f"{clipped(line.strip())!r} found where the header of a 4294A export should be")
        elif cells[0] == "Frequency" and not trace.names:
            trace.names = cells
        elif not trace.names:
            raise page.error(n, "numbers without column names; the line before the first point has to name them")
        else:
            trace.numbers.append(page.row(cells, trace.names, n, range(len(cells))))
            trace.lines.append(n)
    return header, traces


def _written_lines(page: TextFile) -> Iterator[tuple[int, str]]:
    return ((n, line) for n, line in enumerate(page.lines[1:], 2) if line.strip())


def _checked(page: TextFile, traces: Mapping[str, ExportTrace], name: str, header: Mapping[str, str]) -> ExportTrace:
    """Return a trace after checking that it is complete. Raises RecordingError."""
    if name not in traces:
        raise page.error(None, f"trace {name} is missing; a 4294A export holds both traces")
    trace = traces[name]
    announced = header.get("NUMBER OF POINTS", "")
    if not announced.isdecimal():
        raise page.error(None, f"NUMBER of POINTS is {clipped(announced)!r}; a whole number is needed")
    check_points(page, int(announced[:9]), len(trace.numbers), f"trace {name}")
    return trace


def _impedance(page: TextFile, traces: Mapping[str, ExportTrace], header: Mapping[str, str], array: str) -> Impedances:
    """Return Z in ohm, shape (N,), of the data or the memory trace."""
    a = traces["A"]
    if array == "data" and a.has("raw") and np.any(a.complex_of("raw")):  # unused arrays hold zeros
        return a.complex_of("raw")
    if not a.has(array):
        raise page.error(None, f"no columns {ARRAYS[array]} Real and Imag found in trace A")
    parameter = parameter_of(page, header)
    if parameter == "COMP":
        return a.complex_of(array)
    if parameter in SIGN_LOST:
        raise page.error(None, sign_lost(parameter))
    b = _checked(page, traces, "B", header)
    if not b.has(array):
        raise page.error(None, f"no columns {ARRAYS[array]} Real and Imag found in trace B")
    _same_frequencies(page, a, b)
    phase = np.pi / 180 if parameter in ("IMPH", "AMPH") and "(RAD)" not in header["MEASURE PARAMETER"] else 1.0
    return to_impedance(parameter, a.frequency(), a.complex_of(array).real, phase * b.complex_of(array).real)


def _same_frequencies(page: TextFile, a: ExportTrace, b: ExportTrace) -> None:
    differ = np.flatnonzero(a.frequency() != b.frequency())
    if differ.size:
        k = int(differ[0])
        raise RecordingError(
            f"{page.path}, line {b.lines[k]}: trace B has {b.numbers[k][0]:.12g} Hz where trace A has "
            f"{a.numbers[k][0]:.12g} Hz (line {a.lines[k]}); both traces belong to one sweep"
        )
