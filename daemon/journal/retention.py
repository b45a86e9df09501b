"""Copying a journal, and removing its oldest part after copying it."""

from pathlib import Path

import msgspec

from ...models.sweep import now_utc
from ..files.database_url import without_password
from .journal_reader import JournalReader
from .journal_writer import JournalWriter
from .store import JournalError, Place
from .stores.array_file import split_array, with_index
from .stores.array_folder import copy_file
from .stores.chain import chain_found, chain_removed
from .stores.database_file import SEALS
from .stores.folder_store import FolderStore
from .stores.migrations import TABLES

COLUMNS = {
    "builds": "hash, json",
    "runs": "id, time, station",
    "measurements": "id, request, run, sample, step, build, state, time, station",
    "events": "seq, kind, id, measurement, topic, header, lengths, hash, station",
    "fits": "kind, sweeps, fitter, version, measurement, ok, seq, station",
    "prunings": "seq, time, backup, station",
    "gaps": "first, last, time, says, station",
    "chain": "number, kind, subject, digest, link, station",
}
"""The copied columns of each table: all but the numbers of runs and measurements, which are assigned again."""

ORDER = {"runs": "number", "measurements": "number", "events": "station, seq", "chain": "station, number"}


class JournalMaintenance(JournalWriter):
    """A journal opened for copying and pruning; no daemon may write its folder or its station meanwhile."""

    def prune(self, before: str, backup: Place) -> int:
        """Copy the journal to `backup`, then remove this station's older events; return how many were removed.

        `before` is an RFC 3339 time in UTC, or its beginning, such as `2026-01-01`. Only complete measurements are
        removed: everything from the oldest remaining one on is kept. Raises JournalError, and then nothing was removed.
        """
        copy_journal(self, backup)
        stays = self._one("SELECT min(number) FROM measurements WHERE time >= ? AND station = ?", before, self.station)
        number = stays[0] if stays and stays[0] is not None else self._after_last()
        if self._one("SELECT 1 FROM measurements WHERE number < ? AND station = ?", number, self.station) is None:
            return 0  # events before the first measurement are kept with it
        last = self._one(
            "SELECT coalesce(min(seq) - 1, (SELECT max(seq) FROM events WHERE station = ?)) FROM events "
            "WHERE station = ? AND measurement IN (SELECT id FROM measurements WHERE number >= ? AND station = ?)",
            *(self.station, self.station, number, self.station),
        )
        seq = int(last[0] or 0) if last else 0
        gone = self._all("SELECT id, hash FROM events WHERE seq <= ? AND station = ?", seq, self.station)
        if not gone:
            return 0
        with self.store.transaction():
            self._remove(seq, number, without_password(str(backup)))
        self.store.drop_arrays([event for event, digest in gone if digest])
        return len(gone)

    def _remove(self, seq: int, number: int, backup: str) -> None:
        """Remove events up to `seq`, and measurements below `number` to which no remaining event belongs."""
        unused = "number < ? AND NOT EXISTS (SELECT 1 FROM events WHERE events.measurement = measurements.id)"
        chain_removed(self.store, self.station, "fits", "seq <= ?", seq)
        self.store.run("DELETE FROM fits WHERE seq <= ? AND station = ?", seq, self.station)
        self.store.run("DELETE FROM events WHERE seq <= ? AND station = ?", seq, self.station)
        chain_removed(self.store, self.station, "measurements", unused, number)
        self.store.run(f"DELETE FROM measurements WHERE {unused} AND station = ?", number, self.station)  # noqa: S608
        self.store.run("DELETE FROM builds WHERE hash NOT IN (SELECT build FROM measurements)")
        self.store.run("INSERT INTO prunings VALUES (?, ?, ?, ?)", seq, now_utc(), backup, self.station)
        chain_found(self.store, self.station, "prunings", "seq = ?", seq)

    def _after_last(self) -> int:
        row = self._one("SELECT coalesce(max(number), 0) + 1 FROM measurements")
        return int(row[0]) if row else 1


def copy_journal(source: JournalReader, target: Place, station: str = "") -> int:
    """Copy a journal to a new folder or into a database, even while a daemon writes it, and verify the copy.

    `station` names the unnamed station of a folder in a database. Return the number of copied events. Raises
    JournalError if the folder is not empty, if the database has such a station already, or if the copy is damaged.
    """
    if isinstance(target, Path) and target.exists() and not target.is_dir():
        raise JournalError(f"{target}: this is a file; a journal needs a new folder")
    if isinstance(target, Path) and target.exists() and any(target.iterdir()):
        raise JournalError(f"{target}: this folder is not empty; a journal needs a new one")
    copy = JournalReader(target, write=True)
    try:
        with source.store.snapshot():
            stations = {name or station for (name,) in source.store.all("SELECT DISTINCT station FROM runs")}
            known = {name for (name,) in copy.store.all("SELECT DISTINCT station FROM runs")}
            if taken := sorted(stations & known):
                raise JournalError(f"{copy.name}: station {taken[0]!r} is in this journal already")
            with copy.store.transaction():
                copied = {table: _copy_table(source, copy, table, station) for table in TABLES}
            _copy_seals(source, target)
        wrong = copy.verify()
        if wrong:
            raise JournalError(f"{copy.name}: the copy is damaged: {wrong[0]}")
        return copied["events"]
    finally:
        copy.close()


def _copy_seals(source: JournalReader, target: Place) -> None:
    """Copy the seals from one folder to another; those of a database stay in the data folder where they were made."""
    if not isinstance(source.store, FolderStore) or not isinstance(target, Path):
        return
    seals = Path(source.name) / SEALS
    try:
        if seals.exists():
            copy_file(seals, target / SEALS)
    except OSError as error:
        raise JournalError(f"{target}: the seals cannot be copied: {error}") from error


def _copy_table(source: JournalReader, copy: JournalReader, table: str, station: str) -> int:
    """Copy the rows of one table and their arrays; return the number of rows."""
    columns = COLUMNS[table].split(", ")
    order = f" ORDER BY {ORDER[table]}" if table in ORDER else ""
    insert = f"INSERT INTO {table} ({COLUMNS[table]}) VALUES ({', '.join('?' * len(columns))})"  # noqa: S608
    if table == "builds":  # several stations may measure the same build
        insert += " ON CONFLICT (hash) DO NOTHING"
    count = 0
    for row in source.store.stream(f"SELECT {COLUMNS[table]} FROM {table}{order}"):  # noqa: S608
        values = dict(zip(columns, row, strict=True))
        renamed = bool(station) and values.get("station") == ""
        if renamed:
            values["station"] = station
        copy.store.run(insert, *values.values())
        if table == "events" and values["hash"] is not None:
            if renamed:
                _take_renamed(source, copy, values["id"], values["lengths"], station)
            else:
                copy.store.take_array(values["id"], source.store)
        count += 1
    return count


def _take_renamed(source: JournalReader, copy: JournalReader, event: str, lengths: str, station: str) -> None:
    """Copy an array and change the name of the station in its index."""
    content = source.store.read_array(event)
    if content is None:
        return
    array = split_array(content, lengths)
    if array.index is not None:
        content = with_index(array.columns, msgspec.structs.replace(array.index, station=station))
    copy.store.write_array(event, content)
