"""The CSV of Keysight's E4990A: comment lines with `!`, one block from BEGIN to END, data and memory columns."""

import re
from datetime import datetime

from ....models.sweep import Sweep
from ..assemble import assemble
from ..columns import data_columns, memory_columns, points_of, read_header
from ..text_file import TextFile
from .csv_table import MEMORY_NOTE, header_cells

_IDN = re.compile(r"(?:Keysight|Agilent)[^,]*,[^,]+,[^,]*,.*", re.IGNORECASE)


def is_keysight(page: TextFile) -> bool:
    """Return whether the file has an identity in a comment at its head, or a BEGIN line."""
    head = [line.strip() for line in page.lines[:20]]
    return any(line.startswith("BEGIN ") or (line.startswith("!") and _IDN.match(line[1:].strip())) for line in head)


def read_keysight(page: TextFile) -> tuple[Sweep, Sweep | None]:
    """Return the recording, and the memory trace if there are `-mem` columns. Raises RecordingError."""
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
    """Return settings, time and notes from the comment lines."""
    settings: dict[str, object] = {}
    time, notes = None, list[str]()
    for line in page.lines:
        text = line.strip().removeprefix("!").strip()
        if not line.startswith("!"):
            continue
        if _IDN.match(text):
            settings["instrument"] = text
        if text.startswith("Date:"):
            try:  # the time zone of the analyzer's clock is unknown: UTC is assumed, and recorded as such
                moment = datetime.strptime(text[5:].strip(), "%a %b %d %H:%M:%S %Y")
                time, settings["clock"] = moment.isoformat(timespec="milliseconds") + "Z", "analyzer, zone unknown"
            except ValueError:
                notes.append("The date in the file is corrupt; the time of the file is used.")
    return settings, time, notes


def _block(page: TextFile) -> tuple[int, int]:
    """Return the line numbers of BEGIN and END. Raises RecordingError unless there is exactly one such block."""
    begins = [n for n, line in enumerate(page.lines, 1) if line.startswith("BEGIN")]
    ends = [n for n, line in enumerate(page.lines, 1) if line.strip() == "END"]
    if not begins:
        raise page.error(None, "no BEGIN line found; the file is not a complete export of an E4990A")
    if len(begins) > 1:
        raise page.error(begins[1], f"{len(begins)} channels found; save one channel to a file")
    if not ends or ends[0] < begins[0]:
        raise page.error(len(page.lines), "no END found; the file is cut off")
    return begins[0], ends[0]
