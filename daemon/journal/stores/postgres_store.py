"""A journal in a PostgreSQL database that several benches share, each writing as a station of its own.

It uses Psycopg 3 and not SQLAlchemy: the journal's dozen statements are the same for both databases, so another layer
over `sqlite3` would cost time at every sweep and at every start of a command, and save nothing.

The writing connection holds advisory locks: one for its station, so that no other daemon writes as that station, and a
shared one for the tables, so that nobody migrates them while a daemon runs. The locks, and with them the right to
write, end with the connection.
"""

import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

import psycopg
from psycopg.conninfo import conninfo_to_dict

from ...files.database_url import without_password
from ..store import JournalAway, JournalError, Store
from .migrations import check_version, migrate_postgres
from .views import POSTGRES_MARK, POSTGRES_VIEWS

PATIENCE = 5.0
"""Seconds that a writer waits for the previous one to end."""

SESSION = (
    "SET statement_timeout = '20s'",
    "SET lock_timeout = '10s'",
    "SET tcp_keepalives_idle = 10",
    "SET tcp_keepalives_interval = 5",
    "SET tcp_keepalives_count = 3",
    "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'",
)
"""Settings of a writing connection: a lost server gives an error within seconds, a lost writer's locks are released
within half a minute, and committed transactions are on disk."""

WATCHED: dict[str, Any] = {
    "connect_timeout": 10,
    "tcp_user_timeout": 4000,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
}
"""Settings of every connection on this side: waiting for an answer ends some ten seconds after its server has gone;
by itself the system would notice it after two hours."""

LONGEST_SILENCE = 30.0
"""Seconds of waiting for the server after which a connection is given up, longer than its own limit of a statement.

A server that is stopped, or waits for its own disk, keeps its connections, and none of its limits end anything."""


class _Connection(psycopg.Connection[tuple[Any, ...]]):
    """A connection that is closed when the server says nothing for too long."""

    def wait(self, gen: Any, *how: Any, **named: Any) -> Any:
        """Wait for the server, as all methods do. Raises psycopg.OperationalError."""
        try:
            return super().wait(_while_heard(gen), *how, **named)
        except _SilentError:
            self.close()
            raise


class _SilentError(psycopg.OperationalError):
    """The server says nothing."""


def _while_heard(gen: Generator[Any, Any, Any]) -> Generator[Any, Any, Any]:
    """Pass on what a generator of psycopg waits for; it is told many times a second that nothing has come."""
    ready, heard = None, time.monotonic()
    while True:
        try:
            ready = yield gen.send(ready)
        except StopIteration as end:
            return end.value
        if ready:
            heard = time.monotonic()
        elif time.monotonic() - heard > LONGEST_SILENCE:
            raise _SilentError(f"it has said nothing for {LONGEST_SILENCE:g} s")


class PostgresStore(Store):
    """A journal in the database at a URL such as `postgresql://pzctl@lab-server/pzctl`."""

    def __init__(self, url: str, *, write: bool) -> None:
        self.name = without_password(url)
        self._streams = 0
        _check_url(url, self.name)
        try:
            self._db = _Connection.connect(url, autocommit=True, **WATCHED)
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
        """Whether the server has closed the connection; determined without sending anything."""
        try:
            self._db.pgconn.consume_input()
        except psycopg.OperationalError:
            return True
        return self._db.closed

    def close(self) -> None:
        """Close the connection."""
        self._db.close()

    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement selects."""
        with self._server_errors():
            return self._db.execute(_with_percent_marks(sql), values).fetchall()

    def stream(self, sql: str, *values: str | int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows that a statement selects, fetching a few at a time."""
        self._streams += 1
        with self._server_errors(), self._db.cursor(name=f"pzctl_{self._streams}") as cursor:
            cursor.itersize = 100
            yield from cursor.execute(_with_percent_marks(sql), values)

    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes rows."""
        with self._server_errors():
            self._db.execute(_with_percent_marks(sql), values)

    @contextmanager
    def transaction(self) -> Generator[None]:
        """Make all changes inside atomic; the server syncs them at the end. One inside another one is part of it."""
        with self._server_errors(), self._db.transaction():
            yield

    @contextmanager
    def snapshot(self) -> Generator[None]:
        """Let everything inside read the same state."""
        with self._server_errors(), self._db.transaction():
            self._db.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
            yield

    def write_array(self, event: str, data: bytes) -> None:
        """Write an array in the same transaction as its event's row."""
        self.run("INSERT INTO arrays VALUES (?, ?)", event, data)

    def read_array(self, event: str) -> bytes | None:
        """Return an event's raw columns and their index, or None if it has none."""
        rows = self.all("SELECT data FROM arrays WHERE event = ?", event)
        return rows[0][0] if rows else None

    def take_array(self, event: str, source: Store) -> None:
        """Copy an array from another store."""
        data = source.read_array(event)
        if data is not None:
            self.write_array(event, data)

    def drop_arrays(self, events: Sequence[str]) -> None:
        """Do nothing: the database removes arrays with their events."""

    def set_orphans_aside(self) -> None:
        """Do nothing: an interrupted transaction leaves nothing behind, and no array exists without its row."""

    def damage(self) -> list[str]:
        """Return nothing: the server raises an error when it reads a damaged page."""
        return []

    def check_room(self) -> None:
        """Do nothing: a server does not report its free disk space, and refuses what it cannot store."""

    def claim(self, station: str) -> None:
        """Become the only writer of a station for as long as the connection exists."""
        deadline = time.monotonic() + PATIENCE
        while not self.all("SELECT pg_try_advisory_lock(hashtextextended(current_schema() || ?, 1))", station)[0][0]:
            if time.monotonic() > deadline:
                raise JournalError(
                    f"{self.name}: another daemon writes this journal as station {station!r}; "
                    "give this one another name (`--station`)"
                )
            time.sleep(0.1)

    def _prepare(self) -> None:
        """Configure this connection for writing, and migrate the tables."""
        for statement in SESSION:
            self._db.execute(statement)
        if self._setting("fsync") != "on":
            raise JournalError(f"{self.name}: this server does not sync its disk (fsync = off)")
        migrate_postgres(self._db, self._version)
        self._make_views()

    def _make_views(self) -> None:
        """Make the views for other programs, unless those of this version are there."""
        mark = "SELECT obj_description(to_regclass('constants'), 'pg_class')"
        with self._db.transaction():
            self._db.execute("SELECT pg_advisory_xact_lock(hashtextextended(current_schema(), 3))")
            if self._db.execute(mark).fetchone() != (POSTGRES_MARK,):
                self._db.execute(cast(Any, f"{POSTGRES_VIEWS} COMMENT ON VIEW constants IS '{POSTGRES_MARK}'"))

    def _setting(self, name: str) -> str:
        row = self._db.execute("SELECT current_setting(%s)", (name,)).fetchone()
        return row[0] if row else ""

    def _version(self) -> int:
        """Return the version of the tables, or 0 if there are none."""
        if not self.all("SELECT 1 WHERE to_regclass('pzctl_version') IS NOT NULL"):
            return 0
        return self.all("SELECT version FROM pzctl_version")[0][0]

    @contextmanager
    def _server_errors(self) -> Generator[None]:
        """Raise the errors of the server and of the connection as JournalError or JournalAway."""
        try:
            yield
        except psycopg.Error as error:
            if self._db.closed:
                raise JournalAway(
                    f"{self.name}: the journal's server is away, and nothing is measured until it is back: "
                    + _sentence(error)
                ) from error
            raise JournalError(f"{self.name}: the journal cannot be read or written: {_sentence(error)}") from error


def _check_url(url: str, name: str) -> None:
    """Raise JournalError if a URL is not valid; libpq's own error could show a part of the password."""
    try:
        words = conninfo_to_dict(url)
    except psycopg.Error:
        words = {"port": "none"}
    hosts, ports = (str(words.get(key, "")).split(",") for key in ("host", "port"))
    if any("@" in host[1:] for host in hosts) or not all(port == "" or port.isdecimal() for port in ports):
        raise JournalError(
            f"{name}: a URL such as postgresql://USER@HOST/DATABASE is needed; in a user or password "
            "`@ : / ? # %` are written as %40 %3A %2F %3F %23 %25"
        )


def _sentence(error: psycopg.Error) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _with_percent_marks(sql: str) -> Any:
    """Return a statement with psycopg's placeholders."""
    return sql.replace("?", "%s")
