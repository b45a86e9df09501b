"""The record of everything that was announced: SQLite (WAL) beside a folder of arrays.

A sweep's bytes are written and synced first, then its row is committed, then it may be published. What a `kill -9`
leaves behind is at most a file no row speaks of; it is removed when the journal is opened for writing again.
"""

import hashlib
import os
import sqlite3
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from ..models.build import Build
from ..models.errors import PzctlError
from ..models.sweep import now_utc
from .frames import to_json
from .uuid7 import uuid7
from .wire import DiagnosisEvent, Event, FitEvent, Payload, Sample, Sampled, StateEvent, encode

VERSION = 1
"""Of the tables; kept in `PRAGMA user_version`."""

TABLES = """
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

E = TypeVar("E", bound=Event)


class JournalError(PzctlError):
    """The journal cannot be opened, written or read as it should be."""


@dataclass(frozen=True)
class Measurement:
    """One measurement as the journal knows it."""

    id: str
    run: str
    sample: Sample
    state: str
    time: str


class Journal:
    """The journal in a folder. One process writes, any number read.

    Raises JournalError from every method where the disk or the database does not do what was asked.
    """

    def __init__(self, folder: Path, *, readonly: bool = False) -> None:
        self.folder = folder
        self.arrays = folder / "arrays"
        self.run = ""
        self._lock: sqlite3.Connection | None = None
        with _told(folder):
            if readonly:
                self._db = sqlite3.connect(f"{(folder / 'journal.sqlite').as_uri()}?mode=ro", uri=True)
            else:
                self.arrays.mkdir(parents=True, exist_ok=True, mode=0o700)
                self._lock = _lock(folder / "writer.lock")
                self._db = sqlite3.connect(folder / "journal.sqlite", isolation_level=None)
                self._db.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON")
            found: int = self._db.execute("PRAGMA user_version").fetchone()[0]
            if found == 0 and not readonly:
                self._db.executescript(f"BEGIN; {TABLES} PRAGMA user_version={VERSION}; COMMIT")
            elif found != VERSION:
                raise JournalError(f"{folder}: a journal of version {found}; version {VERSION} is read here")
            self.last_seq: int = self._db.execute("SELECT coalesce(max(seq), 0) FROM events").fetchone()[0]
        if not readonly:
            self._begin_run()

    def close(self) -> None:
        """Let go of the files."""
        self._db.close()
        if self._lock is not None:
            self._lock.close()

    def append(self, event: E, payload: Payload = ()) -> tuple[E, list[bytes]]:
        """Put the event on disk with the next `seq`; return it as stamped, and its frames, now fit to be published.

        An `id` that the event has already is kept.
        """
        stamp = {"run": self.run, "seq": self.last_seq + 1, "id": event.id or uuid7(), "time": now_utc()}
        stamped = msgspec.structs.replace(event, **stamp)
        frames = encode(stamped, payload)
        with _told(self.folder):
            digest = self._write_array(stamped.id, payload) if payload else None
            with self._transaction():
                self._insert(stamped, frames, digest)
        self.last_seq += 1
        return stamped, frames

    def replay(self, since: int, until: int | None, most: int) -> list[list[bytes]]:
        """Return the frames of the events `since` .. `until`, both included, at most `most` of them."""
        rows = "seq BETWEEN ? AND ? ORDER BY seq LIMIT ?"
        return self._frames(rows, max(since, 0), self.last_seq if until is None else until, most)

    def sweeps(self, measurement: str) -> list[list[bytes]]:
        """Return the frames of the sweep events of a measurement, in order."""
        return self._frames("measurement = ? AND kind = 'sweep' ORDER BY seq", measurement)

    def fits(self, measurement: str) -> list[list[bytes]]:
        """Return the frames of what the fitters answered to a measurement, in order."""
        return self._frames("seq IN (SELECT seq FROM fits WHERE measurement = ?) ORDER BY seq", measurement)

    def answered(self, event: FitEvent | DiagnosisEvent) -> int | None:
        """Return the `seq` of the answer that stands already for these sweeps, fitter and version.

        A refusal does not stand in the way of a result.
        """
        row = self._one(
            "SELECT seq, ok FROM fits WHERE kind = ? AND sweeps = ? AND fitter = ? AND version = ?", *_key(event)
        )
        return row[0] if row and (row[1] or not _succeeded(event)) else None

    def begin_measurement(self, request: str, build: Build, step: str) -> tuple[str, bool]:
        """Record that a measurement was accepted; return its id, and False where this request was accepted before."""
        known = self._one("SELECT id FROM measurements WHERE request = ?", request)
        if known:
            return str(known[0]), False
        text, new = to_json(build), uuid7()
        digest = hashlib.sha256(text).hexdigest()
        with _told(self.folder), self._transaction():
            self._db.execute("INSERT OR IGNORE INTO builds VALUES (?, ?)", (digest, text))
            self._db.execute(
                "INSERT INTO measurements (id, request, run, sample, step, build, state, time) VALUES"
                " (?, ?, ?, ?, ?, ?, ?, ?)",
                (new, request, self.run, build.name, step, digest, "queued", now_utc()),
            )
        return new, True

    def measurement(self, found: str) -> Measurement | None:
        """Return the measurement with this id."""
        return next(iter(self.measurements("id = ?", found)), None)

    def build(self, measurement: str) -> Build:
        """Return the build that was measured."""
        row = self._one(
            "SELECT json FROM builds WHERE hash = (SELECT build FROM measurements WHERE id = ?)", measurement
        )
        if row is None:
            raise JournalError(f"{self.folder}: no measurement {measurement!r}")
        return msgspec.json.decode(row[0], type=Build)

    def latest(self, sample: str, step: str, before: str) -> str | None:
        """Return the latest complete measurement of a sample's step that is older than measurement `before`."""
        row = self._one(
            "SELECT id FROM measurements WHERE sample = ? AND step = ? AND state = 'measured' AND number < "
            "(SELECT number FROM measurements WHERE id = ?) ORDER BY number DESC",
            *(sample, step, before),
        )
        return row[0] if row else None

    def unanswered(self, fitter: str) -> list[str]:
        """Return the complete measurements of this run that a fitter has not answered."""
        rows = "state = 'measured' AND run = ? AND id NOT IN (SELECT measurement FROM fits WHERE fitter = ?)"
        return [found.id for found in self.measurements(rows, self.run, fitter)]

    def unfinished(self) -> list[Measurement]:
        """Return the measurements of earlier runs that never came to an end."""
        return self.measurements("state IN ('queued', 'measuring') AND run != ?", self.run)

    def measurements(self, where: str = "1", *values: str) -> list[Measurement]:
        """Return the measurements for which the SQL condition holds, oldest first."""
        rows = self._all(
            f"SELECT id, run, sample, step, state, time FROM measurements WHERE {where} ORDER BY number",  # noqa: S608
            *values,
        )
        return [Measurement(i, run, Sample(sample, step), state, time) for i, run, sample, step, state, time in rows]

    def sweep_ids(self, measurement: str) -> tuple[str, ...]:
        """Return the ids of a measurement's sweeps, in order."""
        rows = self._all("SELECT id FROM events WHERE measurement = ? AND kind = 'sweep' ORDER BY seq", measurement)
        return tuple(row[0] for row in rows)

    def has_sweep(self, sweep: str) -> bool:
        """Return whether there is a sweep with this id."""
        return self._one("SELECT 1 FROM events WHERE id = ? AND kind = 'sweep'", sweep) is not None

    def fitters(self, measurement: str) -> tuple[str, ...]:
        """Return the names of those that answered a measurement with a result."""
        rows = self._all("SELECT DISTINCT fitter FROM fits WHERE measurement = ? AND ok ORDER BY fitter", measurement)
        return tuple(row[0] for row in rows)

    def verify(self) -> list[str]:
        """Compare every array with its hash, and seq with itself; return a sentence for each thing that is wrong."""
        wrong: list[str] = []
        for k, (seq, event, digest) in enumerate(self._all("SELECT seq, id, hash FROM events ORDER BY seq"), start=1):
            if seq != k:
                return [*wrong, f"event {k} is missing: the next one is {seq}"]
            path = self.arrays / f"{event}.bin"
            if digest and not path.exists():
                wrong.append(f"event {seq}: its array {path} is missing")
            elif digest and hashlib.sha256(path.read_bytes()).hexdigest() != digest:
                wrong.append(f"event {seq}: its array {path} is not what was written")
        return wrong

    def _begin_run(self) -> None:
        """Remove what an interrupted write left, and begin a new run."""
        self.run = uuid7()
        with _told(self.folder):
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

    def _frames(self, where: str, *values: str | int) -> list[list[bytes]]:
        """Return the frames of the events for which the SQL condition holds."""
        rows = self._all(f"SELECT id, topic, header, lengths, hash FROM events WHERE {where}", *values)  # noqa: S608
        return [[topic, header, *self._read_array(i, lengths, digest)] for i, topic, header, lengths, digest in rows]

    def _read_array(self, event: str, lengths: str, digest: str | None) -> Iterator[bytes]:
        """Yield an event's raw columns."""
        if digest is None:
            return
        path = self.arrays / f"{event}.bin"
        with _told(path):
            data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != digest:
            raise JournalError(f"{path}: these are not the bytes that were written; the file is damaged")
        begin = 0
        for length in map(int, lengths.split(",")):
            yield data[begin : begin + length]
            begin += length

    def _all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        with _told(self.folder):
            return self._db.execute(sql, values).fetchall()

    def _one(self, sql: str, *values: str | int) -> tuple[Any, ...] | None:
        with _told(self.folder):
            return self._db.execute(sql, values).fetchone()

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


def _key(event: FitEvent | DiagnosisEvent) -> tuple[str, str, str, str]:
    """Return what a fitter's answer is known by: kind, sweeps, fitter, version."""
    return (str(event.__struct_config__.tag), " ".join(event.sweeps), event.fitter, event.version)


def _succeeded(event: FitEvent | DiagnosisEvent) -> bool:
    """Return False for a refusal."""
    return not (isinstance(event, FitEvent) and event.report is None)


def _lock(path: Path) -> sqlite3.Connection:
    """Take the writer's lock: a transaction held for as long as the process lives, on every platform."""
    lock = sqlite3.connect(path, timeout=2, isolation_level=None)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError:
        lock.close()
        raise JournalError(f"{path.parent}: another daemon writes this journal; only one can") from None
    return lock


def _sync_folder(folder: Path) -> None:
    """Make a rename last; Windows neither can nor needs it."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def _told(where: Path) -> Generator[None]:
    """Turn the errors of disk and database into a sentence."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        raise JournalError(f"{where}: the journal cannot be read or written: {error}") from error
