"""The CSV of Keysight's E4990A: comment lines `!`, one block from BEGIN to END, columns for data and memory traces."""

import re
from datetime import datetime

from ....models.sweep import Sweep
from ..assemble import assemble
from ..columns import data_columns, memory_columns, points_of, read_header
from ..text_file import TextFile
from .csv_table import MEMORY_NOTE, header_cells

_IDN = re.compile(r"(?:Keysight|Agilent)[^,]*,[^,]+,[^,]*,.*", re.IGNORECASE)


def is_keysight(page: TextFile) -> bool:
    """Return whether the content is such a file: an identity in the first comment, or a BEGIN line."""
    head = [line.strip() for line in page.lines[:20]]
    return any(line.startswith("BEGIN ") or (line.startswith("!") and _IDN.match(line[1:].strip())) for line in head)


def read_keysight(page: TextFile) -> tuple[Sweep, Sweep | None]:
    """Return the recording and, where there are `-mem` columns, the memory trace. Raises RecordingError."""
    settings, time, notes = _head(page)
    first, last = _block(page)
    header = next((n for n in range(first + 1, last) if page.lines[n - 1].strip('"').startswith("Frequency")), None)
    if header is None:
        raise page.error(first, "no column names found below BEGIN; they start with Frequency(Hz)")
    names = header_cells(page, page.lines[header - 1], ",", header)
    columns = read_header(page, names, header)
    lines = ((n, page.lines[n - 1]) for n in range(header + 1, last))
    body = [(n, line.split(",")) for n, line in lines if line.strip() and not line.lstrip().startswith(("!", "#"))]
    points, more = points_of(page, data_columns(columns), names, body, header)
    main = assemble(page, points, settings, time, notes=(*notes, *more))
    memory = memory_columns(columns)
    if not memory:
        return main, None
    points, more = points_of(page, memory, names, body, header)
    return main, assemble(page, points, settings, time, notes=(MEMORY_NOTE, *more))


def _head(page: TextFile) -> tuple[dict[str, object], str | None, list[str]]:
    """Return settings, the time, and notes from the comment lines."""
    settings: dict[str, object] = {}
    time, notes = None, list[str]()
    for line in page.lines:
        text = line.strip().removeprefix("!").strip()
        if not line.startswith("!"):
            continue
        if _IDN.match(text):
            settings["instrument"] = text
        if text.startswith("Date:"):
            try:  # the analyzer's clock, of which no zone is known: taken as UTC and said so
                moment = datetime.strptime(text[5:].strip(), "%a %b %d %H:%M:%S %Y")
                time, settings["clock"] = moment.isoformat(timespec="milliseconds") + "Z", "analyzer, zone unknown"
            except ValueError:
                notes.append("The date in the file is corrupt; the time given is that of the file.")
    return settings, time, notes


def _block(page: TextFile) -> tuple[int, int]:
    """Return the lines of BEGIN and END. Raises RecordingError where there is not exactly one such block."""
    begins = [n for n, line in enumerate(page.lines, 1) if line.startswith("BEGIN")]
    ends = [n for n, line in enumerate(page.lines, 1) if line.strip() == "END"]
    if not begins:
        raise page.error(None, "no BEGIN line found; the file is no whole export of an E4990A")
    if len(begins) > 1:
        raise page.error(begins[1], f"{len(begins)} channels found; save one channel to a file")
    if not ends or ends[0] < begins[0]:
        raise page.error(len(page.lines), "no END found; the file is cut off")
    return begins[0], ends[0]
