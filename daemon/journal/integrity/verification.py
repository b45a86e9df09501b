"""Verification of a journal: database files, every row against the chain, every array and build against its hash."""

import re
from collections.abc import Iterator
from typing import Any

from ..store import JournalError, Store, digest_of
from ..stores.array_file import ArrayIndex, split_array
from ..stores.chain import COLUMNS, GENESIS, link_after, row_digest, row_key

EventRow = tuple[Any, ...]
"""An event's hashed columns: seq, kind, id, measurement, topic, header, lengths, hash."""


def faults_of(store: Store) -> list[str]:
    """Return a sentence for each fault. A damaged database is not checked further."""
    damage = store.damage()
    if damage:
        return damage
    faults: list[str] = []
    with store.snapshot():
        stations = "SELECT station FROM events UNION SELECT station FROM chain UNION SELECT station FROM runs"
        answers = {row_key("fits", row) for row in store.stream(f"SELECT {COLUMNS['fits']} FROM fits")}  # noqa: S608
        answers |= {key for (key,) in store.stream("SELECT subject FROM chain WHERE kind = 'fits' AND digest = ''")}
        for (station,) in store.all(f"{stations} ORDER BY 1"):
            faults += _StationCheck(store, station, answers).faults()
        faults += _build_faults(store)
    return faults


def _build_faults(store: Store) -> Iterator[str]:
    """Yield the faults of builds, each of which is identified by its hash."""
    for digest, text in store.stream("SELECT hash, json FROM builds"):
        if not isinstance(text, bytes) or digest_of(text) != digest:
            yield f"build {digest[:12]} is not what was written"
    missing = "SELECT id FROM measurements WHERE build NOT IN (SELECT hash FROM builds)"
    for (measurement,) in store.all(missing):
        yield f"measurement {measurement}: its build is missing"


class _StationCheck:
    """Checks the rows of one station against its chain, reading both once, in order."""

    def __init__(self, store: Store, station: str, answers: set[str]) -> None:
        self._store = store
        self._station = station
        self._of = f" of station {station}" if station else ""
        self._answers = answers
        self._newest: dict[tuple[str, str], str] = {}
        rows = store.all("SELECT max(seq) FROM prunings WHERE station = ?", station)
        self._pruned: int = rows[0][0] or 0
        self._gaps = store.all("SELECT first, last FROM gaps WHERE station = ?", station)

    def faults(self) -> Iterator[str]:
        """Yield a sentence for each fault."""
        yield from self._events_and_chain()
        for table in COLUMNS:
            if table != "events":
                yield from self._rows(table)
        for (table, key), digest in self._newest.items():
            if digest and not (table == "fits" and key in self._answers):
                yield f"{table} {key}{self._of}: the row is missing"

    def _events_and_chain(self) -> Iterator[str]:
        """Yield the faults of the chain and of the events, reading both in parallel."""
        sql = f"SELECT {COLUMNS['events']} FROM events WHERE station = ? ORDER BY seq"  # noqa: S608
        events = self._store.stream(sql, self._station)
        event = next(events, None)
        last = self._pruned
        for table, key, digest, fault in self._entries():
            if fault:
                yield fault
            if table != "events":
                self._newest[table, key] = digest
                continue
            seq = int(key) if re.fullmatch(r"[0-9]{1,18}", str(key)) else 0
            if self._is_hole(last + 1, seq - 1):
                yield f"event {last + 1}{self._of} is missing: the next one is {seq}"
            last = max(last, seq)
            while event and event[0] < seq:
                yield from self._unchained(event)
                event = next(events, None)
            if event and event[0] == seq:
                yield from self._event_faults(event, digest)
                event = next(events, None)
            elif seq > self._pruned:
                yield f"event {seq}{self._of} is missing"
        while event:
            yield from self._unchained(event)
            event = next(events, None)

    def _entries(self) -> Iterator[tuple[str, str, str, str]]:
        """Yield table, key, digest and fault (or an empty string) of each entry of the chain."""
        link, number = GENESIS, 0
        columns = "number, kind, subject, digest, link"
        sql = f"SELECT {columns} FROM chain WHERE station = ? ORDER BY number"  # noqa: S608
        for entry, table, key, digest, after in self._store.stream(sql, self._station):
            fault = ""
            if entry != number + 1:
                fault = f"entry {number + 1} of the chain{self._of} is missing: the next one is {entry}"
            elif after != link_after(link, entry, table, key, digest):
                fault = f"entry {entry} of the chain{self._of} does not follow from the one before it"
            yield table, key, digest, fault
            link, number = after, entry

    def _is_hole(self, first: int, last: int) -> bool:
        """Return whether events are missing that neither a pruning nor a repair has recorded."""
        for begin, end in sorted(self._gaps):
            if begin <= first <= end:
                first = end + 1
        return first <= last

    def _unchained(self, event: EventRow) -> Iterator[str]:
        yield f"event {event[0]}{self._of} is in no entry of the chain"
        yield from self._array_faults(event)

    def _event_faults(self, event: EventRow, digest: str) -> Iterator[str]:
        if row_digest(event) != digest:
            yield f"event {event[0]}{self._of}: its row is not what was written"
        yield from self._array_faults(event)

    def _array_faults(self, event: EventRow) -> Iterator[str]:
        seq, kind, name, _, topic, header, lengths, digest = event
        if digest is None:
            return
        subject = f"event {seq}{self._of}"
        try:
            data = self._store.read_array(name)
            array = split_array(data, lengths) if data is not None else None
        except (JournalError, ValueError, TypeError) as error:
            yield f"{subject}: its array cannot be read: {error}"
            return
        if array is None:
            yield f"{subject}: its array {name} is missing"
        elif digest_of(array.columns) != digest:
            yield f"{subject}: its array {name} is not what was written"
        elif array.damaged or (array.index and not _tells(array.index, (seq, kind, name, topic, header, lengths))):
            yield f"{subject}: the index of its array {name} is not what was written"

    def _rows(self, table: str) -> Iterator[str]:
        """Yield the faults of the rows of a table other than `events`."""
        sql = f"SELECT {COLUMNS[table]} FROM {table} WHERE station = ?"  # noqa: S608
        for row in self._store.stream(sql, self._station):
            key = row_key(table, row)
            digest = self._newest.pop((table, key), None)
            if digest is None:
                yield f"{table} {row[0]}{self._of}: the row is in no entry of the chain"
            elif digest != row_digest(row):
                yield f"{table} {row[0]}{self._of}: the row is not what was written"


def _tells(index: ArrayIndex, row: tuple[Any, ...]) -> bool:
    """Return whether an index agrees with the row."""
    return row == (index.seq, index.kind, index.id, index.topic.encode(), index.header.encode(), index.lengths)
