"""A journal in a PostgreSQL database, which several benches share: each writes as a station of its own.

Psycopg 3 rather than SQLAlchemy: the journal's dozen statements read the same in both databases, so a second layer
over `sqlite3` would cost time at every sweep and at every start of a command, and save nothing.

The connection that writes holds advisory locks: one of its station, so that no other daemon writes as that station,
and a shared one of the tables, so that nobody changes them under a daemon that runs. They go with the connection,
and so does the right to write.
"""

import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import psycopg
from psycopg.conninfo import conninfo_to_dict

from ..files.database_url import without_password
from .migrations import check_version, migrate_postgres
from .store import JournalAway, JournalError, Store

PATIENCE = 5.0
"""Seconds that a writer waits for the one before it to go."""

SESSION = (
    "SET statement_timeout = '20s'",
    "SET lock_timeout = '10s'",
    "SET tcp_keepalives_idle = 10",
    "SET tcp_keepalives_interval = 5",
    "SET tcp_keepalives_count = 3",
    "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'",
)
"""Of a connection that writes: a server that has gone is an error within seconds, a writer that has gone lets go of
its locks within half a minute, and what is committed is on disk."""


class PostgresStore(Store):
    """A database, by a URL such as `postgresql://pzctl@lab-server/pzctl`."""

    def __init__(self, url: str, *, write: bool) -> None:
        self.name = without_password(url)
        self._streams = 0
        _check_url(url, self.name)
        try:
            self._db = psycopg.connect(url, autocommit=True, connect_timeout=10, tcp_user_timeout=4000)
        except psycopg.Error as error:
            raise JournalAway(f"{self.name}: the journal cannot be read or written: {_sentence(error)}") from error
        try:
            with self._server_errors():
                if write:
                    self._prepare()
                version = self._version()
            check_version(self.name, version)
        except JournalError:
            self._db.close()
            raise

    @property
    def gone(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether the server has hung up; asked without sending it anything."""
        try:
            self._db.pgconn.consume_input()
        except psycopg.OperationalError:
            return True
        return self._db.closed

    def close(self) -> None:
        """Let go of the connection."""
        self._db.close()

    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement finds."""
        with self._server_errors():
            return self._db.execute(_with_percent_marks(sql), values).fetchall()

    def stream(self, sql: str, *values: str | int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows that a statement finds, a few at a time."""
        self._streams += 1
        with self._server_errors(), self._db.cursor(name=f"pzctl_{self._streams}") as cursor:
            cursor.itersize = 100
            yield from cursor.execute(_with_percent_marks(sql), values)

    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes something."""
        with self._server_errors():
            self._db.execute(_with_percent_marks(sql), values)

    @contextmanager
    def transaction(self) -> Generator[None]:
        """All or nothing; synced by the server when it is left."""
        with self._server_errors(), self._db.transaction():
            yield

    @contextmanager
    def snapshot(self) -> Generator[None]:
        """Everything that is read inside is of one moment."""
        with self._server_errors(), self._db.transaction():
            self._db.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
            yield

    def write_array(self, event: str, data: bytes) -> None:
        """Keep an array beside its event's row, in the same transaction."""
        self.run("INSERT INTO arrays VALUES (?, ?)", event, data)

    def read_array(self, event: str) -> bytes | None:
        """Return an event's raw columns and their index; None where there are none."""
        rows = self.all("SELECT data FROM arrays WHERE event = ?", event)
        return rows[0][0] if rows else None

    def take_array(self, event: str, source: Store) -> None:
        """Keep a copy of the array that another store has."""
        data = source.read_array(event)
        if data is not None:
            self.write_array(event, data)

    def drop_arrays(self, events: Sequence[str]) -> None:
        """Do nothing: they go with their events."""

    def set_orphans_aside(self) -> None:
        """Do nothing: an interrupted transaction leaves nothing, and an array cannot outlive its row."""

    def damage(self) -> list[str]:
        """Return nothing: a server that reads a damaged page says so with an error of its own."""
        return []

    def check_room(self) -> None:
        """Do nothing: a server does not say how full its disk is, and refuses what it cannot keep."""

    def claim(self, station: str) -> None:
        """Become the only writer of a station, for as long as the connection lives."""
        deadline = time.monotonic() + PATIENCE
        while not self.all("SELECT pg_try_advisory_lock(hashtextextended(current_schema() || ?, 1))", station)[0][0]:
            if time.monotonic() > deadline:
                raise JournalError(
                    f"{self.name}: another daemon writes this journal as station {station!r}; "
                    "give this one another name (`--station`)"
                )
            time.sleep(0.1)

    def _prepare(self) -> None:
        """Settle how this connection writes, and bring the tables up to date."""
        for statement in SESSION:
            self._db.execute(statement)
        if self._setting("fsync") != "on":
            raise JournalError(f"{self.name}: this server does not sync what it writes (fsync = off)")
        migrate_postgres(self._db, self._version)

    def _setting(self, name: str) -> str:
        row = self._db.execute("SELECT current_setting(%s)", (name,)).fetchone()
        return row[0] if row else ""

    def _version(self) -> int:
        """Return the version of the tables; 0 where there are none."""
        if not self.all("SELECT 1 WHERE to_regclass('pzctl_version') IS NOT NULL"):
            return 0
        return self.all("SELECT version FROM pzctl_version")[0][0]

    @contextmanager
    def _server_errors(self) -> Generator[None]:
        """Turn the errors of the server, and of the way to it, into a sentence."""
        try:
            yield
        except psycopg.Error as error:
            if self._db.closed:
                raise JournalAway(
                    f"{self.name}: the journal's server has gone, and nothing is measured until it is back: "
                    + _sentence(error)
                ) from error
            raise JournalError(f"{self.name}: the journal cannot be read or written: {_sentence(error)}") from error


def _check_url(url: str, name: str) -> None:
    """Raise JournalError for what is no URL; what libpq says of one can hold a part of the password."""
    try:
        words = conninfo_to_dict(url)
    except psycopg.Error:
        words = {"port": "none"}
    hosts, ports = (str(words.get(key, "")).split(",") for key in ("host", "port"))
    if any("@" in host[1:] for host in hosts) or not all(port == "" or port.isdecimal() for port in ports):
        raise JournalError(
            f"{name}: this is no URL such as postgresql://USER@HOST/DATABASE; in a user or password "
            "`@ : / ? # %` are written as %40 %3A %2F %3F %23 %25"
        )


def _sentence(error: psycopg.Error) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _with_percent_marks(sql: str) -> Any:
    """Return a statement as psycopg wants it."""
    return sql.replace("?", "%s")
