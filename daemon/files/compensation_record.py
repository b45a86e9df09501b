"""When and in which fixture an instrument's compensation was taken, which the instrument itself does not store."""

from pathlib import Path

import msgspec

from .paths import FolderError


class CompensationRecord(msgspec.Struct, frozen=True):
    """The compensation that `pzctl compensate` last loaded into an instrument."""

    adapter: str
    """Name of the adapter, as in a sweep's settings."""
    standards: tuple[str, ...]
    taken: str
    """Time of the compensation, RFC 3339, UTC."""
    fixture: str = ""
    """Name of the fixture; empty if not given."""


def keep_record(path: Path, instrument: str, record: CompensationRecord) -> None:
    """Write the record of an instrument (its `*IDN?`) to the file, atomically. Raises FolderError."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(msgspec.json.format(msgspec.json.encode({**_read(path), instrument: record})))
        part.replace(path)
    except OSError as error:
        raise FolderError(f"{path}: the date of the compensation cannot be written: {error.strerror}") from None


def record_of(path: Path, instrument: str) -> CompensationRecord | None:
    """Return the record of an instrument's compensation, or None if there is none or the file cannot be read."""
    return _read(path).get(instrument)


def _read(path: Path) -> dict[str, CompensationRecord]:
    try:
        return _decoder.decode(path.read_bytes())
    except (OSError, msgspec.MsgspecError):
        return {}


_decoder = msgspec.json.Decoder(dict[str, CompensationRecord])
