"""Checks of a folder journal's database file before SQLite opens it, as SQLite would make a missing file anew."""

import threading
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

from ..store import JournalError

DATABASE = "journal.sqlite"

SEALS = "seals.jsonl"
"""File with one seal per line, beside the database; see `seals`."""

_MAGIC = b"SQLite format 3\0"

_HEADER = 100
"""Size of the header of an SQLite file in bytes."""

_opened = Counter[Path]()
"""Number of times that this process has the database of each folder open."""

_opening = threading.Lock()


@contextmanager
def opening(folder: Path) -> Generator[bool]:
    """Yield whether this process has the database of a folder open already; it has once more after that.

    Nothing but SQLite may then open the file: when a process closes a file, the kernel drops all its locks on it, in
    every thread. Without them, the next program that closes the database removes the write-ahead log that is in use,
    and all that is written from then on is lost. No other thread opens a database meanwhile.
    """
    with _opening:
        yield _opened[folder.resolve()] > 0
        _opened[folder.resolve()] += 1


def closed(folder: Path) -> None:
    """Note that this process has closed the database of a folder once."""
    with _opening:
        _opened[folder.resolve()] -= 1


def check_beside_arrays(folder: Path, count: Callable[[], int]) -> None:
    """Raise JournalError if there are arrays (`count` returns how many) without a usable database."""
    fault = database_fault(folder)
    if fault and (arrays := count()):
        raise JournalError(
            f"{folder}: {DATABASE} {fault}, but arrays/ holds {arrays} recording(s); nothing was changed: restore "
            f"{DATABASE} from a backup, or run `pzctl journal repair`, which rebuilds it from the recordings"
        )


def database_fault(folder: Path) -> str | None:
    """Return what is wrong with a folder's database file, as the end of a sentence, or None if nothing is.

    The length of the file is not checked if there is a write-ahead log, which holds what the file still lacks.
    """
    path, log = folder / DATABASE, folder / f"{DATABASE}-wal"
    try:
        if not path.exists():
            return "is missing"
        logged = (
            log.exists() and log.stat().st_size > 0
        )  # checked first, as a writer merges the log into the file when it ends
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
        return "is not a database"
    expected = _expected_size(header)
    if size < expected:
        return f"is incomplete ({size} of {expected} bytes)"
    return "is new" if int.from_bytes(header[60:64]) == 0 else None


def _expected_size(header: bytes) -> int:
    """Return the size of the file in bytes according to its header, or 0 if the header is not reliable."""
    if header[24:28] != header[92:96]:  # last written by an SQLite that did not count the pages
        return 0
    page = int.from_bytes(header[16:18])
    return (65536 if page == 1 else page) * int.from_bytes(header[28:32])
