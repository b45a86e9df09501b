"""The journal's tables, version by version; an older journal is copied, then brought up to date."""

import sqlite3
from pathlib import Path

_FIRST = """
CREATE TABLE runs (id TEXT PRIMARY KEY, time TEXT NOT NULL);
CREATE TABLE builds (hash TEXT PRIMARY KEY, json BLOB NOT NULL);
CREATE TABLE measurements (
    number INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, request TEXT NOT NULL UNIQUE, run TEXT NOT NULL,
    sample TEXT NOT NULL, step TEXT NOT NULL, build TEXT NOT NULL REFERENCES builds, state TEXT NOT NULL,
    time TEXT NOT NULL);
CREATE TABLE events (
    seq INTEGER PRIMARY KEY, kind TEXT NOT NULL, id TEXT NOT NULL UNIQUE, measurement TEXT, topic BLOB NOT NULL,
    header BLOB NOT NULL, lengths TEXT NOT NULL, hash TEXT);
CREATE INDEX events_by_measurement ON events (measurement, kind);
CREATE TABLE fits (
    kind TEXT NOT NULL, sweeps TEXT NOT NULL, fitter TEXT NOT NULL, version TEXT NOT NULL, measurement TEXT NOT NULL,
    ok INTEGER NOT NULL, seq INTEGER NOT NULL REFERENCES events, PRIMARY KEY (kind, sweeps, fitter, version));
CREATE INDEX fits_by_measurement ON fits (measurement);
"""

_PRUNINGS = """
CREATE TABLE prunings (seq INTEGER PRIMARY KEY, time TEXT NOT NULL, backup TEXT NOT NULL);
"""
"""Events up to and including `seq` were removed; `backup` is where they are."""

_STEPS = (_FIRST, _PRUNINGS)
"""What leads from version k to version k + 1."""

VERSION = len(_STEPS)
"""Of the tables; kept in `PRAGMA user_version`."""


def migrate(db: sqlite3.Connection, folder: Path) -> None:
    """Bring the tables to this version, all or nothing; `journal.sqlite.vK` is what they were before.

    A journal of a later version is left as it is. Raises sqlite3.Error, OSError.
    """
    found: int = db.execute("PRAGMA user_version").fetchone()[0]
    if found >= VERSION:
        return
    if found > 0:
        copy_database(db, folder / f"journal.sqlite.v{found}")
    steps = "".join(_STEPS[found:])
    try:
        db.executescript(f"BEGIN IMMEDIATE; {steps} PRAGMA user_version={VERSION}; COMMIT")
    except sqlite3.Error:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise


def copy_database(db: sqlite3.Connection, path: Path) -> None:
    """Write a consistent copy of a database, whole or not at all, while others may write it."""
    part = path.with_name(path.name + ".part")
    part.unlink(missing_ok=True)
    copy = sqlite3.connect(part)
    try:
        db.backup(copy)
    finally:
        copy.close()
    part.replace(path)
