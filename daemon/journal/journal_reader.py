"""Reading the journal, also while the daemon writes it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from ...models.build import Build
from ..wire.events import SampleStep, StateEvent, decode
from ..wire.replies import MissingEvents
from .integrity.verification import faults_of
from .opening import open_store
from .store import JournalError, Place, digest_of
from .stores.array_file import split_array
from .stores.views import COLUMNS, constants_query

MOST_REPLAYED = 16 << 20
"""Bytes of events after which one answer to a replay ends; the last event may exceed them."""


@dataclass(frozen=True)
class JournalMeasurement:
    """A measurement in the journal."""

    id: str
    run: str
    sample: SampleStep
    state: str
    time: str


@dataclass(frozen=True)
class History:
    """A measurement, the ids of its sweeps, and the names of the fitters that answered it with a result."""

    measurement: JournalMeasurement
    sweeps: tuple[str, ...]
    fitters: tuple[str, ...]


class JournalReader:
    """A journal opened for reading, in a folder or at a URL, by any number of processes.

    Events are counted and replayed for `station`; measurements are those of all stations. Every method raises
    JournalError if disk, database or server fail.
    """

    def __init__(self, place: Place, station: str = "", *, write: bool = False) -> None:
        self.station = station
        self._place = place
        self.store = open_store(place, write=write)

    @property
    def name(self) -> str:
        """The folder, or the URL without its password."""
        return self.store.name

    def reader(self) -> "JournalReader":
        """Open the same journal again, for reading in another thread."""
        return JournalReader(self._place, self.station)

    def close(self) -> None:
        """Close the journal."""
        self.store.close()

    @property
    def newest(self) -> int:
        """The `seq` of the last event, even if it was pruned; 0 if there was none."""
        return self.store.newest(self.station)

    def replay(self, since: int, until: int | None, most: int) -> list[list[bytes]]:
        """Return the frames of the events `since` .. `until` (both included), at most `most` events.

        Stop after `MOST_REPLAYED` bytes.
        """
        rows = "station = ? AND seq BETWEEN ? AND ? ORDER BY seq LIMIT ?"
        events: list[list[bytes]] = []
        size = 0
        for event in self._each(rows, self.station, since, self.newest if until is None else until, most):
            events.append(event)
            size += sum(map(len, event))
            if size > MOST_REPLAYED:
                break
        return events

    def sweeps(self, measurement: str) -> list[list[bytes]]:
        """Return the frames of the sweep events of a measurement, in order."""
        return self._frames("measurement = ? AND kind = 'sweep' ORDER BY station, seq", measurement)

    def queued(self, measurement: str) -> StateEvent | None:
        """Return the event with which a measurement was accepted, or None if it was pruned."""
        rows = "measurement = ? AND kind = 'state' ORDER BY station, seq LIMIT 1"
        events = [decode(frames).event for frames in self._frames(rows, measurement)]
        return next((event for event in events if isinstance(event, StateEvent) and event.state == "queued"), None)

    def fits(self, measurement: str) -> list[list[bytes]]:
        """Return the frames of the fitters' answers to a measurement, in order."""
        rows = "(station, seq) IN (SELECT station, seq FROM fits WHERE measurement = ?) ORDER BY station, seq"
        return self._frames(rows, measurement)

    def answers_size(self, measurement: str) -> int:
        """Return the size in bytes of all answers of fitters to a measurement."""
        rows = "measurement = ? AND kind IN ('fit', 'diagnosis')"
        answers = self._all(f"SELECT lengths, length(header) FROM events WHERE {rows}", measurement)  # noqa: S608
        return sum(size + sum(int(column) for column in str(lengths).split(",") if column) for lengths, size in answers)

    def measurement(self, measurement: str) -> JournalMeasurement | None:
        """Return the measurement with this id, or None."""
        return next(iter(self.measurements("id = ?", measurement)), None)

    def build(self, measurement: str) -> Build:
        """Return the build of a measurement."""
        row = self._one(
            "SELECT json FROM builds WHERE hash = (SELECT build FROM measurements WHERE id = ?)", measurement
        )
        if row is None:
            raise JournalError(f"{self.name}: no measurement {measurement!r}")
        return msgspec.json.decode(row[0], type=Build)

    def latest(self, sample: str, step: str, before: str) -> str | None:
        """Return the latest complete measurement of a sample's step that is older than measurement `before`."""
        row = self._one(
            "SELECT id FROM measurements WHERE sample = ? AND step = ? AND state = 'measured' AND number < "
            "(SELECT number FROM measurements WHERE id = ?) ORDER BY number DESC",
            *(sample, step, before),
        )
        return row[0] if row else None

    def measurements(self, where: str = "TRUE", *values: str) -> list[JournalMeasurement]:
        """Return the measurements that meet the SQL condition, oldest first."""
        rows = self._all(
            f"SELECT id, run, sample, step, state, time FROM measurements WHERE {where} ORDER BY number",  # noqa: S608
            *values,
        )
        return [
            JournalMeasurement(i, run, SampleStep(sample, step), state, time)
            for i, run, sample, step, state, time in rows
        ]

    def histories(self, sample: str | None = None) -> list[History]:
        """Return every measurement (of one sample) with its sweeps and the fitters that answered, oldest first."""
        where, values = ("sample = ?", [sample]) if sample is not None else ("TRUE", [])
        of = f"measurement IN (SELECT id FROM measurements WHERE {where})"  # noqa: S608
        sweeps: dict[str, list[str]] = {}
        events = f"SELECT measurement, id FROM events WHERE kind = 'sweep' AND {of} ORDER BY station, seq"  # noqa: S608
        for measurement, event in self._all(events, *values):
            sweeps.setdefault(measurement, []).append(event)
        fitters: dict[str, list[str]] = {}
        fits = f"SELECT DISTINCT measurement, fitter FROM fits WHERE ok = 1 AND {of} ORDER BY fitter"  # noqa: S608
        for measurement, fitter in self._all(fits, *values):
            fitters.setdefault(measurement, []).append(fitter)
        return [
            History(measured, tuple(sweeps.get(measured.id, ())), tuple(fitters.get(measured.id, ())))
            for measured in self.measurements(where, *values)
        ]

    def constants(self, *, latest: bool) -> list[dict[str, Any]]:
        """Return the rows of the view `constants` (the latest measurements) or `constants_all`, by column."""
        sql = constants_query(latest=latest, postgres=not isinstance(self._place, Path))
        return [dict(zip(COLUMNS, row, strict=False)) for row in self._all(sql)]

    def sweep_ids(self, measurement: str) -> tuple[str, ...]:
        """Return the ids of a measurement's sweeps, in order."""
        rows = self._all(
            "SELECT id FROM events WHERE measurement = ? AND kind = 'sweep' ORDER BY station, seq", measurement
        )
        return tuple(row[0] for row in rows)

    def sample_of_sweep(self, sweep: str) -> SampleStep | None:
        """Return the sample and step of the sweep with this id, or None if there is no such sweep."""
        row = self._one(
            "SELECT sample, step FROM measurements WHERE id = "
            "(SELECT measurement FROM events WHERE id = ? AND kind = 'sweep')",
            sweep,
        )
        return SampleStep(row[0], row[1]) if row else None

    def fitters(self, measurement: str) -> tuple[str, ...]:
        """Return the names of the fitters that answered a measurement with a result."""
        rows = self._all(
            "SELECT DISTINCT fitter FROM fits WHERE measurement = ? AND ok = 1 ORDER BY fitter", measurement
        )
        return tuple(row[0] for row in rows)

    def answers(self, measurement: str, fitter: str) -> int:
        """Return the number of answers of a fitter to a measurement."""
        row = self._one("SELECT count(*) FROM fits WHERE measurement = ? AND fitter = ?", measurement, fitter)
        return row[0] if row else 0

    @property
    def size(self) -> int:
        """The number of events in the journal."""
        row = self._one("SELECT count(*) FROM events")
        return row[0] if row else 0

    def with_arrays(self) -> list[str]:
        """Return the ids of the events that have an array."""
        return [row[0] for row in self._all("SELECT id FROM events WHERE hash IS NOT NULL")]

    def verify(self) -> list[str]:
        """Check everything against its hash and the chain; return a sentence for each fault."""
        return faults_of(self.store)

    def missing(self, since: int, until: int) -> list[MissingEvents]:
        """Return the ranges of the events `since` .. `until` that were pruned or lost, in order."""
        missing: list[MissingEvents] = []
        first = 1
        prunings = "SELECT seq, time, backup FROM prunings WHERE station = ? ORDER BY seq"
        for last, time, backup in self._all(prunings, self.station):
            missing.append(MissingEvents(first, last, f"pruned on {time[:10]}, after a copy to {backup}"))
            first = last + 1
        gaps = (
            "SELECT first, last, says FROM gaps WHERE station = ? AND first >= ? AND first <= ? AND last >= ? "
            "ORDER BY first"
        )
        missing += [MissingEvents(*row) for row in self._all(gaps, self.station, first, until, since)]
        return [
            msgspec.structs.replace(gap, first=max(gap.first, since), last=min(gap.last, until))
            for gap in missing
            if gap.first <= until and gap.last >= since
        ]

    def _frames(self, where: str, *values: str | int) -> list[list[bytes]]:
        """Return the frames of the events that meet the SQL condition."""
        return list(self._each(where, *values))

    def _each(self, where: str, *values: str | int) -> Iterator[list[bytes]]:
        """Yield the frames of the events that meet the SQL condition, reading their arrays one by one."""
        rows = self._all(f"SELECT id, topic, header, lengths, hash FROM events WHERE {where}", *values)  # noqa: S608
        for i, topic, header, lengths, digest in rows:
            yield [topic, header, *self._read_array(i, lengths, digest)]

    def _read_array(self, event: str, lengths: str, digest: str | None) -> Iterator[bytes]:
        """Yield an event's raw columns."""
        if digest is None:
            return
        content = self.store.read_array(event)
        data = split_array(content, lengths).columns if content is not None else None
        if data is None or digest_of(data) != digest:
            what = "is missing" if data is None else "is damaged"
            raise JournalError(f"{self.name}: the array of event {event} {what}")
        begin = 0
        for length in map(int, lengths.split(",")):
            yield data[begin : begin + length]
            begin += length

    def _all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        return self.store.all(sql, *values)

    def _one(self, sql: str, *values: str | int) -> tuple[Any, ...] | None:
        return next(iter(self.store.all(sql, *values)), None)
