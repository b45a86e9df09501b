"""Following the daemon's events: each once, in order, none lost unless the journal itself has lost it."""

import time
from collections import deque

from ..wire.events import WELCOME, Envelope, ReceivedEvent, decode, envelope
from ..wire.frames import WireError
from ..wire.replies import HelloAnswer, MissingEvents
from ..wire.requests import HelloRequest
from ..wire.uuid7 import uuid7
from .protocol import Conversation, DaemonError, Hear, Subscribe, ask_frames, replay_page

SILENCE = 20.0
"""Seconds without a beat after which a daemon counts as gone. It beats every second, but while it writes its record it
waits for the disk, and a disk that others keep busy can take ten seconds and more."""


class EventFollower:
    """Puts in order what one subscription hears; what it missed is found by `seq` and asked for again."""

    def __init__(self, events: str, requests: str) -> None:
        self._events = events
        self._requests = requests
        self._seq = 0
        self._heard_at = 0.0
        self._waiting: deque[ReceivedEvent | MissingEvents] = deque()

    def open(self) -> Conversation[None]:
        """Subscribe; every event from now on is heard. Raises DaemonError, and WireError where no daemon is there.

        The daemon is asked first where it stands: who is not let in learns it at once, and what is said until the
        subscription counts is found missing and asked for again.
        """
        hello, _ = yield from ask_frames(self._requests, HelloRequest(id=uuid7()), HelloAnswer)
        self._seq = hello.seq
        yield Subscribe()
        frames = yield Hear(SILENCE)
        if frames is None:
            raise DaemonError(f"daemon at {self._events}: no welcome within {SILENCE:g} s; is it running?")
        if frames != [WELCOME]:
            raise WireError(f"endpoint {self._events}: it begins with {frames[0][:40]!r}; a pzctl daemon says welcome")
        self._heard_at = time.monotonic()

    def receive(self, patience: float) -> Conversation[ReceivedEvent | MissingEvents | None]:
        """Return the next event that is no beat, or which ones are missing before it; None after `patience` seconds.

        Raises DaemonError where the daemon has fallen silent, WireError where it speaks another wire.
        """
        deadline = time.monotonic() + patience
        while not self._waiting:
            silent_at = self._heard_at + SILENCE
            frames = yield Hear(max(0.0, min(deadline, silent_at) - time.monotonic()))
            if frames is not None:
                self._heard_at = time.monotonic()
                yield from self._take(frames)
            elif time.monotonic() >= silent_at:
                raise DaemonError(f"daemon at {self._events}: not a sound for {SILENCE:g} s; it has ended or hangs")
            elif time.monotonic() >= deadline:
                return None
        return self._waiting.popleft()

    def _take(self, frames: list[bytes]) -> Conversation[None]:
        """Put what was heard in order behind what was heard before."""
        if frames == [WELCOME]:  # again after a broken connection
            return
        found = envelope(frames)
        before = found.seq if found.kind == "beat" else found.seq - 1
        if before > self._seq:
            yield from self._fill(before)
        if found.kind == "beat" or found.seq <= self._seq:
            return
        self._seq = found.seq
        if found.kind in Envelope.KINDS:  # a later daemon may say more than is known here
            self._waiting.append(decode(frames))

    def _fill(self, until: int) -> Conversation[None]:
        """Ask for what was missed, up to and including `until`."""
        since: int | None = self._seq + 1
        while since is not None:
            page = yield from replay_page(self._requests, since, until)
            self._waiting += page.items
            self._seq = (page.next or until + 1) - 1
            since = page.next
