"""Reading the record of everything that was announced, while the daemon goes on writing it."""

import hashlib
import sqlite3
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from ..models.build import Build
from ..models.errors import PzctlError
from .migrations import VERSION
from .wire import Sample


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


class Archive:
    """A journal's folder, opened for reading; any number of processes may.

    Raises JournalError from every method where the disk or the database does not do what was asked.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.arrays = folder / "arrays"
        with told(folder):
            self._db = self._open()
            found: int = self._db.execute("PRAGMA user_version").fetchone()[0]
            if found != VERSION:
                self._db.close()
                raise JournalError(
                    f"{folder}: a journal of version {found}; version {VERSION} is read here"
                    + ("; start the daemon once, which brings it up to date" if found < VERSION else "")
                )

    def close(self) -> None:
        """Let go of the files."""
        self._db.close()

    @property
    def newest(self) -> int:
        """The `seq` of the last event, be it still there or not; 0 where there was none."""
        row = self._one("SELECT max(seq) FROM (SELECT seq FROM events UNION ALL SELECT seq FROM prunings)")
        return row[0] or 0 if row else 0

    def replay(self, since: int, until: int | None, most: int) -> list[list[bytes]]:
        """Return the frames of the events `since` .. `until`, both included, at most `most` of them."""
        rows = "seq BETWEEN ? AND ? ORDER BY seq LIMIT ?"
        return self._frames(rows, since, self.newest if until is None else until, most)

    def sweeps(self, measurement: str) -> list[list[bytes]]:
        """Return the frames of the sweep events of a measurement, in order."""
        return self._frames("measurement = ? AND kind = 'sweep' ORDER BY seq", measurement)

    def fits(self, measurement: str) -> list[list[bytes]]:
        """Return the frames of what the fitters answered to a measurement, in order."""
        return self._frames("seq IN (SELECT seq FROM fits WHERE measurement = ?) ORDER BY seq", measurement)

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

    def answers(self, measurement: str, fitter: str) -> int:
        """Return how many answers of a fitter to a measurement are kept."""
        row = self._one("SELECT count(*) FROM fits WHERE measurement = ? AND fitter = ?", measurement, fitter)
        return row[0] if row else 0

    @property
    def database(self) -> sqlite3.Connection:
        """The open database, to be copied."""
        return self._db

    @property
    def size(self) -> int:
        """The number of events that are there."""
        row = self._one("SELECT count(*) FROM events")
        return row[0] if row else 0

    def with_arrays(self) -> list[str]:
        """Return the ids of the events that have an array."""
        return [row[0] for row in self._all("SELECT id FROM events WHERE hash IS NOT NULL")]

    def verify(self) -> list[str]:
        """Compare every array with its hash, and seq with itself; return a sentence for each thing that is wrong."""
        wrong: list[str] = []
        pruned = (self._one("SELECT max(seq) FROM prunings") or (None,))[0] or 0
        rows = self._all("SELECT seq, id, hash FROM events ORDER BY seq")
        for k, (seq, event, digest) in enumerate(rows, start=pruned + 1):
            if seq != k:
                return [*wrong, f"event {k} is missing: the next one is {seq}"]
            path = self.arrays / f"{event}.bin"
            if digest and not path.exists():
                wrong.append(f"event {seq}: its array {path} is missing")
            elif digest and hashlib.sha256(path.read_bytes()).hexdigest() != digest:
                wrong.append(f"event {seq}: its array {path} is not what was written")
        return wrong

    def _open(self) -> sqlite3.Connection:
        return sqlite3.connect(f"{(self.folder / 'journal.sqlite').absolute().as_uri()}?mode=ro", uri=True)

    def _frames(self, where: str, *values: str | int) -> list[list[bytes]]:
        """Return the frames of the events for which the SQL condition holds."""
        rows = self._all(f"SELECT id, topic, header, lengths, hash FROM events WHERE {where}", *values)  # noqa: S608
        return [[topic, header, *self._read_array(i, lengths, digest)] for i, topic, header, lengths, digest in rows]

    def _read_array(self, event: str, lengths: str, digest: str | None) -> Iterator[bytes]:
        """Yield an event's raw columns."""
        if digest is None:
            return
        path = self.arrays / f"{event}.bin"
        with told(path):
            data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != digest:
            raise JournalError(f"{path}: these are not the bytes that were written; the file is damaged")
        begin = 0
        for length in map(int, lengths.split(",")):
            yield data[begin : begin + length]
            begin += length

    def _all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        with told(self.folder):
            return self._db.execute(sql, values).fetchall()

    def _one(self, sql: str, *values: str | int) -> tuple[Any, ...] | None:
        with told(self.folder):
            return self._db.execute(sql, values).fetchone()


@contextmanager
def told(where: Path) -> Generator[None]:
    """Turn the errors of disk and database into a sentence."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        raise JournalError(f"{where}: the journal cannot be read or written: {error}") from error
