"""A plain table: the project's own CSV (`# key: value`, header row, numbers), and tables of known column names."""

import csv
import re

from ....models.sweep import Sweep
from ..assemble import REFERENCE, assemble
from ..columns import data_columns, memory_columns, of_reflection, points_of, read_header
from ..provenance import check_points, read_provenance
from ..text_file import TextFile, is_number

MEMORY_NOTE = "This is the memory trace of the recording, not its data trace."
_BLANKS = re.compile(r"\s+(?![(\[])")
"""Between columns that only blanks separate; `Frequency (Hz)` is one column."""

Lines = list[tuple[int, str]]
"""Lines with their numbers from 1."""


def read_table(page: TextFile, columns: str | None = None) -> tuple[Sweep, Sweep | None]:
    """Return the recording in a table, and the memory trace if there are `-mem` columns. Raises RecordingError.

    Columns are separated by tabs, semicolons, commas or blanks. `columns`: names separated by commas, in place of
    a header row.
    """
    comments, lines = _parted(page)
    provenance = read_provenance(page, comments)
    if not lines:
        raise page.error(None, "no table found, only comments")
    at = lines[0][0]
    separator, names, rows = _with_names(page, lines, columns) if columns else _with_header(page, lines)
    if len(names) < 3:
        needed = "a frequency and two quantities are needed, such as |Z| and its phase"
        raise page.error(at, f"no recording: {len(names)} column(s) found; {needed}")
    known = read_header(page, names, at)
    body = [(n, _cells(text, separator)) for n, text in rows]
    check_points(page, provenance.rows, len(body))
    points, notes = points_of(page, data_columns(known), names, body, at)
    reference = REFERENCE if of_reflection(names) and not provenance.own else None
    said = (*provenance.notes, *notes)
    main = assemble(page, points, provenance.settings, provenance.time, provenance.id, said, reference=reference)
    memory = memory_columns(known)
    if not memory:
        return main, None
    points, notes = points_of(page, memory, names, body, at)
    return main, assemble(page, points, provenance.settings, provenance.time, provenance.id, (MEMORY_NOTE, *notes))


def _with_header(page: TextFile, lines: Lines) -> tuple[str, list[str], Lines]:
    """Return the separator, the names in the header row, and the rows below it. Raises RecordingError."""
    at, header = lines[0]
    separator = _separator(header, lines[1][1] if len(lines) > 1 else "")
    names = _cells(header, separator) if separator == " " else header_cells(page, header, separator, at)
    return separator, names, lines[1:]


def _with_names(page: TextFile, lines: Lines, columns: str) -> tuple[str, list[str], Lines]:
    """Return the separator, the given names, and the rows from the first one of numbers on. Raises RecordingError."""
    names = [name.strip() for name in columns.split(",")]
    for k, (_, text) in enumerate(lines):
        separator = _separator(text, text)
        cells = _cells(text, separator)
        if sum(map(is_number, cells)) >= 2:
            return separator, names, lines[k:]
    raise page.error(lines[0][0], "no row of numbers found")


def _separator(header: str, row: str) -> str:
    """Return what separates the columns; blanks do where they leave nothing but numbers of the row."""
    for sign in "\t;":
        if sign in header:
            return sign
    cells = row.split()
    return " " if len(cells) > 1 and all(map(is_number, cells)) else ","


def _cells(text: str, separator: str) -> list[str]:
    return _BLANKS.split(text.strip()) if separator == " " else text.split(separator)


def header_cells(page: TextFile, header: str, separator: str, line: int) -> list[str]:
    """Return the cells of a header row, quotes removed. Raises RecordingError."""
    try:
        return next(csv.reader([header], delimiter=separator, skipinitialspace=True))
    except (csv.Error, StopIteration) as error:
        raise page.error(line, f"this header row cannot be read: {error}") from None


def _parted(page: TextFile) -> tuple[Lines, Lines]:
    """Return comment lines without `#`, and all other lines that are not blank, each with its line number."""
    comments: Lines = []
    lines: Lines = []
    for n, line in enumerate(page.lines, 1):
        if line.lstrip().startswith("#"):
            comments.append((n, line.lstrip()[1:]))
        elif line.strip():
            lines.append((n, line))
    return comments, lines
