"""The format of an array file: raw columns, followed by an index that describes them.

The columns start at byte 0, one after the other. The index as JSON follows, and then a footer of 44 bytes: the length
of the JSON (4 bytes, little-endian), its SHA-256 (32 bytes), and `PZCTLIX1`. A reader of the columns need not know the
index, and a lost row can be rebuilt from the file alone. Files of earlier versions end with the columns; they can be
read, but their rows cannot be rebuilt.
"""

import hashlib
import struct
from dataclasses import dataclass
from pathlib import Path

import msgspec

from ...wire.frames import to_json

MAGIC = b"PZCTLIX1"
"""The last bytes of a file that has an index."""

_FOOTER = struct.Struct("<I32s8s")


class IndexedMeasurement(msgspec.Struct, frozen=True, kw_only=True):
    """The measurement that an array belongs to, as it was accepted."""

    id: str
    number: int
    request: str
    run: str
    sample: str
    step: str
    build: str
    """SHA-256 of the build's JSON."""
    time: str
    """Time at which it was accepted, RFC 3339, UTC."""


class ArrayIndex(msgspec.Struct, frozen=True, kw_only=True):
    """Everything needed to rebuild the row of an array's event."""

    v: int = 1
    station: str
    run: str
    run_time: str
    """Start of the run, RFC 3339, UTC."""
    seq: int
    kind: str
    id: str
    topic: str
    header: str
    """The event's header as published: settings, segment, time, sample, build, columns."""
    lengths: str
    """Bytes of each column, separated by commas."""
    hash: str
    """SHA-256 of all columns together."""
    measurement: IndexedMeasurement | None = None


@dataclass(frozen=True)
class ArrayFile:
    """The content of an array file."""

    columns: bytes
    index: ArrayIndex | None
    """None if there is no index or it is damaged."""
    damaged: bool = False
    """Whether the columns are followed by anything other than a valid index."""


def with_index(columns: bytes, index: ArrayIndex) -> bytes:
    """Return the content of a file with these columns and this index."""
    text = to_json(index)
    return columns + text + _FOOTER.pack(len(text), hashlib.sha256(text).digest(), MAGIC)


def split_array(data: bytes, lengths: str) -> ArrayFile:
    """Return the columns and the index in the content of a file; `lengths` are those in the event's row."""
    size = sum(map(int, lengths.split(","))) if lengths else 0
    rest = data[size:]
    index = find_index(rest)
    whole = index is not None and _FOOTER.size + _FOOTER.unpack(rest[-_FOOTER.size :])[0] == len(rest)
    return ArrayFile(data[:size], index, damaged=bool(rest) and not whole)


def find_index(data: bytes) -> ArrayIndex | None:
    """Return the index at the end of a file's content, or None if there is no valid one."""
    if len(data) < _FOOTER.size:
        return None
    length, digest, magic = _FOOTER.unpack(data[-_FOOTER.size :])
    text = data[-_FOOTER.size - length : -_FOOTER.size]
    if magic != MAGIC or hashlib.sha256(text).digest() != digest:
        return None
    try:
        return _decoder.decode(text)
    except msgspec.MsgspecError:
        return None


def read_index(path: Path) -> ArrayIndex | None:
    """Return the index of a file, reading only its end. Raises OSError."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - _FOOTER.size))
        footer = file.read()
        if len(footer) < _FOOTER.size or footer[-len(MAGIC) :] != MAGIC:
            return None
        file.seek(max(0, size - _FOOTER.size - _FOOTER.unpack(footer)[0]))
        return find_index(file.read())


_decoder = msgspec.json.Decoder(ArrayIndex)
