"""The lines of a recording's text file and the numbers on them, with errors that name file and line."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from ...models.base.errors import PzctlError

LARGEST = 100_000_000
"""Bytes. A sweep of a million points has some 50 MB; a larger file is not a recording of an impedance analyzer."""

MOST_LINES = 1_100_000
"""Greatest number of lines of a text file: a sweep of a million points, which takes up to a minute to read."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")
_NO_NUMBER = re.compile(r"[+-]?(?:nan|inf|infinity|n/?a|1\.#\w+|-+)?", re.IGNORECASE)
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f\ufffe]")


class RecordingError(PzctlError):
    """A file is not a recording, or is damaged; or a recording cannot be written."""


@dataclass(frozen=True)
class TextFile:
    """The lines of a text file, numbered from 1 in errors."""

    path: Path
    lines: tuple[str, ...]
    decimal_comma: bool = False
    """Whether numbers are written with a decimal comma."""

    def error(self, line: int | None, says: str) -> RecordingError:
        """Return an error about a line (from 1), or about the file as a whole."""
        where = f"{self.path}, line {line}" if line is not None else f"{self.path}"
        return RecordingError(f"{where}: {says}")

    def number(self, cell: str, what: str, line: int) -> float:
        """Return the number in a cell; `what` names the quantity. Raises RecordingError."""
        cell = cell.strip()
        written = cell.replace(",", ".") if self.decimal_comma else cell
        if not _NUMBER.fullmatch(written) or (self.decimal_comma and "." in cell):
            raise self.error(line, self._no_number(cell, what))
        number = float(written)
        if not math.isfinite(number):
            raise self.error(line, f"{what} is {clipped(cell)}, too large for a number")
        return number

    @staticmethod
    def _no_number(cell: str, what: str) -> str:
        if _THOUSANDS.fullmatch(cell):
            return f"{what} is {clipped(cell)!r}: a decimal comma, or thousands? Write numbers with a point"
        if _DECIMAL_COMMA.fullmatch(cell):
            return f"{what} is {clipped(cell)!r}, with a decimal comma; write numbers with a point"
        if "," in cell and "." in cell and _NUMBER.fullmatch(cell.replace(",", "").replace(".", "")):
            return f"{what} is {clipped(cell)!r}, with point and comma; write numbers without marks of thousands"
        if not cell:
            return f"{what} is missing; a number is needed at every point"
        if _NO_NUMBER.fullmatch(cell):
            return f"{what} is {clipped(cell)}; only finite numbers are allowed"
        return f"{what} is {clipped(cell)!r}; a number is needed"

    def row(self, cells: Sequence[str], names: Sequence[str], line: int, needed: Sequence[int]) -> list[float]:
        """Return the numbers in the `needed` cells of a row. Raises RecordingError."""
        if len(cells) != len(names):
            hint = ""
            if len(cells) > len(names) and all(cell.strip().lstrip("+-").isdigit() for cell in cells[:2]):
                hint = "; if these are decimal commas, write numbers with a point, or separate columns by semicolons"
            if line == len(self.lines) and len(cells) < len(names):
                hint = "; the file seems to be cut off here"
            raise self.error(line, f"{len(cells)} values found under {len(names)} columns{hint}")
        return [self.number(cells[k], clipped(names[k]), line) for k in needed]


def has_decimal_comma(cells: Iterable[str]) -> bool:
    """Return whether the numbers of a table have decimal commas for certain.

    They have if no number has a point, and at least one comma cannot separate thousands, as in `0,612` or `4,34e1`.
    """
    with_comma = [cell.strip() for cell in cells if "," in cell or "." in cell]
    if not all(_DECIMAL_COMMA.fullmatch(cell) for cell in with_comma):
        return False
    return not all(_THOUSANDS.fullmatch(cell) for cell in with_comma)


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, with a point or a decimal comma."""
    return bool(_NUMBER.fullmatch(cell.strip()) or _DECIMAL_COMMA.fullmatch(cell.strip()))


def clipped(text: str, most: int = 60) -> str:
    """Return a text from a file on one line, cut to a length that fits into a sentence."""
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= most else text[: most - 3] + "..."


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises RecordingError if it is missing, empty, too large or not a regular file."""
    try:
        if path.is_dir():
            raise RecordingError(f"{path}: this is a folder; the file of one recording is needed")
        if path.exists() and not path.is_file():
            raise RecordingError(f"{path}: this is a device or a pipe; the file of one recording is needed")
        if path.stat().st_size > LARGEST:
            raise RecordingError(f"{path}: {path.stat().st_size} bytes are too many; at most {LARGEST} are allowed")
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise RecordingError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not data.strip():
        raise RecordingError(f"{path}: the file is empty")
    return data


def read_page(path: Path) -> TextFile:
    """Return the lines of a text file, with any line ends. Raises RecordingError if it is not text."""
    data = read_bytes(path)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise RecordingError(f"{path}: this is UTF-16 text; save it as UTF-8 or plain CSV")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # a degree sign of an older program; binary data are refused below
    if _CONTROL.search(text):
        raise RecordingError(f"{path}: this is binary data, not the text of a recording")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if (lines := text.count("\n")) > MOST_LINES:
        raise RecordingError(f"{path}: {lines} lines are too many; at most {MOST_LINES} are allowed")
    return TextFile(path, tuple(text.split("\n")))


def file_time(path: Path) -> str:
    """Return the time of the last change of a file, RFC 3339, UTC."""
    moment = datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
