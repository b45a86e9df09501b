"""A folder journal's database file, looked at before SQLite opens it and makes a new one of what is not there."""

from collections.abc import Callable
from pathlib import Path

from .store import JournalError

DATABASE = "journal.sqlite"

SEALS = "seals.jsonl"
"""One seal a line, beside the database; see `seals`."""

_MAGIC = b"SQLite format 3\0"

_HEADER = 100
"""Bytes of the header of an SQLite file."""


def check_beside_arrays(folder: Path, count: Callable[[], int]) -> None:
    """Raise JournalError where there are arrays, which `count` counts, and no database that can be theirs."""
    fault = database_fault(folder)
    if fault and (arrays := count()):
        raise JournalError(
            f"{folder}: {DATABASE} {fault}, but arrays/ holds {arrays} recording(s); nothing was changed: bring back "
            f"{DATABASE} from a backup, or run `pzctl journal repair`, which writes it anew from the recordings"
        )


def database_fault(folder: Path) -> str | None:
    """Return what is wrong with a folder's database as a file, as the end of a sentence; None where it looks whole.

    A write-ahead log that was left holds what the file lacks, so that its length says nothing then.
    """
    path, log = folder / DATABASE, folder / f"{DATABASE}-wal"
    try:
        if not path.exists():
            return "is missing"
        logged = log.exists() and log.stat().st_size > 0  # looked for first: a writer moves it into the file at its end
        with path.open("rb") as file:
            header = file.read(_HEADER)
        size = path.stat().st_size
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if logged:
        return None
    if size == 0:
        return "is empty"
    if len(header) < _HEADER or not header.startswith(_MAGIC):
        return "is no database"
    expected = _expected_size(header)
    if size < expected:
        return f"is half copied ({size} of {expected} bytes)"
    return "is new" if int.from_bytes(header[60:64]) == 0 else None


def _expected_size(header: bytes) -> int:
    """Return how many bytes the file has by its header; 0 where the header does not say so reliably."""
    if header[24:28] != header[92:96]:  # written by an SQLite that did not count the pages
        return 0
    page = int.from_bytes(header[16:18])
    return (65536 if page == 1 else page) * int.from_bytes(header[28:32])
