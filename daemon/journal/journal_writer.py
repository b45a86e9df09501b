"""Writing the journal, in a folder or on a server.

A sweep's bytes and its row are completely on disk before it is published; see `folder_store` and `postgres_store`.
"""

import hashlib
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeVar

import msgspec

from ...models.build import Build
from ...models.sweep import now_utc
from ..wire.events import Event, Payload, encode
from ..wire.frames import to_json
from ..wire.uuid7 import uuid7
from .journal_reader import JournalMeasurement, JournalReader
from .opening import open_store
from .store import JournalAway, JournalError, Store, digest_of
from .stores.array_file import with_index
from .stores.chain import chain_found
from .stores.event_rows import Answer, answer_key, index_of, insert_event, succeeded
from .stores.folder_lock import take_lock

E = TypeVar("E", bound=Event)


class JournalWriter(JournalReader):
    """The journal opened for writing, by one process per data folder and per station. Opening it starts a new run.

    The journal is in the folder, or in the database at `url`, in which case the folder only holds the lock. Every
    method raises JournalError if disk or database fail.
    """

    def __init__(self, folder: Path, url: str | None = None, station: str = "") -> None:
        with ExitStack() as stack:
            self._lock = take_lock(folder)
            stack.callback(self._lock.close)
            super().__init__(url or folder, station, write=True)
            stack.callback(self.store.close)
            self.store.claim(station)
            self.last_seq = self.newest
            self.run = uuid7()
            self.store.set_orphans_aside()
            with self.store.transaction():
                self.store.run("INSERT INTO runs (id, time, station) VALUES (?, ?, ?)", self.run, now_utc(), station)
                chain_found(self.store, station, "runs", "id = ?", self.run)
            stack.pop_all()

    def close(self) -> None:
        """Close the journal and release the lock."""
        super().close()
        self._lock.close()

    def append(self, event: E, payload: Payload = ()) -> tuple[E, list[bytes]]:
        """Write an event with the next `seq`; return it with its stamp, and its frames, which may now be published.

        An event that has an `id` keeps it.
        """
        stamp = {"run": self.run, "seq": self.last_seq + 1, "id": event.id or uuid7(), "time": now_utc()}
        stamped = msgspec.structs.replace(event, **stamp)
        frames = encode(stamped, payload)
        data = b"".join(payload)
        digest = digest_of(data) if payload else None
        with self.store.transaction():
            insert_event(self.store, self.station, stamped, frames, digest)
            if digest is not None:
                index = index_of(self.store, self.station, stamped, frames, digest)
                self.store.write_array(stamped.id, with_index(data, index))
        self.last_seq += 1
        return stamped, frames

    @contextmanager
    def together(self) -> Generator[None]:
        """Write all rows inside, or none of them."""
        last_seq = self.last_seq
        try:
            with self.store.transaction():
                yield
        except BaseException:
            self.last_seq = last_seq
            raise

    def said(self, event: str) -> list[bytes] | None:
        """Return the frames of the event with this id, or None if there is none."""
        return next(iter(self._frames("id = ?", event)), None)

    def reopened(self) -> Store:
        """Open this journal's store again after its server was away; the old one stays open.

        Raises JournalAway also while the server does not know yet that the old connection has ended.
        """
        store = open_store(self._place, write=True)
        try:
            store.claim(self.station)
        except JournalError as error:
            store.close()
            says = f"its server still has the earlier connection of station {self.station!r}, or another daemon has it"
            raise JournalAway(f"{self.name}: {says}; nothing is measured until it is released") from error
        return store

    def resume(self, store: Store) -> None:
        """Continue with a reopened store. Raises JournalError if the journal changed meanwhile."""
        self.store.close()
        self.store = store
        newest = self.newest
        runs = "SELECT id FROM runs WHERE station = ? ORDER BY number DESC LIMIT 1"
        ours = self._one(runs, self.station) == (self.run,)
        if not ours or newest not in (self.last_seq, self.last_seq + 1):  # one more if the server's answer was lost
            raise JournalError(
                f"{self.name}: the journal of station {self.station!r} ended at event {self.last_seq} when its server "
                f"went away, and ends at {newest} now: another daemon wrote it meanwhile, or the server lost events"
            )
        self.last_seq = newest

    def answered(self, event: Answer) -> int | None:
        """Return the `seq` of an earlier answer of this fitter and version to these sweeps, or None.

        An earlier refusal does not count if the new answer is a result.
        """
        row = self._one(
            "SELECT seq, ok FROM fits WHERE kind = ? AND sweeps = ? AND fitter = ? AND version = ?", *answer_key(event)
        )
        return row[0] if row and (row[1] or not succeeded(event)) else None

    def begin_measurement(self, request: str, build: Build, step: str) -> tuple[str, bool]:
        """Record an accepted measurement; return its id, and False if the same request was accepted before.

        Raises JournalError if there is no room for its sweeps, or if the id belongs to another request.
        """
        text, new = to_json(build), uuid7()
        digest = hashlib.sha256(text).hexdigest()
        known = self._one("SELECT id, step, build FROM measurements WHERE request = ?", request)
        if known:
            if (known[1], known[2]) != (step, digest):
                raise JournalError(f"id {request!r} belongs to another measurement; give every request a unique id")
            return str(known[0]), False
        self.store.check_room()
        with self.store.transaction():
            # an existing build is written again, so that a concurrent prune cannot remove it
            self.store.run(
                "INSERT INTO builds VALUES (?, ?) ON CONFLICT (hash) DO UPDATE SET json = excluded.json", digest, text
            )
            self.store.run(
                "INSERT INTO measurements (id, request, run, sample, step, build, state, time, station) VALUES"
                " (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                *(new, request, self.run, build.name, step, digest, "queued", now_utc(), self.station),
            )
            chain_found(self.store, self.station, "measurements", "id = ?", new)
        return new, True

    def unfinished(self) -> list[JournalMeasurement]:
        """Return the measurements of earlier runs that never ended."""
        rows = "state IN ('queued', 'measuring', 'cancelling') AND run != ? AND station = ?"
        return self.measurements(rows, self.run, self.station)

    def unanswered(self, fitter: str) -> list[str]:
        """Return the complete measurements of this run that a fitter has not answered."""
        rows = "state = 'measured' AND run = ? AND id NOT IN (SELECT measurement FROM fits WHERE fitter = ?)"
        return [measured.id for measured in self.measurements(rows, self.run, fitter)]
