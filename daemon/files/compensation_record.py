"""When and in which fixture the compensation that an instrument uses was taken: the instrument itself cannot say."""

from pathlib import Path

import msgspec

from .paths import FolderError


class CompensationRecord(msgspec.Struct, frozen=True):
    """What `pzctl compensate` last gave an instrument."""

    adapter: str
    """As a sweep's settings say it."""
    standards: tuple[str, ...]
    taken: str
    """When, RFC 3339, UTC."""
    fixture: str = ""
    """What people call it; empty where nobody said."""


def keep_record(path: Path, instrument: str, record: CompensationRecord) -> None:
    """Write down what an instrument (its `*IDN?`) uses from now on, whole or not at all. Raises FolderError."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(msgspec.json.format(msgspec.json.encode({**_read(path), instrument: record})))
        part.replace(path)
    except OSError as error:
        raise FolderError(f"{path}: when the compensation was taken cannot be written: {error.strerror}") from None


def record_of(path: Path, instrument: str) -> CompensationRecord | None:
    """Return what is known of an instrument's compensation; None where nothing is, or the file cannot be read."""
    return _read(path).get(instrument)


def _read(path: Path) -> dict[str, CompensationRecord]:
    try:
        return _decoder.decode(path.read_bytes())
    except (OSError, msgspec.MsgspecError):
        return {}


_decoder = msgspec.json.Decoder(dict[str, CompensationRecord])
