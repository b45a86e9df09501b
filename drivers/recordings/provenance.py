"""The comment lines `key: value` of a recording: settings and provenance, so that writing and reading lose nothing."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

from ...models.sweep import PER_POINT, Sweep
from .text_file import RecordingError, TextFile, clipped

FORMAT = "pzctl recording 1"
OWN = ("format", "rows", "time", "id", "note")
"""Keys that are not settings."""
NUMBERS = {
    **dict.fromkeys(("bandwidth", "oscillator_V", "oscillator_A", "point_average", "sweep_average"), (0.0, math.inf)),
    **dict.fromkeys(("sweep_seconds", "estimated_seconds", "source_ohm"), (0.0, math.inf)),
    "bias_V": (-math.inf, math.inf),
    "accuracy": (1e-6, 0.1),
}
"""Settings that other code calculates with, with their least and greatest value: numbers, or null if unknown."""
DIRECTIONS = ("up", "down")


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
    given: dict[str, list[tuple[int, Any]]] = {}
    for line, comment in comments:
        key, colon, text = comment.partition(":")
        key, value = key.strip(), _value(text.strip())
        if not colon or not key:
            continue  # a remark, for people only
        given.setdefault(key, []).append((line, value))
        _check_again(page, key, given[key])
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
    provenance.notes += [note for key, values in given.items() if (note := _differing(key, values))]
    return provenance


def _check_again(page: TextFile, key: str, given: Sequence[tuple[int, Any]]) -> None:
    """Refuse a second, different value of a key that code uses, since nothing tells which one is right."""
    (first, value), (line, other) = given[0], given[-1]
    if other != value and key != "note" and (key in (*OWN, *NUMBERS, *PER_POINT) or key == "direction"):
        raise page.error(line, f"{key} is {_clip(other)}, and {_clip(value)} in line {first}; keep the right one")


def _differing(key: str, given: Sequence[tuple[int, Any]]) -> str:
    """Return a note on a key, only kept for people, that has several values; an empty string if it has one."""
    (first, value), (last, other) = given[0], given[-1]
    if key == "note" or all(again == value for _, again in given):
        return ""
    said = f"{clipped(key)} is given {len(given)} times, first as {_clip(value)} (line {first})"
    return f"{said}; the last one counts: {_clip(other)} (line {last})."


def _clip(value: Any) -> str:
    return clipped(str(value))


def _count(page: TextFile, value: object, line: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise page.error(line, f"rows is {_clip(value)}; a whole number is needed")
    return value


def _checked(page: TextFile, key: str, value: Any, line: int) -> Any:
    """Refuse a setting that other code uses and that is not what it has to be."""
    if fault := setting_fault(key, value):
        raise page.error(line, fault)
    return value


def setting_fault(key: str, value: Any) -> str:
    """Return what is wrong with a setting that other code uses, or an empty string."""
    if value is None:
        return ""
    if key in NUMBERS:
        needed = "" if _is_number(value, *NUMBERS[key]) else _range(key)
    elif key in PER_POINT:
        needed = "" if _are_positive(value) else _LIST
    else:
        needed = "" if key != "direction" or value in DIRECTIONS else "up or down"
    return f"{key} is {_clip(value)}; {needed} is needed" if needed else ""


_LIST = "a list of positive numbers, one for each point,"


def _range(key: str) -> str:
    least, greatest = NUMBERS[key]
    if math.isfinite(greatest):
        return f"a number from {least:g} to {greatest:g} (0.001 for 0.1 %)"
    return "a number" if least < 0 else "a number that is not negative"


def _is_number(value: object, least: float, greatest: float) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value) and least <= value <= greatest
    except OverflowError:  # an integer beyond all floats
        return False


def _are_positive(value: object) -> bool:
    if not isinstance(value, list):
        return False
    return all(_is_number(one, 0, math.inf) and one for one in cast("list[object]", value))


def per_point_fault(settings: Mapping[str, Any], points: int) -> str:
    """Return what is wrong with the number of values of settings that have one for each point, or an empty string."""
    for name in PER_POINT:
        if (given := settings.get(name)) is not None and len(given) != points:
            return f"{name} has {len(given)} value(s), the recording {points} points; one for each point is needed"
    return ""


def check_points(page: TextFile, announced: int | None, found: int, what: str = "the file") -> None:
    """Refuse a file with fewer or more points than it announces. Raises RecordingError."""
    if announced is not None and announced != found:
        says = "is cut off" if found < announced else "is damaged"
        raise page.error(None, f"{what} {says}: {announced} points announced, {found} found")
