"""Rebuilding the rows of a journal from the descriptions in its arrays, where the database is lost or damaged."""

import sqlite3
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from .array_file import Description, Row, columns_of, description_of
from .folder_lock import take_lock
from .folder_store import ARRAYS, DATABASE, ORPHANS
from .migrations import COLUMNS, migrate_sqlite
from .store import JournalError, digest_of

_BYTES = {"topic", "header", "json"}
"""Columns that a table holds as bytes."""


@dataclass(frozen=True)
class Repaired:
    """What came of a repair."""

    recordings: int
    """Recordings whose rows were put back."""
    silent: tuple[Path, ...]
    """Files that do not say what they are: written by an earlier version, or cut off. They stay where they are."""
    aside: Path | None
    """Where the damaged database was moved; None where it was whole or missing."""


def repair(folder: Path) -> Repaired:
    """Put back the rows of every recording in `arrays/` and `orphans/` that the database does not name.

    A database that SQLite finds damaged is kept aside under a new name. Raises JournalError where there is nothing to
    repair from, where another program writes the journal, or where the disk does not do what was asked.
    """
    if not (folder / ARRAYS).is_dir():
        raise JournalError(f"{folder}: there is no {ARRAYS}/ in it, so nothing to rebuild a journal from")
    with closing(take_lock(folder)):
        try:
            return _repaired(folder)
        except (OSError, sqlite3.Error) as error:
            raise JournalError(f"{folder}: the journal cannot be repaired: {error}") from error


def _repaired(folder: Path) -> Repaired:
    aside = _set_damaged_aside(folder)
    files = [path for room in (ARRAYS, ORPHANS) for path in sorted((folder / room).glob("*.bin"))]
    silent: list[Path] = []
    recordings = 0
    with closing(sqlite3.connect(folder / DATABASE, isolation_level=None)) as db:
        migrate_sqlite(db, folder)
        for path in files:
            content = path.read_bytes()
            said = description_of(content)
            if said is None or said.event.get("hash") != digest_of(columns_of(content)):
                known = db.execute("SELECT 1 FROM events WHERE id = ?", (path.stem,)).fetchone()
                silent += [] if known else [path]
                continue
            recordings += _put_back(db, said)
            if path.parent.name == ORPHANS:
                path.rename(folder / ARRAYS / path.name)
    return Repaired(recordings, tuple(silent), aside)


def _set_damaged_aside(folder: Path) -> Path | None:
    """Move a database that SQLite cannot read under another name, with its log; return that name."""
    path = folder / DATABASE
    if not path.exists():
        return None
    try:
        with closing(sqlite3.connect(path)) as db:
            if db.execute("PRAGMA integrity_check").fetchall() == [("ok",)]:
                return None
    except sqlite3.DatabaseError:
        pass
    aside = folder / f"{DATABASE}.damaged-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}"
    for suffix in ("", "-wal", "-shm"):
        part = folder / f"{DATABASE}{suffix}"
        if part.exists():
            part.rename(f"{aside}{suffix}")
    return aside


def _put_back(db: sqlite3.Connection, said: Description) -> int:
    """Insert the rows of one recording; return how many of its events were missing: one or none."""
    if db.execute("SELECT 1 FROM events WHERE id = ?", (said.event["id"],)).fetchone():
        return 0
    run: Row = {
        "id": said.measurement.get("run"),
        "time": said.measurement.get("time"),
        "station": said.event["station"],
    }
    # how the measurement ended was said by an event that is lost; its recordings are there
    measurement = said.measurement | {"state": "measured"}
    db.execute("BEGIN IMMEDIATE")
    for table, row in (("builds", said.build), ("runs", run), ("measurements", measurement), ("events", said.event)):
        columns = COLUMNS[table].split(", ")
        values = [_stored(name, row.get(name)) for name in columns]
        db.execute(
            f"INSERT OR IGNORE INTO {table} ({COLUMNS[table]}) VALUES ({', '.join('?' * len(columns))})",  # noqa: S608
            values,
        )
    db.execute("COMMIT")
    return 1


def _stored(column: str, value: str | int | None) -> str | int | bytes | None:
    return value.encode() if column in _BYTES and isinstance(value, str) else value
