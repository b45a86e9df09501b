"""The file of an array: its raw columns, and behind them whatever its row in the database says.

So a journal whose database is lost can be rebuilt from its arrays alone. Layout: columns, description as JSON, eight
bytes with the description's length (big-endian), the mark `PZCTLARR`. Files without the mark, as earlier versions wrote
them, hold columns alone.
"""

from contextlib import suppress

import msgspec

MARK = b"PZCTLARR"
_TAIL = 8 + len(MARK)


Row = dict[str, str | int | None]
"""A row by column; what a table holds as bytes is text here."""


class Description(msgspec.Struct, frozen=True):
    """What a journal's tables say of an array: its event, its measurement, the build that was measured."""

    event: Row
    measurement: Row
    build: Row


def packed(data: bytes, description: Description | None) -> bytes:
    """Return the content of a file."""
    if description is None:
        return data
    said = msgspec.json.encode(description)
    return b"".join((data, said, len(said).to_bytes(8, "big"), MARK))


def columns_of(content: bytes) -> bytes:
    """Return the raw columns of a file's content."""
    return content[: _end_of_columns(content)]


def description_of(content: bytes) -> Description | None:
    """Return what a file says of itself; None where it says nothing that can be read."""
    with suppress(msgspec.MsgspecError):
        end = _end_of_columns(content)
        if end < len(content):
            return msgspec.json.decode(content[end:-_TAIL], type=Description)
    return None


def _end_of_columns(content: bytes) -> int:
    if not content.endswith(MARK) or len(content) < _TAIL:
        return len(content)
    length = int.from_bytes(content[-_TAIL : -len(MARK)], "big")
    return len(content) - _TAIL - length if length <= len(content) - _TAIL else len(content)
