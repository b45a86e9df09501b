"""The client's side of the protocol without sockets, shared by the blocking and the asyncio client.

A conversation is a generator. It yields the next step to carry out on a socket, is sent the outcome of that step, and
returns its result. The client that runs it owns the sockets and does the waiting; nothing here opens, sends or sleeps.
"""

import logging
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Generic, TypeAlias, TypeVar

import msgspec

from ...models.base.errors import PzctlError
from ..wire.events import Envelope, ReceivedEvent, decode, envelope, seq_of
from ..wire.frames import LARGEST_FRAME, WireError, from_json, to_json
from ..wire.replies import Answer, EventsAnswer, MissingEvents, Refusal
from ..wire.requests import HelloRequest, ReplayRequest, Request
from ..wire.uuid7 import uuid7

log = logging.getLogger(__name__)

TRIES, PATIENCE = 4, 5.0
"""How often a daemon that says nothing is asked, and for how many seconds the client waits for an answer each time."""

FIRST_NOTE = 10.0
"""Seconds after which it is said that the client waits, and again each time when twice as much has passed."""

A = TypeVar("A", bound=Answer)
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class DaemonError(PzctlError):
    """The daemon cannot be reached, or refused; `code` names the reason."""

    def __init__(self, message: str, code: str = "unreachable") -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class Ask:
    """Send these frames to the daemon and wait for the answer to one of these requests: its frames, or None."""

    frames: list[bytes]
    requests: tuple[str, ...]
    """The ids of the requests."""
    seconds: float


@dataclass(frozen=True)
class Subscribe:
    """Open a subscription to all events: with one topic only, gaps could not be seen. It has no outcome."""


@dataclass(frozen=True)
class Hear:
    """Wait for the next message of the subscription: its frames, or None."""

    seconds: float


@dataclass(frozen=True)
class Knock:
    """Ask the daemon's machine whether anybody still publishes events there: no frames, or None if nobody does."""


@dataclass(frozen=True)
class Deliver(Generic[T_co]):
    """Hand this item to the caller, who may take any time over it. It has no outcome."""

    item: T_co


Step: TypeAlias = Ask | Subscribe | Hear | Knock
Outcome: TypeAlias = list[bytes] | None
Conversation: TypeAlias = Generator[Step, Outcome, T]
"""Ends with a result."""
Stream: TypeAlias = Generator[Step | Deliver[T], Outcome, None]
"""Delivers one item after the other."""


class Underway(Generic[T]):
    """A running conversation: its next `step`, or its `result` once `step` is None."""

    def __init__(self, conversation: Generator[Step | Deliver[object], Outcome, T]) -> None:
        self._conversation = conversation
        self.step: Step | Deliver[object] | None = None
        self.result: T
        self.go_on(None)

    def go_on(self, outcome: Outcome) -> None:
        """Send the outcome of its step to the conversation."""
        self._advance(lambda: self._conversation.send(outcome))

    def fail(self, error: BaseException) -> None:
        """Raise the error of a step inside the conversation, which may clean up before it ends."""
        self._advance(lambda: self._conversation.throw(error))

    def _advance(self, move: Callable[[], Step | Deliver[object]]) -> None:
        try:
            self.step = move()
        except StopIteration as end:
            self.step, self.result = None, end.value


def ask_frames(
    endpoint: str, request: Request, expected: type[A], raw: Sequence[bytes] = (), patience: float = PATIENCE
) -> Conversation[tuple[A, list[bytes]]]:
    """Return the answer to a request and the frames after it.

    A request without an answer is sent again, which its id makes safe. In between, a `hello` asks for a sign of life:
    the client waits for as long as there is one, and logs that it waits. `patience` is in seconds for each try. Raises
    DaemonError if the daemon refuses, or answers neither.
    """
    hello = HelloRequest(id=uuid7())
    tries = (
        Ask([to_json(request), *raw], (request.id,), patience),
        Ask([to_json(hello)], (request.id, hello.id), patience),
    )
    begun, note, silent = time.monotonic(), FIRST_NOTE, 0
    for attempt in cycle(tries):
        answer = yield attempt
        if answer is None:
            silent += 1
            if silent == TRIES:
                break
        elif from_json(answer[0], _answer, LARGEST_FRAME).id != hello.id:
            return read_answer(answer[0], expected), answer[1:]
        else:
            silent, passed = 0, time.monotonic() - begun
            if passed >= note:
                name = request.__struct_config__.tag
                log.warning("daemon at %s: busy, no answer to `%s` for %.0f s; waiting for it", endpoint, name, passed)
                note = 2 * passed
    raise DaemonError(f"daemon at {endpoint}: no answer in {TRIES} tries of {patience:g} s; is it running?")


def addressee(frames: Sequence[bytes], waiting: Iterable[str]) -> str | None:
    """Return which of the waiting requests an answer belongs to, or None if it belongs to none of them.

    An answer without an id belongs to a request that the daemon could not read, so it is assigned only if a single
    request waits. Raises WireError if it is no answer.
    """
    request, known = from_json(frames[0], _answer, LARGEST_FRAME).id, tuple(waiting)
    if request is None and len(known) == 1:
        return known[0]
    return request if request in known else None


def not_let_in(endpoint: str) -> DaemonError:
    """Return the error for a socket that libzmq cannot send on because the daemon refused its key at the handshake."""
    return DaemonError(
        f"daemon at {endpoint}: it refuses this client; the key is missing, not known there, or was revoked",
        "not-allowed",
    )


def read_answer(header: bytes, expected: type[A]) -> A:
    """Return an answer's header. Raises DaemonError if it is a refusal."""
    if not from_json(header, _answer, LARGEST_FRAME).ok:
        problem = from_json(header, _refusal).error
        raise DaemonError(f"{problem.message}{'; ' + problem.hint if problem.hint else ''}", problem.code)
    return from_json(header, msgspec.json.Decoder(expected), LARGEST_FRAME)


class UnreadableEvent(MissingEvents, frozen=True):
    """An event that this client cannot read, at its place among the others."""

    @property
    def sentence(self) -> str:
        """A sentence for people."""
        return f"event {self.first} cannot be read: {self.says}"


def read_or_report(frames: Sequence[bytes]) -> ReceivedEvent | UnreadableEvent | None:
    """Return an event, or the reason why it cannot be read; None for a kind of a newer daemon.

    Raises WireError if it is no event at all or has another wire version.
    """
    try:
        return decode(frames) if envelope(frames).kind in Envelope.KINDS else None
    except WireError as error:
        seq = seq_of(frames)
        if seq is None:
            raise
        return UnreadableEvent(seq, seq, str(error))


def read_events(answer: EventsAnswer, frames: Sequence[bytes]) -> list[ReceivedEvent]:
    """Return the events whose frames follow an answer; leave out kinds of a newer daemon. Raises WireError."""
    return [decode(event) for event in _split(answer, frames) if envelope(event).kind in Envelope.KINDS]


def _split(answer: EventsAnswer, frames: Sequence[bytes]) -> Iterator[Sequence[bytes]]:
    """Yield the frames of each event after an answer."""
    for count in answer.frames:
        event, frames = frames[:count], frames[count:]
        yield event


@dataclass(frozen=True)
class ReplayPage:
    """One answer to a replay."""

    items: list[ReceivedEvent | MissingEvents]
    """In order; a range that the journal no longer holds is one item with the reason."""
    next: int | None
    """The first `seq` of the next page; None if this is the last."""


def replay_page(endpoint: str, since: int, until: int | None) -> Conversation[ReplayPage]:
    """Return the events from `since` up to `until` (None: the newest), as many as fit into one answer."""
    request = ReplayRequest(id=uuid7(), since=since, until=until)
    answer, frames = yield from ask_frames(endpoint, request, EventsAnswer)
    events = [event for one in _split(answer, frames) if (event := read_or_report(one)) is not None]
    items = sorted([*events, *answer.missing], key=first_of)
    return ReplayPage(items, first_of(events[-1]) + 1 if answer.more and events else None)


def first_of(item: ReceivedEvent | MissingEvents) -> int:
    """Return the `seq` of an event, or the first one of those that are missing."""
    return item.first if isinstance(item, MissingEvents) else item.event.seq


_answer = msgspec.json.Decoder(Answer)
_refusal = msgspec.json.Decoder(Refusal)
