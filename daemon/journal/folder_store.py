"""A journal in a folder: SQLite (WAL) beside a folder of arrays.

An array is written and synced before its row is committed. What a `kill -9` leaves behind is at most a file that no row
speaks of. Such files are moved to `orphans/` when the journal is opened for writing; nothing is removed.
"""

import os
import shutil
import sqlite3
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from .array_file import Description, columns_of, packed
from .migrations import check_version, migrate_sqlite
from .store import JournalError, Store

LEAST_FREE = 64 << 20
"""Bytes that must be free on the disk before a measurement is accepted: some thousand sweeps."""

DATABASE, ARRAYS, ORPHANS = "journal.sqlite", "arrays", "orphans"

PATIENCE = 2.0
"""Seconds that are waited for another program that locks the database: less than listeners wait for a beat."""


class FolderStore(Store):
    """A journal's folder. Who writes it holds the lock of `folderlock`."""

    def __init__(self, folder: Path, *, write: bool) -> None:
        self.name = str(folder)
        self._folder = folder
        self._arrays = folder / ARRAYS
        with _told(folder):
            self._db = _opened(folder) if write else _readable(folder)
            found: int = self._db.execute("PRAGMA user_version").fetchone()[0]
        try:
            check_version(self.name, found)
        except JournalError:
            self._db.close()
            raise

    def close(self) -> None:
        """Let go of the files."""
        self._db.close()

    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement finds."""
        with _told(self._folder):
            return self._db.execute(sql, values).fetchall()

    def stream(self, sql: str) -> Iterator[tuple[Any, ...]]:
        """Yield the rows that a statement finds."""
        with _told(self._folder):
            yield from self._db.execute(sql)

    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes something."""
        with _told(self._folder):
            self._db.execute(sql, values)

    @contextmanager
    def transaction(self) -> Generator[None]:
        """All or nothing; synced when it is left."""
        with self._within("BEGIN IMMEDIATE"):
            yield

    @contextmanager
    def snapshot(self) -> Generator[None]:
        """Everything that is read inside is of one moment."""
        with self._within("BEGIN"):
            yield

    @contextmanager
    def _within(self, begin: str) -> Generator[None]:
        self.run(begin)
        try:
            yield
        except BaseException:
            self.run("ROLLBACK")
            raise
        self.run("COMMIT")

    def write_array(self, event: str, data: bytes, description: Description | None) -> None:
        """Write raw columns and their description so that the file is whole or not there."""
        path = self._path(event)
        part = path.with_suffix(".part")
        with _told(self._folder):
            with part.open("wb") as file:
                file.write(packed(data, description))
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
            _sync_folder(self._arrays)

    def read_array(self, event: str) -> bytes | None:
        """Return an event's raw columns; None where there are none."""
        path = self._path(event)
        with _told(path):
            return columns_of(path.read_bytes()) if path.exists() else None

    def drop_arrays(self, events: Sequence[str]) -> None:
        """Remove files; those that a kill leaves here are set aside at the next start."""
        with _told(self._folder):
            for event in events:
                self._path(event).unlink(missing_ok=True)

    def set_aside(self) -> list[str]:
        """Move files that no row speaks of to `orphans/`; those in a folder that is a link stay where they are."""
        known = {row[0] for row in self.all("SELECT id FROM events WHERE hash IS NOT NULL")}
        with _told(self._folder):
            lost = [
                path
                for path in sorted(self._arrays.iterdir())
                if path.suffix == ".part" or (path.suffix == ".bin" and path.stem not in known)
            ]
            if lost and not self._arrays.is_symlink():
                aside = self._folder / ORPHANS
                aside.mkdir(exist_ok=True, mode=0o700)
                for path in lost:
                    path.rename(aside / path.name)
        return [path.name for path in lost]

    def damage(self) -> list[str]:
        """Return what SQLite's own check of its file finds."""
        return [str(found) for (found,) in self.all("PRAGMA integrity_check") if found != "ok"]

    def check_room(self) -> None:
        """Raise JournalError where the disk is nearly full."""
        with _told(self._folder):
            free = shutil.disk_usage(self._folder).free
        if free < LEAST_FREE:
            raise JournalError(
                f"{self.name}: {free >> 20} MB are free on its disk; {LEAST_FREE >> 20} MB are needed to measure on"
            )

    def claim(self, station: str) -> None:
        """Do nothing: the folder's lock keeps every other writer out."""

    def _path(self, event: str) -> Path:
        return self._arrays / f"{event}.bin"


def _opened(folder: Path) -> sqlite3.Connection:
    """Open a database to be written, its tables made or brought up to date."""
    (folder / ARRAYS).mkdir(parents=True, exist_ok=True, mode=0o700)
    refuse_a_lost_database(folder)
    db = sqlite3.connect(folder / DATABASE, isolation_level=None, timeout=PATIENCE)
    try:
        db.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL")
        migrate_sqlite(db, folder)
        db.execute("PRAGMA foreign_keys=ON")
    except BaseException:
        db.close()
        raise
    return db


def refuse_a_lost_database(folder: Path) -> None:
    """Raise JournalError where there are arrays, and no database that a daemon ever wrote: it was lost."""
    arrays = sum(path.suffix == ".bin" for path in (folder / ARRAYS).iterdir())
    if not arrays:
        return
    path = folder / DATABASE
    if path.exists() and path.stat().st_size:
        with closing(_read_only(folder, "mode=ro")) as db:
            has_runs = db.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone()
            if has_runs and db.execute("SELECT 1 FROM runs LIMIT 1").fetchone():
                return
    raise JournalError(
        f"{folder}: {arrays} recordings are in {ARRAYS}/, but {DATABASE} beside them "
        f"{'is a new one' if path.exists() else 'is missing'}; nothing was touched. Put the right file back, or "
        "rebuild it from the recordings: pzctl journal repair"
    )


def _readable(folder: Path) -> sqlite3.Connection:
    """Open a database to be read. Where SQLite cannot write beside it (read-only, full), it is told that nobody does.

    That it must not be told where a write-ahead log is left to be read: what stands in it would be missing.
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
def _told(where: Path) -> Generator[None]:
    """Turn the errors of disk and database into a sentence."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        raise JournalError(f"{where}: the journal cannot be read or written: {error}") from error


def _sync_folder(folder: Path) -> None:
    """Make a rename last; Windows neither can nor needs it."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
