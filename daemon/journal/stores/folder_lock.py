"""The lock of a data folder, which allows one writer and is released when its process ends, however that happens."""

import sqlite3
from pathlib import Path

from ..store import JournalError

LOCK = "writer.lock"
"""File that the writing process locks."""


class JournalTaken(JournalError):
    """Another process writes the journal."""


def take_lock(folder: Path, patience: float = 2.0) -> sqlite3.Connection:
    """Take the lock, an SQLite transaction, which works on every platform; closing the result releases it.

    Waits up to `patience` seconds for a daemon that is just ending. Raises JournalError.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        lock = sqlite3.connect(folder / LOCK, timeout=patience, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise JournalError(f"{folder}: the journal cannot be read or written: {error}") from error
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        lock.close()
        if "locked" in str(error):
            raise JournalTaken(f"{folder}: another daemon writes this journal; only one can") from None
        raise JournalError(f"{folder / LOCK}: the journal cannot be locked: {error}") from error
    return lock


def is_written(folder: Path) -> bool:
    """Return whether a running process has the journal open for writing.

    A lock that cannot be taken for another reason, such as a full disk, does not count as held.
    """
    if not (folder / LOCK).exists():
        return False
    try:
        take_lock(folder, patience=0).close()
    except JournalError as error:
        return isinstance(error, JournalTaken)
    return False
