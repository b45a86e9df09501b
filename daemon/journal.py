"""Writing the record of everything that was announced: SQLite (WAL) beside a folder of arrays.

A sweep's bytes are written and synced first, then its row is committed, then it may be published. What a `kill -9`
leaves behind is at most a file no row speaks of; it is removed when the journal is opened for writing again.
"""

import hashlib
import os
import shutil
import sqlite3
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import msgspec

from ..models.build import Build
from ..models.sweep import now_utc
from .archive import Archive, JournalError, Measurement, told
from .frames import to_json
from .migrations import migrate
from .uuid7 import uuid7
from .wire import DiagnosisEvent, Event, FitEvent, Payload, Sampled, StateEvent, encode

LEAST_FREE = 64 << 20
"""Bytes that must be free on the disk before a measurement is accepted: some thousand sweeps."""

LOCK = "writer.lock"
"""Held by the process that writes."""

E = TypeVar("E", bound=Event)


class Journal(Archive):
    """The journal in a folder, opened for writing, which one process can. Begins a new run.

    Raises JournalError from every method where the disk or the database does not do what was asked.
    """

    def __init__(self, folder: Path) -> None:
        with told(folder):
            (folder / "arrays").mkdir(parents=True, exist_ok=True, mode=0o700)
        self._lock = _lock(folder)
        try:
            super().__init__(folder)
            self.last_seq = self.newest
            self.run = uuid7()
            self._begin_run()
        except JournalError:
            self._lock.close()
            raise

    def close(self) -> None:
        """Let go of the files, and of the lock."""
        super().close()
        self._lock.close()

    def append(self, event: E, payload: Payload = ()) -> tuple[E, list[bytes]]:
        """Put the event on disk with the next `seq`; return it as stamped, and its frames, now fit to be published.

        An `id` that the event has already is kept.
        """
        stamp = {"run": self.run, "seq": self.last_seq + 1, "id": event.id or uuid7(), "time": now_utc()}
        stamped = msgspec.structs.replace(event, **stamp)
        frames = encode(stamped, payload)
        with told(self.folder):
            digest = self._write_array(stamped.id, payload) if payload else None
            with self._transaction():
                self._insert(stamped, frames, digest)
        self.last_seq += 1
        return stamped, frames

    def answered(self, event: FitEvent | DiagnosisEvent) -> int | None:
        """Return the `seq` of the answer that stands already for these sweeps, fitter and version.

        A refusal does not stand in the way of a result.
        """
        row = self._one(
            "SELECT seq, ok FROM fits WHERE kind = ? AND sweeps = ? AND fitter = ? AND version = ?", *_key(event)
        )
        return row[0] if row and (row[1] or not _succeeded(event)) else None

    def begin_measurement(self, request: str, build: Build, step: str) -> tuple[str, bool]:
        """Record that a measurement was accepted; return its id, and False where this request was accepted before.

        Raises JournalError where there is no room for what it will bring.
        """
        known = self._one("SELECT id FROM measurements WHERE request = ?", request)
        if known:
            return str(known[0]), False
        with told(self.folder):
            free = shutil.disk_usage(self.folder).free
        if free < LEAST_FREE:
            raise JournalError(
                f"{self.folder}: {free >> 20} MB are free on its disk; {LEAST_FREE >> 20} MB are needed to measure on"
            )
        text, new = to_json(build), uuid7()
        digest = hashlib.sha256(text).hexdigest()
        with told(self.folder), self._transaction():
            self._db.execute("INSERT OR IGNORE INTO builds VALUES (?, ?)", (digest, text))
            self._db.execute(
                "INSERT INTO measurements (id, request, run, sample, step, build, state, time) VALUES"
                " (?, ?, ?, ?, ?, ?, ?, ?)",
                (new, request, self.run, build.name, step, digest, "queued", now_utc()),
            )
        return new, True

    def unfinished(self) -> list[Measurement]:
        """Return the measurements of earlier runs that never came to an end."""
        return self.measurements("state IN ('queued', 'measuring') AND run != ?", self.run)

    def unanswered(self, fitter: str) -> list[str]:
        """Return the complete measurements of this run that a fitter has not answered."""
        rows = "state = 'measured' AND run = ? AND id NOT IN (SELECT measurement FROM fits WHERE fitter = ?)"
        return [found.id for found in self.measurements(rows, self.run, fitter)]

    def _open(self) -> sqlite3.Connection:
        """Open the database, its tables made where it is new."""
        db = sqlite3.connect(self.folder / "journal.sqlite", isolation_level=None)
        db.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON")
        migrate(db, self.folder)
        return db

    def _begin_run(self) -> None:
        """Remove what an interrupted write left, and record the new run."""
        with told(self.folder):
            known = {row[0] for row in self._db.execute("SELECT id FROM events WHERE hash IS NOT NULL")}
            for path in self.arrays.iterdir():
                if path.suffix == ".part" or (path.suffix == ".bin" and path.stem not in known):
                    path.unlink()
            self._db.execute("INSERT INTO runs VALUES (?, ?)", (self.run, now_utc()))

    def _write_array(self, event: str, payload: Payload) -> str:
        """Write raw columns so that the file is whole or not there; return their hash."""
        path = self.arrays / f"{event}.bin"
        part = path.with_suffix(".part")
        data = b"".join(payload)
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        _sync_folder(self.arrays)
        return hashlib.sha256(data).hexdigest()

    def _insert(self, event: Event, frames: Sequence[bytes], digest: str | None) -> None:
        """Insert an event's row, and what follows from it for measurements and fits."""
        measurement = event.measurement if isinstance(event, Sampled | StateEvent) else None
        lengths = ",".join(str(len(frame)) for frame in frames[2:])
        kind = str(event.__struct_config__.tag)
        row = (event.seq, kind, event.id, measurement, frames[0], frames[1], lengths, digest)
        self._db.execute("INSERT INTO events VALUES (?,?,?,?,?,?,?,?)", row)
        if isinstance(event, StateEvent) and measurement:
            self._db.execute("UPDATE measurements SET state = ? WHERE id = ?", (event.state, measurement))
        if isinstance(event, FitEvent | DiagnosisEvent):
            row = (*_key(event), measurement, _succeeded(event), event.seq)
            self._db.execute("INSERT OR REPLACE INTO fits VALUES (?,?,?,?,?,?,?)", row)

    @contextmanager
    def _transaction(self) -> Generator[None]:
        """All or nothing."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")


def is_written(folder: Path) -> bool:
    """Return whether a living process has the journal open for writing."""
    if not (folder / LOCK).exists():
        return False
    try:
        _lock(folder, patience=0).close()
    except JournalError:
        return True
    return False


def _key(event: FitEvent | DiagnosisEvent) -> tuple[str, str, str, str]:
    """Return what a fitter's answer is known by: kind, sweeps, fitter, version."""
    return (str(event.__struct_config__.tag), " ".join(event.sweeps), event.fitter, event.version)


def _succeeded(event: FitEvent | DiagnosisEvent) -> bool:
    """Return False for a refusal."""
    return not (isinstance(event, FitEvent) and event.report is None)


def _lock(folder: Path, patience: float = 2.0) -> sqlite3.Connection:
    """Take the writer's lock: a transaction held for as long as the process lives, on every platform.

    Waits `patience` seconds, so that a daemon that is just ending does not keep the next one out.
    """
    with told(folder):
        lock = sqlite3.connect(folder / LOCK, timeout=patience, isolation_level=None)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        lock.close()
        if "locked" in str(error):
            raise JournalError(f"{folder}: another daemon writes this journal; only one can") from None
        raise JournalError(f"{folder / LOCK}: the journal cannot be locked: {error}") from error
    return lock


def _sync_folder(folder: Path) -> None:
    """Make a rename last; Windows neither can nor needs it."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
