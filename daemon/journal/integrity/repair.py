"""Rebuilding a folder journal's database from the indexes of its arrays.

Nothing is removed and nothing is guessed: the old database is kept beside the new one, an array without a valid index
is moved to `orphans/` and reported, and events without an array, such as states, are recorded as a gap.
"""

import sqlite3
from collections import defaultdict
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from ....models.sweep import now_utc
from ...wire.events import DiagnosisEvent, Event, FitEvent, Sampled, SweepEvent, decode
from ...wire.frames import WireError
from ..store import JournalError, digest_of
from ..stores.array_file import ArrayIndex, find_index, split_array
from ..stores.array_folder import ArrayFolder, free_name
from ..stores.chain import chain_found
from ..stores.database_file import DATABASE, database_fault
from ..stores.event_rows import insert_answer, insert_event_row, set_state
from ..stores.folder_lock import take_lock
from ..stores.folder_store import FolderStore

TAIL = 1000
"""Event numbers left unused after the last array, because events without an array may have been published there."""

_Item = tuple[ArrayIndex, Event]


@dataclass
class RepairReport:
    """The results of a repair."""

    events: int = 0
    """Number of rebuilt rows of events."""
    measurements: int = 0
    kept_database: Path | None = None
    """Path of the old database."""
    set_aside: list[str] = field(default_factory=list[str])
    """One sentence for each file that was moved to `orphans/`."""


class _HeaderBuild(msgspec.Struct, frozen=True):
    """The build in a sweep's header, as the bytes whose hash identifies the build."""

    build: msgspec.Raw


_header_build = msgspec.json.Decoder(_HeaderBuild)


def repair_folder(folder: Path) -> RepairReport:
    """Rebuild the rows that the database lacks from the arrays. Raises JournalError, and then nothing was removed.

    Rows are added to an intact database that names some of the arrays; any other database is replaced by a new one.
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
        report.kept_database = _keep_database(folder)
        store = FolderStore(folder, write=True, unchecked=True)
        try:
            with store.transaction():
                faults |= _Rebuild(store, report).run(items)
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
            items.append((index, event))
    return items, faults


def _columns(data: bytes, index: ArrayIndex) -> list[bytes]:
    columns: list[bytes] = []
    for length in map(int, index.lengths.split(",")):
        columns.append(data[:length])
        data = data[length:]
    return columns


def _keep_database(folder: Path) -> Path | None:
    """Copy a usable database, or rename the files of another one; return the path of what was kept, if anything."""
    kept = free_name(folder / f"{DATABASE}.before-repair")
    if _is_usable(folder):
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

    def __init__(self, store: FolderStore, report: RepairReport) -> None:
        self._store = store
        self._report = report

    def run(self, items: Sequence[_Item]) -> dict[str, str]:
        """Write the rows that the database lacks; return the reasons why arrays were left out, by name."""
        names = {row[0] for row in self._store.all("SELECT id FROM events")}
        stations: dict[str, list[_Item]] = defaultdict(list)
        for item in items:
            if item[0].id not in names:
                stations[item[0].station].append(item)
        faults: dict[str, str] = {}
        for station, of_station in sorted(stations.items()):
            faults |= self._station(station, of_station)
        return faults

    def _station(self, station: str, items: Sequence[_Item]) -> dict[str, str]:
        newest = self._store.newest(station)
        faults: dict[str, str] = {}
        of_seq: dict[int, _Item] = {}
        for index, event in sorted(items, key=lambda item: (item[0].seq, item[1].time, item[0].id)):
            if index.seq <= newest:
                faults[index.id] = f"event {index.seq} is in the journal already, pruned or with another array"
                continue
            earlier = of_seq.get(index.seq)
            if earlier:
                faults[earlier[0].id] = f"event {index.seq} was written again later, as {index.id}"
            of_seq[index.seq] = (index, event)
        new = list(of_seq.values())
        if new:
            self._runs(station, new)
            self._measurements(station, new)
            self._events(station, newest, new)
            self._states(station, new)
        return faults

    def _runs(self, station: str, items: Sequence[_Item]) -> None:
        known = {row[0] for row in self._store.all("SELECT id FROM runs")}
        for run, time in {index.run: index.run_time for index, _ in items}.items():
            if run not in known:
                self._store.run("INSERT INTO runs (id, time, station) VALUES (?, ?, ?)", run, time, station)
                chain_found(self._store, station, "runs", "id = ?", run)

    def _measurements(self, station: str, items: Sequence[_Item]) -> None:
        """Write the measurements of the sweeps, whose headers hold the build."""
        known = {row[0] for row in self._store.all("SELECT id FROM measurements")}
        of_sweeps = {
            index.measurement.id: (index.measurement, bytes(_header_build.decode(index.header).build))
            for index, event in items
            if index.measurement and isinstance(event, SweepEvent) and index.measurement.id not in known
        }
        for measured, build in sorted(of_sweeps.values(), key=lambda pair: pair[0].number):
            if digest_of(build) != measured.build:
                continue
            self._store.run("INSERT INTO builds VALUES (?, ?) ON CONFLICT (hash) DO NOTHING", measured.build, build)
            self._store.run(
                "INSERT INTO measurements (id, request, run, sample, step, build, state, time, station)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                *(measured.id, measured.request, measured.run, measured.sample, measured.step, measured.build),
                *("abandoned", measured.time, station),
            )
            chain_found(self._store, station, "measurements", "id = ?", measured.id)
            self._report.measurements += 1

    def _events(self, station: str, newest: int, items: Sequence[_Item]) -> None:
        for index, event in items:
            self._gap(station, newest + 1, index.seq - 1, "lost with the database: events without an array")
            measurement = event.measurement if isinstance(event, Sampled) else None
            header = (index.seq, index.kind, index.id, measurement, index.topic.encode(), index.header.encode())
            insert_event_row(self._store, station, (*header, index.lengths, index.hash))
            if isinstance(event, FitEvent | DiagnosisEvent):
                insert_answer(self._store, station, event)
            newest = index.seq
            self._report.events += 1
        self._gap(station, newest + 1, newest + TAIL, "left out after a repair: events published here are not known")

    def _gap(self, station: str, first: int, last: int, says: str) -> None:
        if first <= last:
            self._store.run("INSERT INTO gaps VALUES (?, ?, ?, ?, ?)", first, last, now_utc(), says, station)
            chain_found(self._store, station, "gaps", "first = ?", first)

    def _states(self, station: str, items: Sequence[_Item]) -> None:
        """Set the state of measurements with all their segments to complete; the others stay abandoned."""
        sweeps = {event.measurement: event for _, event in items if isinstance(event, SweepEvent)}
        for measurement, sweep in sweeps.items():
            sql = "SELECT count(*) FROM events WHERE measurement = ? AND kind = 'sweep'"
            if self._store.all(sql, measurement)[0][0] >= sweep.segments:
                set_state(self._store, station, measurement, "measured-aside" if sweep.decides else "measured")
