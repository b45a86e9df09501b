"""The interface of a journal's store, which is an SQLite database beside a folder, or a PostgreSQL server.

Both run the same SQL, with `?` for each value. `folder_store` and `postgres_store` hold the differences, and `opening`
chooses between them.
"""

import errno
import hashlib
import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from ...models.base.errors import CannotError

Place = Path | str
"""A folder, or the URL of a PostgreSQL database."""


class JournalError(CannotError):
    """The journal cannot be opened, read or written."""


class JournalAway(JournalError):
    """The journal's server cannot be reached, or another program has locked its database; it may be back soon."""


_FULL = (errno.ENOSPC, errno.EDQUOT)
_BROKEN = (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def is_broken(error: JournalError) -> bool:
    """Return whether disk or database have failed; a full disk has not, and may take the same event later."""
    cause = error.__cause__
    if isinstance(cause, OSError):
        return cause.errno not in _FULL
    return getattr(cause, "sqlite_errorcode", 0) & 0xFF in _BROKEN


class Store(ABC):
    """An open journal's rows and arrays. Every method raises JournalError if disk or server fail."""

    name: str
    """The folder, or the URL without its password, for messages."""

    gone: bool = False
    """Whether the connection to the store's server is lost."""

    @abstractmethod
    def close(self) -> None:
        """Close the store."""

    @abstractmethod
    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement selects."""

    @abstractmethod
    def stream(self, sql: str, *values: str | int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows that a statement selects, without loading all of them; call it inside `snapshot`."""

    @abstractmethod
    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes rows; call it inside `transaction`."""

    def newest(self, station: str) -> int:
        """Return the `seq` of a station's last event, even if it was pruned; 0 if there was none."""
        known = (
            "SELECT station, seq FROM events UNION ALL SELECT station, seq FROM prunings "
            "UNION ALL SELECT station, last FROM gaps"
        )
        sql = f"SELECT max(seq) FROM ({known}) AS known WHERE station = ?"  # noqa: S608
        return self.all(sql, station)[0][0] or 0

    @abstractmethod
    def transaction(self) -> AbstractContextManager[None]:
        """Make all changes inside atomic, and on disk at the end; a transaction inside another one is part of it."""

    @abstractmethod
    def snapshot(self) -> AbstractContextManager[None]:
        """Let everything inside read the same state."""

    @abstractmethod
    def write_array(self, event: str, data: bytes) -> None:
        """Write an event's array, so that it is complete once the surrounding transaction has ended."""

    @abstractmethod
    def read_array(self, event: str) -> bytes | None:
        """Return an event's raw columns and their index (see `array_file`), or None if it has none."""

    @abstractmethod
    def take_array(self, event: str, source: "Store") -> None:
        """Copy an array from another store; the copy shares no file with its source."""

    @abstractmethod
    def drop_arrays(self, events: Sequence[str]) -> None:
        """Remove the arrays of removed events."""

    @abstractmethod
    def set_orphans_aside(self) -> None:
        """Set aside the files of interrupted writes without removing them.

        Raises JournalError if the arrays show that this database has lost their rows.
        """

    @abstractmethod
    def damage(self) -> list[str]:
        """Return a sentence for each fault that the database finds in its own files."""

    @abstractmethod
    def check_room(self) -> None:
        """Raise JournalError if there is no room for a measurement."""

    @abstractmethod
    def claim(self, station: str) -> None:
        """Become the only writer of a station while the store is open. Raises JournalError if there is one already."""


def digest_of(data: bytes) -> str:
    """Return the SHA-256 of the data as a hexadecimal text."""
    return hashlib.sha256(data).hexdigest()
