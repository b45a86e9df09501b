"""The daemon's events as one gapless sequence: each once, in order, as far as the journal holds them."""

import math
import time
from collections import deque

from ..wire.events import WELCOME, BeatEvent, ReceivedEvent, envelope
from ..wire.frames import WireError
from ..wire.replies import HelloAnswer, MissingEvents
from ..wire.requests import HelloRequest
from ..wire.uuid7 import uuid7
from .protocol import (
    Conversation,
    DaemonError,
    Hear,
    Knock,
    Subscribe,
    ask_frames,
    first_of,
    read_or_report,
    replay_page,
)

SILENCE = 20.0
"""Seconds without a beat after which the daemon is assumed to have ended. It sends a beat every second, but not while
it waits for the disk to write its journal, and a busy disk can take ten seconds and more."""

QUIET = 2.5
"""Seconds without a beat after which the daemon's machine is asked whether the daemon is still there."""


class EventFollower:
    """Orders the events of one subscription; it finds missing ones by their `seq` and requests them again.

    It goes on after a restart of the daemon if it `survives_restart`; whatever waits for a result had better not.
    """

    def __init__(self, events: str, requests: str, *, survives_restart: bool = False) -> None:
        self._events = events
        self._requests = requests
        self._quiet = math.inf if survives_restart else QUIET
        self._seq = 0
        self._last_message_at = 0.0
        self._knock_at = 0.0
        self._waiting: deque[ReceivedEvent | MissingEvents] = deque()

    def open(self) -> Conversation[None]:
        """Subscribe to every event from now on. Raises DaemonError, or WireError if the endpoint is no pzctl daemon's.

        It first asks the daemon for its latest `seq`. A client without access so learns it at once, and events sent
        before the subscription takes effect are found missing and requested again.
        """
        hello, _ = yield from ask_frames(self._requests, HelloRequest(id=uuid7()), HelloAnswer)
        self._seq = hello.seq
        yield Subscribe()
        frames = yield Hear(SILENCE)
        if frames is None:
            raise DaemonError(f"daemon at {self._events}: no welcome within {SILENCE:g} s; is it running?")
        if frames != [WELCOME]:
            raise WireError(f"endpoint {self._events}: it begins with {frames[0][:40]!r}; a pzctl daemon says welcome")
        self._heard()

    def receive(self, patience: float) -> Conversation[ReceivedEvent | MissingEvents | None]:
        """Return the next event other than a beat, or the range missing before it; None after `patience` seconds.

        Raises DaemonError if the daemon has ended or fallen silent, WireError if a message is malformed.
        """
        deadline = time.monotonic() + patience
        while not self._waiting:
            silent_at = self._last_message_at + SILENCE
            frames = yield Hear(max(0.0, min(deadline, silent_at, self._knock_at) - time.monotonic()))
            if frames is not None:
                self._heard()
                yield from self._take(frames)
            elif time.monotonic() >= silent_at:
                raise DaemonError(f"daemon at {self._events}: silent for {SILENCE:g} s; it has ended or hangs")
            elif time.monotonic() >= deadline:
                return None
            elif (yield Knock()) is None:
                raise DaemonError(f"daemon at {self._events}: it has ended; nobody listens there any more")
            else:
                self._knock_at = time.monotonic() + self._quiet
        return self._waiting.popleft()

    def _heard(self) -> None:
        self._last_message_at = time.monotonic()
        self._knock_at = self._last_message_at + self._quiet

    def _take(self, frames: list[bytes]) -> Conversation[None]:
        """Add a received message to the events in order; first fill the gap before it."""
        if frames == [WELCOME]:  # again after a broken connection
            return
        received = read_or_report(frames)
        is_beat = isinstance(received, ReceivedEvent) and isinstance(received.event, BeatEvent)
        seq = envelope(frames).seq if received is None else first_of(received)
        before = seq if is_beat else seq - 1
        if before > self._seq:
            yield from self._fill(before)
        if is_beat or seq <= self._seq:
            return
        self._seq = seq
        if received is not None:  # a newer daemon may send kinds unknown here
            self._waiting.append(received)

    def _fill(self, until: int) -> Conversation[None]:
        """Request the missed events, up to and including `until`."""
        since: int | None = self._seq + 1
        while since is not None:
            page = yield from replay_page(self._requests, since, until)
            self._waiting += page.items
            self._seq = (page.next or until + 1) - 1
            since = page.next
