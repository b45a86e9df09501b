"""A journal in a folder: an SQLite database (WAL) beside a folder of arrays.

An array is written and synced before its row is committed. A `kill -9` leaves at most a file that no row names, which
is moved to `orphans/` when the journal is next opened for writing. Nothing is removed.
"""

import logging
import shutil
import sqlite3
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..store import JournalAway, JournalError, Store
from .array_folder import ORPHANS, ArrayFolder
from .database_file import DATABASE, check_beside_arrays, closed, opening
from .migrations import VERSION, check_version, migrate_sqlite
from .views import DROP, SQLITE_VIEWS

log = logging.getLogger(__name__)

LEAST_FREE = 64 << 20
"""Bytes that must be free on the disk to accept a measurement: some thousand sweeps."""

PATIENCE = 2.0
"""Seconds to wait for another program that locks the database: less than clients wait for a beat. Once they were not
enough, no transaction waits until one succeeds, so that the daemon is held up only once."""


class FolderStore(Store):
    """A journal's folder. A writer must hold the lock of `folder_lock`."""

    def __init__(self, folder: Path, *, write: bool, unchecked: bool = False) -> None:
        """Open the folder; with `unchecked`, also if arrays lack their database, which only a repair may make anew."""
        self.name = str(folder)
        self._folder = folder
        self._patience = PATIENCE
        self.files = ArrayFolder(folder)
        with opening(folder) as is_open:
            if not (unchecked or is_open):
                check_beside_arrays(folder, lambda: len(self.files.files()))
            if write:
                self.files.make()
            with _database_errors(folder):
                self._db = _opened(folder) if write else _readable(folder)
        self._is_open = True
        try:
            check_version(self.name, self.all("PRAGMA user_version")[0][0])
        except JournalError:
            self.close()
            raise

    def close(self) -> None:
        """Close the database."""
        self._db.close()
        if self._is_open:
            self._is_open = False
            closed(self._folder)

    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement selects."""
        with _database_errors(self._folder):
            return self._db.execute(sql, values).fetchall()

    def stream(self, sql: str, *values: str | int) -> Iterator[tuple[Any, ...]]:
        """Yield the rows that a statement selects."""
        with _database_errors(self._folder):
            yield from self._db.execute(sql, values)

    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes rows."""
        with _database_errors(self._folder):
            self._db.execute(sql, values)

    @contextmanager
    def transaction(self) -> Generator[None]:
        """Make all changes inside atomic, and sync them at the end; a transaction inside another one is part of it."""
        if self._db.in_transaction:
            yield
            return
        with self._within("BEGIN IMMEDIATE"):
            self._wait_for_others(PATIENCE)
            yield

    @contextmanager
    def snapshot(self) -> Generator[None]:
        """Let everything inside read the same state."""
        with self._within("BEGIN"):
            yield

    @contextmanager
    def _within(self, begin: str) -> Generator[None]:
        try:
            self.run(begin)
        except JournalAway:
            self._wait_for_others(0.0)
            raise
        try:
            yield
            self.run("COMMIT")
        except BaseException:
            if self._db.in_transaction:  # SQLite ends it by itself after some errors of the disk
                self.run("ROLLBACK")
            raise

    def _wait_for_others(self, seconds: float) -> None:
        """Let statements from now on wait as long for another program that locks the database."""
        if seconds != self._patience:
            self.run(f"PRAGMA busy_timeout = {1000 * seconds:.0f}")
            self._patience = seconds

    def write_array(self, event: str, data: bytes) -> None:
        """Write an array's file atomically."""
        self.files.write(event, data)

    def read_array(self, event: str) -> bytes | None:
        """Return an event's raw columns and their index, or None if it has none."""
        return self.files.read(event)

    def take_array(self, event: str, source: Store) -> None:
        """Copy an array from another store; two folders never share a file."""
        if isinstance(source, FolderStore):
            if source.files.path(event).exists():
                self.files.copy(event, source.files)
            return
        data = source.read_array(event)
        if data is not None:
            self.files.write(event, data)

    def drop_arrays(self, events: Sequence[str]) -> None:
        """Remove arrays; files left by a kill are set aside at the next start."""
        self.files.drop(events)

    def set_orphans_aside(self) -> None:
        """Move the files that no row names to `orphans/`, and log it.

        Raises JournalError if their indexes show that this database has lost their rows.
        """
        known = {row[0] for row in self.all("SELECT id FROM events WHERE hash IS NOT NULL")}
        orphans = self.files.strangers(known)
        if not orphans:
            return
        self._check_are_orphans(orphans, known)
        self.files.set_aside(orphans)
        log.warning(
            "%s: %d file(s) that no row names, such as %s, were moved to %s/; nothing was removed",
            *(self.files.arrays, len(orphans), orphans[0].name, ORPHANS),
        )

    def _check_are_orphans(self, orphans: Sequence[Path], known: set[str]) -> None:
        """Raise JournalError if arrays belong to runs or events that the database has never held."""
        runs = {row[0] for row in self.all("SELECT id FROM runs")}
        pruned = bool(self.all("SELECT 1 FROM prunings UNION SELECT 1 FROM gaps"))
        strange = 0
        for path in orphans:
            index = self.files.index_of(path)
            if index is not None:
                strange += index.run not in runs or index.seq > self.newest(index.station) + 1
            elif path.suffix == ".bin" and not path.is_symlink():
                strange += not known and not pruned  # it has no index, and this database never held an array
        if strange:
            raise JournalError(
                f"{self.name}: {DATABASE} does not know {strange} of the recordings in arrays/, so it is new, or "
                f"older than they are; nothing was changed: restore {DATABASE} from a backup, or run "
                "`pzctl journal repair`, which rebuilds it from the recordings"
            )

    def damage(self) -> list[str]:
        """Return a sentence for each fault that SQLite finds in its file."""
        try:
            faults = [row[0] for row in self._db.execute("PRAGMA integrity_check") if row[0] != "ok"]
            lost = self._db.execute("PRAGMA foreign_key_check").fetchall()
        except sqlite3.DatabaseError as error:
            return [f"{DATABASE} is damaged: {error}"]
        faults += [f"a row of {table} refers to a row of {parent} that is missing" for table, _, parent, _ in lost]
        return [f"{DATABASE} is damaged: {' '.join(fault.split())}" for fault in faults]

    def check_room(self) -> None:
        """Raise JournalError if the disk is nearly full."""
        with _database_errors(self._folder):
            free = shutil.disk_usage(self._folder).free
        if free < LEAST_FREE:
            raise JournalError(
                f"{self.name}: {free >> 20} MB are free on its disk; {LEAST_FREE >> 20} MB are needed to measure"
            )

    def claim(self, station: str) -> None:
        """Do nothing: the folder's lock keeps every other writer out."""


def _opened(folder: Path) -> sqlite3.Connection:
    """Open a database for writing; make its tables, or migrate them to this version."""
    db = sqlite3.connect(folder / DATABASE, isolation_level=None, timeout=PATIENCE)
    try:
        db.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL")
        if not _is_current(db):
            db.executescript(DROP)  # a view would keep the tables from being changed
            migrate_sqlite(db, folder)
            if db.execute("PRAGMA user_version").fetchone()[0] == VERSION:
                for statement in SQLITE_VIEWS:
                    db.execute(statement)
        db.execute("PRAGMA foreign_keys=ON")
    except BaseException:
        db.close()
        raise
    return db


def _is_current(db: sqlite3.Connection) -> bool:
    """Return whether tables and views are those of this version, so that opening the database changes nothing in it."""
    views = {row[0].strip() for row in db.execute("SELECT sql FROM sqlite_master WHERE type = 'view'")}
    version = db.execute("PRAGMA user_version").fetchone()[0]
    return version == VERSION and views == {statement.strip() for statement in SQLITE_VIEWS}


def _readable(folder: Path) -> sqlite3.Connection:
    """Open a database for reading, as immutable if SQLite cannot write beside it (read-only or full disk).

    Never open it as immutable while a non-empty write-ahead log exists, whose transactions would be ignored.
    """
    db = _read_only(folder, "mode=ro")
    try:
        db.execute("PRAGMA user_version")
    except sqlite3.OperationalError:
        db.close()
        log = folder / f"{DATABASE}-wal"
        if log.exists() and log.stat().st_size:
            raise
        return _read_only(folder, "immutable=1")
    return db


def _read_only(folder: Path, how: str) -> sqlite3.Connection:
    return sqlite3.connect(f"{(folder / DATABASE).absolute().as_uri()}?{how}", uri=True, isolation_level=None)


@contextmanager
def _database_errors(where: Path) -> Generator[None]:
    """Raise the errors of disk and database as JournalError, or as JournalAway if another program has locked it."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        if isinstance(error, sqlite3.Error) and _is_locked(error):
            says = f"another program has locked {DATABASE}; nothing is measured until it is free"
            raise JournalAway(f"{where}: the journal cannot be read or written: {says}") from error
        damaged = "malformed" in str(error) or "not a database" in str(error)
        remedy = f"; restore {DATABASE} from a backup, or run `pzctl journal repair`" if damaged else ""
        raise JournalError(f"{where}: the journal cannot be read or written: {error}{remedy}") from error


def _is_locked(error: sqlite3.Error) -> bool:
    """Return whether another connection has locked the database; the lowest byte of SQLite's code is the kind."""
    code: int | None = getattr(error, "sqlite_errorcode", None)  # missing in errors that the module raises by itself
    return code is not None and code & 0xFF == sqlite3.SQLITE_BUSY
