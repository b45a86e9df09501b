"""The format of an array file: raw columns, then an index that says what they are.

The columns begin at byte 0, one after the other, as they always have. Behind them stand the index as JSON and a footer
of 44 bytes: the length of the JSON (4 bytes, little-endian), its SHA-256 (32 bytes), and `PZCTLIX1`. So whoever reads
the columns need not know of the index, and a row that was lost can be written again from the file alone. Files of
earlier versions end with the columns; they can be read, but not indexed again.
"""

import hashlib
import struct
from dataclasses import dataclass
from pathlib import Path

import msgspec

from ..wire.frames import to_json

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
    """When it was accepted, RFC 3339, UTC."""


class ArrayIndex(msgspec.Struct, frozen=True, kw_only=True):
    """All that is needed to write the row of an array's event again."""

    v: int = 1
    station: str
    run: str
    run_time: str
    """When the run began, RFC 3339, UTC."""
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
    """None where there is none, or where it is damaged."""
    damaged: bool = False
    """Whether something other than a whole index stands behind the columns."""


def with_index(columns: bytes, index: ArrayIndex) -> bytes:
    """Return the content of a file that holds these columns and this index."""
    text = to_json(index)
    return columns + text + _FOOTER.pack(len(text), hashlib.sha256(text).digest(), MAGIC)


def split_array(data: bytes, lengths: str) -> ArrayFile:
    """Return the columns, whose lengths its row knows, and the index of a file's content."""
    size = sum(map(int, lengths.split(","))) if lengths else 0
    rest = data[size:]
    index = find_index(rest)
    whole = index is not None and _FOOTER.size + _FOOTER.unpack(rest[-_FOOTER.size :])[0] == len(rest)
    return ArrayFile(data[:size], index, damaged=bool(rest) and not whole)


def find_index(data: bytes) -> ArrayIndex | None:
    """Return the index at the end of a file's content; None where there is no whole one."""
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
    """Return the index of a file, of which only the end is read. Raises OSError."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - _FOOTER.size))
        footer = file.read()
        if len(footer) < _FOOTER.size or footer[-len(MAGIC) :] != MAGIC:
            return None
        file.seek(max(0, size - _FOOTER.size - _FOOTER.unpack(footer)[0]))
        return find_index(file.read())


_decoder = msgspec.json.Decoder(ArrayIndex)
