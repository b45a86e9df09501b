"""A plain table: the project's own CSV (`# key: value`, header row, numbers), and CSV or TSV of known column names."""

import csv

from ....models.sweep import Sweep
from ..assemble import assemble
from ..columns import data_columns, memory_columns, points_of, read_header
from ..provenance import check_points, read_provenance
from ..text_file import TextFile

MEMORY_NOTE = "This is the memory trace of the recording, not its data trace."


def read_table(page: TextFile) -> tuple[Sweep, Sweep | None]:
    """Return the recording in a table, and the memory trace if there are `-mem` columns. Raises RecordingError."""
    comments, lines = _parted(page)
    provenance = read_provenance(page, comments)
    if not lines:
        raise page.error(None, "no table found, only comments")
    at, header = lines[0]
    separator = next((sign for sign in "\t;" if sign in header), ",")
    names = header_cells(page, header, separator, at)
    if len(names) < 3:
        raise page.error(at, f"no recording: {len(names)} column(s) found; a frequency and two quantities are needed")
    columns = read_header(page, names, at)
    body = [(n, text.split(separator)) for n, text in lines[1:]]
    check_points(page, provenance.rows, len(body))
    points, notes = points_of(page, data_columns(columns), names, body, at)
    main = assemble(page, points, provenance.settings, provenance.time, provenance.id, (*provenance.notes, *notes))
    memory = memory_columns(columns)
    if not memory:
        return main, None
    points, notes = points_of(page, memory, names, body, at)
    return main, assemble(page, points, provenance.settings, provenance.time, provenance.id, (MEMORY_NOTE, *notes))


def header_cells(page: TextFile, header: str, separator: str, line: int) -> list[str]:
    """Return the cells of a header row, quotes removed. Raises RecordingError."""
    try:
        return next(csv.reader([header], delimiter=separator, skipinitialspace=True))
    except (csv.Error, StopIteration) as error:
        raise page.error(line, f"this header row cannot be read: {error}") from None


def _parted(page: TextFile) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return comment lines without `#`, and all other lines that are not blank, each with its line number."""
    comments: list[tuple[int, str]] = []
    lines: list[tuple[int, str]] = []
    for n, line in enumerate(page.lines, 1):
        if line.lstrip().startswith("#"):
            comments.append((n, line.lstrip()[1:]))
        elif line.strip():
            lines.append((n, line))
    return comments, lines
