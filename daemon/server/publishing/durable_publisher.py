"""Writes every event to the journal and then publishes it; if the journal is away, once it is back.

It is away while its server cannot be reached, or another program has locked its database.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

import msgspec

from ....models.build import Build
from ...journal.journal_writer import JournalWriter
from ...journal.store import JournalAway, JournalError
from ...wire.events import Event, Payload, ProgressEvent, StateEvent
from ...wire.metrics import Metrics
from ...wire.uuid7 import uuid7
from .spool import Spool

log = logging.getLogger(__name__)

KNOCK = 1.0
"""Seconds between two attempts to reach a journal that is away."""


@contextmanager
def logged_if_not_kept(what: str) -> Generator[None]:
    """Log a JournalError instead of raising it: what must be done whether or not the journal can keep it."""
    try:
        yield
    except JournalError as error:
        log.error("not in the journal: %s: %s", what, error)


class DurablePublisher:
    """Publishes every event: `say` sends its frames, then `said` is called with the event."""

    def __init__(
        self,
        journal: JournalWriter,
        unsaved: Spool,
        metrics: Metrics,
        say: Callable[[Sequence[bytes]], None],
        said: Callable[[Event], None],
    ) -> None:
        self._journal = journal
        self._unsaved = unsaved
        self._metrics = metrics
        self._say = say
        self._said = said
        self._there = asyncio.Event()
        self._there.set()

    @property
    def is_away(self) -> bool:
        """Whether the journal is away, or has not yet received all events it missed."""
        return not self._there.is_set()

    async def there(self) -> None:
        """Wait until the journal takes events."""
        await self._there.wait()

    def publish(self, event: Event, payload: Payload) -> None:
        """Write an event to the journal, then publish it. Raises JournalError, and then nothing was published.

        While the journal is away, the event is kept in the data folder and published when the journal is back.
        """
        named = msgspec.structs.replace(event, id=event.id or uuid7())
        if not self._there.is_set():
            self._put_off(named, payload)
            return
        try:
            self._keep_and_say(named, payload)
        except JournalAway as error:
            log.error("%s", error)
            self._there.clear()
            self._put_off(named, payload)

    def begin(self, request: str, build: Build, step: str, queued: StateEvent) -> tuple[str, bool]:
        """Record an accepted measurement together with the event that says so, and publish the event.

        Return the measurement's id, and False if the same request was accepted before. Raises JournalError, and then
        nothing was recorded.
        """
        began = time.monotonic()
        try:
            with self._journal.together():
                measurement, new = self._journal.begin_measurement(request, build, step)
                if not new:
                    return measurement, False
                stamped, frames = self._journal.append(msgspec.structs.replace(queued, measurement=measurement))
        except JournalAway:
            self._there.clear()
            raise
        self._announce(stamped, frames, began)
        return measurement, True

    def catch_up(self) -> None:
        """Publish the postponed events, those of an earlier run as well. Raises JournalError."""
        while self._unsaved:
            event, payload = self._unsaved.first()
            frames = self._journal.said(event.id)
            if frames is None:
                self._keep_and_say(event, payload)
            else:  # a server had written the event before the connection was lost
                self._say(frames)
                self._said(event)
            self._unsaved.drop()

    async def mend(self) -> None:
        """Catch up whenever the journal was away, reconnected to its server if it has one; runs until cancelled.

        Raises JournalError if the journal is not the same as before.
        """
        while True:
            await asyncio.sleep(KNOCK)
            if self._there.is_set() and not self._journal.store.gone:
                continue
            self._there.clear()
            try:
                if self._journal.store.gone:
                    self._journal.resume(await asyncio.to_thread(self._journal.reopened))
            except JournalAway as error:
                log.warning("%s", error)
                continue
            try:
                with self._journal.together():  # also if nothing was postponed: a locked database is away still
                    pass
                self.catch_up()
            except JournalError as error:  # its disk is full, for example
                log.warning("%s", error)
                continue
            log.info("%s: the journal is back", self._journal.name)
            self._there.set()

    def _keep_and_say(self, event: Event, payload: Payload) -> None:
        began = time.monotonic()
        stamped, frames = self._journal.append(event, payload)
        self._announce(stamped, frames, began)

    def _announce(self, stamped: Event, frames: Sequence[bytes], began: float) -> None:
        self._say(frames)
        self._metrics.lasted("publish", time.monotonic() - began)
        self._said(stamped)

    def _put_off(self, event: Event, payload: Payload) -> None:
        if not isinstance(event, ProgressEvent):  # progress is of no use later
            self._unsaved.put(event, payload)
