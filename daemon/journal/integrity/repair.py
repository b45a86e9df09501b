"""Rebuilding a folder journal's database from the indexes of its arrays, and from what is left of the old database.

Nothing is removed and nothing is guessed: the old database is kept beside the new one, an array without a valid index
is moved to `orphans/` and reported. Events without an array, such as withdrawals and the audit log, are taken from the
old database as far as it can be read; the others are recorded as a gap.
"""

import sqlite3
from collections import defaultdict
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from ....models.sweep import now_utc
from ...wire.events import DiagnosisEvent, Event, FitEvent, Sampled, SweepEvent, decode
from ...wire.frames import WireError
from ..store import JournalError, digest_of
from ..stores.array_file import ArrayIndex, find_index, split_array
from ..stores.array_folder import ArrayFolder, free_name
from ..stores.chain import chain_found
from ..stores.database_file import DATABASE, database_fault
from ..stores.event_rows import WITHDRAWN, insert_answer, insert_event_row, set_state
from ..stores.folder_lock import take_lock
from ..stores.folder_store import FolderStore
from .salvage import Salvage, last_states, salvage

TAIL = 1000
"""Event numbers left unused after the last array, because events without an array may have been published there."""

UNENDED = (None, "queued", "measuring", "cancelling")
"""States of a measurement that is not over, or not known."""


@dataclass(frozen=True)
class _Item:
    """An event whose row is written: of an array (with its index), or of the old database."""

    station: str
    run: str
    run_time: str
    row: tuple[Any, ...]
    """Its seq, kind, id, measurement, topic, header, lengths and hash."""
    event: Event
    index: ArrayIndex | None = None

    @property
    def seq(self) -> int:
        return self.event.seq

    @property
    def id(self) -> str:
        return self.event.id


@dataclass
class RepairReport:
    """The results of a repair."""

    events: int = 0
    """Number of events rebuilt from recordings."""
    salvaged: int = 0
    """Number of events without a recording, such as withdrawals, read from the damaged database."""
    measurements: int = 0
    kept_database: Path | None = None
    """Path of the old database."""
    set_aside: list[str] = field(default_factory=list[str])
    """One sentence for each file that was moved to `orphans/`."""
    lost: list[str] = field(default_factory=list[str])
    """One sentence for each kind of loss."""


class _HeaderBuild(msgspec.Struct, frozen=True):
    """The build in a sweep's header, as the bytes whose hash identifies the build."""

    build: msgspec.Raw


_header_build = msgspec.json.Decoder(_HeaderBuild)


def repair_folder(folder: Path) -> RepairReport:
    """Rebuild the rows that the database lacks from the arrays. Raises JournalError, and then nothing was removed.

    Rows are added to an intact database that names some of the arrays; any other database is replaced by a new one,
    which takes over the rows that can still be read.
    """
    files, report = ArrayFolder(folder), RepairReport()
    with closing(take_lock(folder)):
        files.make()
        items, faults = _read_arrays(files)
        if not items:
            raise JournalError(
                f"{folder}: none of the {len(faults)} recording(s) in arrays/ has a valid index; nothing was changed: "
                f"restore {DATABASE} from a backup, or move arrays/ away to begin a new journal"
            )
        usable = _is_usable(folder)
        report.kept_database = _keep_database(folder, usable)
        saved = Salvage() if usable else _salvaged(report.kept_database, items, report)
        store = FolderStore(folder, write=True, unchecked=True)
        try:
            with store.transaction():
                faults |= _Rebuild(store, saved, report).run(items)
            names = {row[0] for row in store.all("SELECT id FROM events WHERE hash IS NOT NULL")}
            strangers = files.strangers(names)
            if strangers:
                files.set_aside(strangers)
            report.set_aside = [f"{path.name}: {faults.get(path.stem, 'no row names it')}" for path in strangers]
        finally:
            store.close()
    return report


def _read_arrays(files: ArrayFolder) -> tuple[list[_Item], dict[str, str]]:
    """Return the arrays whose rows can be rebuilt, and the reasons why others cannot, by name."""
    items: list[_Item] = []
    faults: dict[str, str] = {}
    for path in files.files():
        data = files.read(path.stem) or b""
        index = find_index(data)
        if index is None:
            faults[path.stem] = "it has no index: an earlier pzctl wrote it, or its end is damaged"
            continue
        array = split_array(data, index.lengths)
        try:
            event = decode([index.topic.encode(), index.header.encode(), *_columns(array.columns, index)]).event
        except WireError as error:
            faults[path.stem] = f"its index cannot be read: {error}"
            continue
        if array.damaged or digest_of(array.columns) != index.hash or not index.id == event.id == path.stem:
            faults[path.stem] = "it is damaged"
        else:
            measurement = event.measurement if isinstance(event, Sampled) else None
            header = (index.seq, index.kind, index.id, measurement, index.topic.encode(), index.header.encode())
            row = (*header, index.lengths, index.hash)
            items.append(_Item(index.station, index.run, index.run_time, row, event, index))
    return items, faults


def _columns(data: bytes, index: ArrayIndex) -> list[bytes]:
    columns: list[bytes] = []
    for length in map(int, index.lengths.split(",")):
        columns.append(data[:length])
        data = data[length:]
    return columns


def _salvaged(kept: Path | None, items: Sequence[_Item], report: RepairReport) -> Salvage:
    """Return the readable contents of the old database, if it belongs to these arrays; add the rest to the report."""
    if kept is None:
        report.lost.append("there was no database")
        return Salvage()
    saved = salvage(kept)
    report.lost += [f"old database: {sentence}" for sentence in saved.lost]
    if saved.with_array.isdisjoint(item.id for item in items):
        report.lost.append(
            "old database: no row that can be read names one of the recordings; nothing was taken from it"
        )
        return Salvage()
    return saved


def _keep_database(folder: Path, usable: bool) -> Path | None:
    """Copy a usable database, or rename the files of an unusable one; return the path of the kept database, if any."""
    kept = free_name(folder / f"{DATABASE}.before-repair")
    if usable:
        with closing(sqlite3.connect(folder / DATABASE)) as db, closing(sqlite3.connect(kept)) as copy:
            db.backup(copy)
        return kept
    files = [folder / f"{DATABASE}{end}" for end in ("", "-wal", "-shm") if (folder / f"{DATABASE}{end}").exists()]
    for path in files:
        path.rename(kept.with_name(kept.name + path.name.removeprefix(DATABASE)))
    return kept if files else None


def _is_usable(folder: Path) -> bool:
    """Return whether a database is intact and names an existing array."""
    if database_fault(folder) is not None:
        return False
    try:
        # read only at first, so that a damaged database stays unchanged
        with closing(sqlite3.connect(f"{(folder / DATABASE).absolute().as_uri()}?mode=ro", uri=True)) as db:
            if db.execute("PRAGMA integrity_check").fetchone() != ("ok",):
                return False
        with closing(FolderStore(folder, write=True, unchecked=True)) as store:
            names = store.all("SELECT id FROM events WHERE hash IS NOT NULL")
            return any(store.files.path(name).exists() for (name,) in names)
    except (JournalError, sqlite3.DatabaseError):
        return False


class _Rebuild:
    """Writes the rows of one repair, inside a transaction."""

    def __init__(self, store: FolderStore, saved: Salvage, report: RepairReport) -> None:
        self._store = store
        self._saved = saved
        self._report = report
        self._states = last_states(saved.events)
        self._gone = 0

    def run(self, arrays: Sequence[_Item]) -> dict[str, str]:
        """Write the rows that the database lacks; return the reasons why arrays were left out, by name."""
        names = {row[0] for row in self._store.all("SELECT id FROM events")}
        times = {run: time for run, time, _ in self._saved.runs}
        stations: dict[str, list[_Item]] = defaultdict(list)
        for saved in self._saved.events:
            run = saved.event.run
            item = _Item(saved.station, run, times.get(run, saved.event.time), saved.row, saved.event)
            stations[saved.station].append(item)
        for item in arrays:
            if item.id not in names:
                stations[item.station].append(item)
        for station, row in self._saved.prunings:
            self._store.run("INSERT INTO prunings VALUES (?, ?, ?, ?)", *row, station)
            chain_found(self._store, station, "prunings", "seq = ?", row[0])
        faults: dict[str, str] = {}
        for station, of_station in sorted(stations.items()):
            faults |= self._station(station, of_station)
        if self._gone:
            self._report.lost.append(
                f"{self._gone} event(s) without a recording, such as states, are lost; withdrawals and entries of the "
                "audit log may be among them"
            )
        return faults

    def _station(self, station: str, items: Sequence[_Item]) -> dict[str, str]:
        newest = self._store.newest(station)
        faults: dict[str, str] = {}
        of_seq: dict[int, _Item] = {}
        for item in sorted(items, key=lambda item: (self._is_in_old(item), item.event.time, item.id)):
            if item.seq <= newest:
                faults[item.id] = f"event {item.seq} is in the journal already, pruned or with another array"
                continue
            earlier = of_seq.get(item.seq)
            if earlier:
                faults[earlier.id] = f"event {item.seq} was written again later, as {item.id}"
            of_seq[item.seq] = item
        new = [of_seq[seq] for seq in sorted(of_seq)]
        if new:
            self._runs(station, new)
            measurements = self._measurements(station, new)
            self._events(station, newest, new)
            self._set_states(station, new, measurements)
        return faults

    def _is_in_old(self, item: _Item) -> bool:
        """Return whether the old database holds this event: another array of its number was never announced."""
        return item.index is None or item.id in self._saved.with_array

    def _runs(self, station: str, items: Sequence[_Item]) -> None:
        known = {row[0] for row in self._store.all("SELECT id FROM runs")}
        runs = {run: time for run, time, of_station in self._saved.runs if of_station == station}
        for run, time in (runs | {item.run: item.run_time for item in items}).items():
            if run not in known:
                self._store.run("INSERT INTO runs (id, time, station) VALUES (?, ?, ?)", run, time, station)
                chain_found(self._store, station, "runs", "id = ?", run)

    def _measurements(self, station: str, items: Sequence[_Item]) -> list[str]:
        """Write the measurements of the old database, and those of sweeps, whose headers hold the build."""
        known = set(
            self._store.all("SELECT id FROM measurements") + self._store.all("SELECT request FROM measurements")
        )
        rows: dict[str, tuple[int, tuple[Any, ...], bytes]] = {}
        for item in items:
            measured = item.index.measurement if item.index else None
            if item.index is None or measured is None or not isinstance(item.event, SweepEvent):
                continue
            build = bytes(_header_build.decode(item.index.header).build)
            row = (measured.id, measured.request, measured.run, measured.sample, measured.step, measured.build)
            rows[measured.id] = (measured.number, (*row, measured.time), build)
        for name, saved in self._saved.measurements.items():
            if saved.station == station and name not in rows and saved.row[5] in self._saved.builds:
                rows[name] = (saved.number, (*saved.row[:6], saved.row[7]), self._saved.builds[saved.row[5]])
        written: list[str] = []
        for _, (name, request, *rest), build in sorted(rows.values()):
            if (name,) in known or (request,) in known or digest_of(build) != rest[3]:
                continue
            known |= {(name,), (request,)}
            self._store.run("INSERT INTO builds VALUES (?, ?) ON CONFLICT (hash) DO NOTHING", rest[3], build)
            self._store.run(
                "INSERT INTO measurements (id, request, run, sample, step, build, state, time, station)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                *(name, request, *rest[:4], "abandoned", rest[4], station),
            )
            chain_found(self._store, station, "measurements", "id = ?", name)
            self._report.measurements += 1
            written.append(name)
        return written

    def _events(self, station: str, newest: int, items: Sequence[_Item]) -> None:
        for item in items:
            self._gap(station, newest + 1, item.seq - 1, "lost with the database: events without an array")
            self._gone += item.seq - 1 - newest
            insert_event_row(self._store, station, item.row)
            if isinstance(item.event, FitEvent | DiagnosisEvent):
                insert_answer(self._store, station, item.event)
            newest = item.seq
            self._report.events += item.index is not None
            self._report.salvaged += item.index is None
        self._gap(station, newest + 1, newest + TAIL, "left out after a repair: events published here are not known")

    def _gap(self, station: str, first: int, last: int, says: str) -> None:
        if first <= last:
            self._store.run("INSERT INTO gaps VALUES (?, ?, ?, ?, ?)", first, last, now_utc(), says, station)
            chain_found(self._store, station, "gaps", "first = ?", first)

    def _set_states(self, station: str, items: Sequence[_Item], written: Sequence[str]) -> None:
        """Set the states of measurements: from the old database, otherwise complete if no segment is missing."""
        sweeps = {item.event.measurement: item.event for item in items if isinstance(item.event, SweepEvent)}
        for measurement in dict.fromkeys([*sweeps, *written]):
            saved = self._saved.measurements.get(measurement)
            told = (self._states.get(measurement), saved.row[6] if saved else None)
            ended = [state for state in told if state not in UNENDED]
            if WITHDRAWN in told:
                state = WITHDRAWN
                if told[0] != WITHDRAWN:
                    self._report.lost.append(f"measurement {measurement} is withdrawn; who did it and why is lost")
            else:
                state = ended[0] if ended else self._state_of(measurement, sweeps.get(measurement))
            if state is not None:
                set_state(self._store, station, measurement, state)

    def _state_of(self, measurement: str, sweep: SweepEvent | None) -> str | None:
        """Return the state of a measurement with all its segments, or None if some are missing."""
        sql = "SELECT count(*) FROM events WHERE measurement = ? AND kind = 'sweep'"
        if sweep is None or self._store.all(sql, measurement)[0][0] < sweep.segments:
            return None
        return "measured-aside" if sweep.decides else "measured"
