"""Where a journal keeps its rows and arrays: one interface, SQLite beside a folder, or a PostgreSQL server.

Both are given the same SQL, with `?` for each value; what differs between them is in `folder_store` and
`postgres_store`; `opening` chooses between them.
"""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from ...models.base.errors import CannotError

Place = Path | str
"""A folder, or the URL of a PostgreSQL database."""


class JournalError(CannotError):
    """The journal cannot be opened, written or read as it should be."""


class JournalAway(JournalError):
    """The server that keeps the journal cannot be reached; it may be back soon."""


class Store(ABC):
    """An open journal's rows and arrays. Every method raises JournalError where disk or server do not do as asked."""

    name: str
    """Where it is, as error messages say it; without a password."""

    gone: bool = False
    """Whether it was on a server that can no longer be reached over this."""

    @abstractmethod
    def close(self) -> None:
        """Let go of it."""

    @abstractmethod
    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement finds."""

    @abstractmethod
    def stream(self, sql: str, *values: str | int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows that a statement finds, without having all of them in memory; inside of `snapshot`."""

    @abstractmethod
    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes something; inside of `transaction`."""

    def newest(self, station: str) -> int:
        """Return the `seq` of a station's last event, be it still there or not; 0 where there was none."""
        known = (
            "SELECT station, seq FROM events UNION ALL SELECT station, seq FROM prunings "
            "UNION ALL SELECT station, last FROM gaps"
        )
        sql = f"SELECT max(seq) FROM ({known}) AS known WHERE station = ?"  # noqa: S608
        return self.all(sql, station)[0][0] or 0

    @abstractmethod
    def transaction(self) -> AbstractContextManager[None]:
        """All or nothing, and on disk when it is left."""

    @abstractmethod
    def snapshot(self) -> AbstractContextManager[None]:
        """Everything that is read inside is of one moment."""

    @abstractmethod
    def write_array(self, event: str, data: bytes) -> None:
        """Keep an event's array so that it is there, whole, once the transaction around this has ended."""

    @abstractmethod
    def read_array(self, event: str) -> bytes | None:
        """Return an event's raw columns and their index (see `array_file`); None where there are none."""

    @abstractmethod
    def take_array(self, event: str, source: "Store") -> None:
        """Keep a copy of the array that another store has; it shares no file with its source."""

    @abstractmethod
    def drop_arrays(self, events: Sequence[str]) -> None:
        """Remove raw columns whose events have gone."""

    @abstractmethod
    def set_orphans_aside(self) -> None:
        """Move what an interrupted write left out of the way; nothing is removed.

        Raises JournalError where arrays show that these rows are not theirs.
        """

    @abstractmethod
    def damage(self) -> list[str]:
        """Return a sentence for each fault that the database finds in its own files."""

    @abstractmethod
    def check_room(self) -> None:
        """Raise JournalError where there is no room for a measurement."""

    @abstractmethod
    def claim(self, station: str) -> None:
        """Become the only writer of a station, for as long as this is open. Raises JournalError where there is one."""


def digest_of(data: bytes) -> str:
    """Return the hash that an array is known by."""
    return hashlib.sha256(data).hexdigest()
