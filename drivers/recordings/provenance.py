"""The comment lines `key: value` of a recording: settings and provenance, so that writing and reading lose nothing."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...models.sweep import Sweep
from .text_file import RecordingError, TextFile, clipped

FORMAT = "pzctl recording 1"
OWN = ("format", "rows", "time", "id", "note")
"""Keys that are not settings."""
NUMBERS = ("bandwidth", "oscillator_V", "point_average", "sweep_average", "sweep_seconds", "bias_V")
"""Settings that other code calculates with: numbers, or null if unknown."""


@dataclass
class Provenance:
    """The content of a recording's comment lines."""

    settings: dict[str, Any] = field(default_factory=dict[str, Any])
    time: str | None = None
    id: str | None = None
    rows: int | None = None
    own: bool = False
    """Whether pzctl wrote the file."""
    notes: list[str] = field(default_factory=list[str])


def provenance_lines(sweep: Sweep, points: int) -> list[str]:
    """Return the comment lines without comment sign. Raises RecordingError for a setting that a line cannot hold."""
    lines = [f"format: {FORMAT}", f"rows: {points}", f"time: {_text(sweep.time)}", f"id: {_text(sweep.id)}"]
    lines += [f"note: {_text(note)}" for note in sweep.notes]
    for key, value in sweep.settings.items():
        if key in OWN or ":" in key or key != key.strip() or not key or not key.isprintable():
            raise RecordingError(f"setting {clipped(key)!r} cannot be written: its name is not allowed in a file")
        lines.append(f"{key}: {_text(value)}")
    return lines


def _text(value: Any) -> str:
    """Return a value on one line: plain text if it reads back as the same text, JSON otherwise."""
    if isinstance(value, str) and value and value.isprintable() and _value(value) == value and value == value.strip():
        return value
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError, RecursionError):
        raise RecordingError(f"setting {clipped(repr(value))} cannot be written: not a finite plain value") from None


def _not_finite(text: str) -> Any:
    raise ValueError(text)


def _value(text: str) -> Any:
    """Return the value of JSON text, or the text itself if it is not JSON."""
    try:
        return json.loads(text, parse_constant=_not_finite)
    except (ValueError, RecursionError):
        return text


def read_provenance(page: TextFile, comments: Sequence[tuple[int, str]]) -> Provenance:
    """Read comment lines, given with line numbers and without comment sign. Raises RecordingError."""
    provenance = Provenance()
    for line, comment in comments:
        key, colon, text = comment.partition(":")
        key, value = key.strip(), _value(text.strip())
        if not colon or not key:
            continue  # a remark, for people only
        if key == "format":
            provenance.own = value == FORMAT
        elif key == "rows":
            provenance.rows = _count(page, value, line)
        elif key == "time":
            provenance.time = str(value)
        elif key == "id":
            provenance.id = str(value)
        elif key == "note":
            provenance.notes.append(str(value))
        else:
            provenance.settings[key] = _checked(page, key, value, line)
    return provenance


def _count(page: TextFile, value: object, line: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise page.error(line, f"rows is {clipped(str(value))}; a whole number is needed")
    return value


def _checked(page: TextFile, key: str, value: Any, line: int) -> Any:
    """Refuse a setting that has to be a finite number and is not."""
    if fault := setting_fault(key, value):
        raise page.error(line, fault)
    return value


def setting_fault(key: str, value: Any) -> str:
    """Return what is wrong with a setting, or an empty string; those in `NUMBERS` have to be finite numbers."""
    if key not in NUMBERS or value is None:
        return ""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        finite = number and math.isfinite(value)
    except OverflowError:
        finite = False
    return "" if finite else f"{key} is {clipped(str(value))}; a number is needed"


def check_points(page: TextFile, announced: int | None, found: int, what: str = "the file") -> None:
    """Refuse a file with fewer or more points than it announces. Raises RecordingError."""
    if announced is not None and announced != found:
        says = "is cut off" if found < announced else "is damaged"
        raise page.error(None, f"{what} {says}: {announced} points announced, {found} found")
