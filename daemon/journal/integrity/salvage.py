"""Salvages a damaged database: every row that SQLite can still read and that its chain does not contradict.

The database is copied first, because SQLite changes a file that it opens with its write-ahead log.
"""

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from ...wire.events import Event, Sampled, StateEvent, decode
from ...wire.frames import WireError
from ..store import digest_of
from ..stores.chain import COLUMNS, row_digest, row_key
from ..stores.database_file import DATABASE
from ..stores.migrations import VERSION

_LARGEST_ROWID = 2**62

_Row = tuple[Any, ...]


@dataclass(frozen=True)
class SavedEvent:
    """An event's row as hashed, and the event in it."""

    station: str
    row: _Row
    """Its seq, kind, id, measurement, topic, header, lengths and hash."""
    event: Event


@dataclass(frozen=True)
class SavedMeasurement:
    """A measurement's row as hashed, and its number."""

    station: str
    number: int
    row: _Row
    """Its id, request, run, sample, step, build, state and time."""


@dataclass
class Salvage:
    """The readable contents of a damaged database."""

    runs: list[tuple[str, str, str]] = field(default_factory=list[tuple[str, str, str]])
    """The id, time and station of each run, in the order in which they began."""
    measurements: dict[str, SavedMeasurement] = field(default_factory=dict[str, SavedMeasurement])
    """Each measurement, by id."""
    builds: dict[str, bytes] = field(default_factory=dict[str, bytes])
    events: list[SavedEvent] = field(default_factory=list[SavedEvent])
    """The events without an array: states, refusals and the like."""
    with_array: set[str] = field(default_factory=set[str])
    """Ids of the events with an array."""
    prunings: list[tuple[str, _Row]] = field(default_factory=list[tuple[str, _Row]])
    lost: list[str] = field(default_factory=list[str])
    """One sentence for each kind of row that could not be read completely."""


def salvage(database: Path) -> Salvage:
    """Return the readable contents of the database at this path, which may have a write-ahead log beside it."""
    found = Salvage()
    with tempfile.TemporaryDirectory(dir=database.parent, prefix="salvage-") as folder:
        for end in ("", "-wal"):
            if (path := database.with_name(database.name + end)).exists():
                shutil.copy(path, Path(folder) / f"{DATABASE}{end}")
        try:
            with closing(sqlite3.connect(Path(folder) / DATABASE, isolation_level=None)) as db:
                db.text_factory = _text
                db.execute("PRAGMA writable_schema=ON")  # otherwise SQLite reads nothing of a truncated file
                version = db.execute("PRAGMA user_version").fetchone()[0]
                if version != VERSION:
                    found.lost.append(f"nothing can be taken from a damaged database of version {version}")
                else:
                    _Reader(db, found).read()
        except (sqlite3.Error, OSError) as error:
            found.lost.append(f"nothing can be read of it: {error}")
    return found


class _Reader:
    """Reads the tables of one database."""

    def __init__(self, db: sqlite3.Connection, found: Salvage) -> None:
        self._db = db
        self._found = found
        self._digests: dict[tuple[str, str, str], str] = {}

    def read(self) -> None:
        """Read all tables, the chain first, which tells whether a row is unchanged."""
        for _, station, kind, subject, digest in self._rows("chain", "station, kind, subject, digest"):
            self._digests[station, kind, subject] = digest
        for _, station, row in self._whole("runs"):
            self._found.runs.append((row[0], row[1], station))
        for _, station, row in self._whole("prunings"):
            self._found.prunings.append((station, row))
        for _, digest, text in self._rows("builds", "hash, json"):
            if isinstance(text, bytes) and digest_of(text) == digest:
                self._found.builds[digest] = text
        for number, station, row in self._whole("measurements"):
            self._found.measurements[row[0]] = SavedMeasurement(station, number, row)
        self._read_events()

    def _read_events(self) -> None:
        unread = 0
        for _, station, row in self._whole("events"):
            if row[7] is not None:
                self._found.with_array.add(row[2])
            elif (event := _event(row)) is not None:
                self._found.events.append(SavedEvent(station, row, event))
            else:
                unread += 1
        if unread:
            self._found.lost.append(f"events: {unread} row(s) are not what was written")

    def _whole(self, table: str) -> Iterator[tuple[int, str, _Row]]:
        """Yield rowid, station and hashed columns of each row that the chain does not contradict."""
        changed = 0
        for rowid, station, *columns in self._rows(table, f"station, {COLUMNS[table]}"):
            row = tuple(columns)
            try:
                as_written = self._digests.get((station, table, row_key(table, row)), "") in ("", row_digest(row))
            except (TypeError, ValueError, msgspec.MsgspecError):
                as_written = False
            if as_written:
                yield rowid, station, row
            else:
                changed += 1
        if changed:
            self._found.lost.append(f"{table}: {changed} row(s) are not what was written")

    def _rows(self, table: str, columns: str) -> Iterator[_Row]:
        """Yield rowid and columns of the rows that can be read, and note if others cannot."""
        sql = f"SELECT rowid, {columns} FROM {table} NOT INDEXED WHERE rowid > ? ORDER BY rowid"  # noqa: S608
        last, broken = 0, False
        while True:
            try:
                for row in self._db.execute(sql, (last,)):
                    last = row[0]
                    yield row
                break
            except sqlite3.DatabaseError:
                broken = True
                after = self._readable_after(sql, last)
                if after is None:
                    break
                last = after
        if broken:
            self._found.lost.append(f"{table}: part of the table cannot be read")

    def _readable_after(self, sql: str, last: int) -> int | None:
        """Return the first number after `last` from which rows can be read again, or None if there is none."""
        low, step = last, 1
        while not self._is_readable(sql, last + step):
            low, step = last + step, step * 2
            if step > _LARGEST_ROWID:
                return None
        high = last + step
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if self._is_readable(sql, middle) else (middle, high)
        return high

    def _is_readable(self, sql: str, after: int) -> bool:
        try:
            self._db.execute(f"{sql} LIMIT 1", (after,)).fetchone()
        except sqlite3.DatabaseError:
            return False
        return True


def _text(data: bytes) -> str:
    return data.decode(errors="replace")


def _event(row: _Row) -> Event | None:
    """Return the event in a row without an array, or None if the row is not that of this event."""
    seq, kind, name, measurement, topic, header, lengths, _ = row
    try:
        event = decode([topic, header]).event
    except (WireError, TypeError, ValueError):
        return None
    of = event.measurement if isinstance(event, Sampled | StateEvent) else None
    agrees = (event.seq, str(event.__struct_config__.tag), event.id, of, "") == (seq, kind, name, measurement, lengths)
    return event if agrees else None


def last_states(events: Sequence[SavedEvent]) -> dict[str, str]:
    """Return the last state of each measurement according to its events."""
    ordered = sorted(events, key=lambda saved: saved.row[0])
    states = [saved.event for saved in ordered if isinstance(saved.event, StateEvent)]
    return {event.measurement: event.state for event in states if event.measurement}
