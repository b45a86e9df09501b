"""The client's side of the two sockets: ask until answered, listen without losing anything."""

import time
from collections import deque
from collections.abc import Sequence
from typing import TypeVar

import msgspec
import zmq

from ...models.base.errors import PzctlError
from ..wire.curve_keys import ClientKey
from ..wire.events import WELCOME, Envelope, ReceivedEvent, decode, envelope
from ..wire.frames import LARGEST_FRAME, WireError, from_json, to_json
from ..wire.replies import Answer, EventsAnswer, HelloAnswer, Refusal
from ..wire.requests import HelloRequest, ReplayRequest, Request
from ..wire.socket_options import limit, unlock
from ..wire.uuid7 import uuid7

SILENCE = 20.0
"""Seconds without a beat after which a daemon counts as gone. It beats every second, but while it writes its record it
waits for the disk, and a disk that others keep busy can take ten seconds and more."""

TRIES, PATIENCE = 4, 5.0
"""How often a request is sent, and how many seconds each time is waited for its answer: as long as for a beat."""

LOOKS = 20.0
"""Seconds that are waited where the daemon looks through the whole journal."""

A = TypeVar("A", bound=Answer)


class DaemonError(PzctlError):
    """The daemon cannot be reached, or refused; `code` is its word for the reason."""

    def __init__(self, message: str, code: str = "unreachable") -> None:
        super().__init__(message)
        self.code = code


def not_let_in(endpoint: str) -> DaemonError:
    """Return the error of a socket that libzmq will not send on: at the handshake its peer turned it away for good."""
    return DaemonError(
        f"daemon at {endpoint}: it does not let this client in; the key is missing, not known there, or was revoked",
        "not-allowed",
    )


class RequestClient:
    """Asks the daemon one thing after the other. A request is sent again where no answer comes: ids make that safe."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", endpoint: str, key: ClientKey | None = None) -> None:
        self.endpoint = endpoint
        self._socket = context.socket(zmq.DEALER)
        limit(self._socket)
        unlock(self._socket, key)
        self._socket.connect(endpoint)

    def ask(self, request: Request, expected: type[A], raw: Sequence[bytes] = (), patience: float = PATIENCE) -> A:
        """Return the answer. Raises DaemonError where it is a refusal, or where there is none."""
        return self.ask_frames(request, expected, raw, patience)[0]

    def ask_frames(
        self, request: Request, expected: type[A], raw: Sequence[bytes] = (), patience: float = PATIENCE
    ) -> tuple[A, list[bytes]]:
        """Return the answer and the frames behind it. Raises DaemonError."""
        for _ in range(TRIES):
            try:
                self._socket.send_multipart([to_json(request), *raw], zmq.NOBLOCK)
            except zmq.Again:
                raise not_let_in(self.endpoint) from None
            frames = self._await(request.id, time.monotonic() + patience)
            if frames:
                return read_answer(frames[0], expected), frames[1:]
        raise DaemonError(f"daemon at {self.endpoint}: no answer in {TRIES} tries of {patience:g} s; is it running?")

    def events(self, request: Request) -> tuple[list[ReceivedEvent], bool]:
        """Return the events of an answer that carries some, and whether there are more. Raises DaemonError."""
        answer, frames = self.ask_frames(request, EventsAnswer)
        return read_events(answer, frames), answer.more

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _await(self, request: str, deadline: float) -> list[bytes] | None:
        """Return the answer to this request; those to earlier ones are passed over."""
        while self._socket.poll(max(0, int(1000 * (deadline - time.monotonic())))):
            frames = self._socket.recv_multipart()
            if from_json(frames[0], _answer, LARGEST_FRAME).id in (request, None):
                return frames
        return None


class Subscription:
    """Hears every event from the moment it is made, in order, none lost, none twice.

    What the socket dropped is found by `seq` and asked for again. It listens to all topics, since a reader of one
    topic cannot see its own holes.
    """

    def __init__(
        self,
        context: "zmq.Context[zmq.Socket[bytes]]",
        endpoint: str,
        asker: RequestClient,
        key: ClientKey | None = None,
    ) -> None:
        self.endpoint = endpoint
        self._asker = asker
        self._waiting: deque[ReceivedEvent] = deque()
        self._socket = context.socket(zmq.SUB)
        limit(self._socket)
        unlock(self._socket, key)
        self._socket.subscribe(b"")
        self._socket.connect(endpoint)
        try:
            self._welcome()
            self.seq = asker.ask(HelloRequest(id=uuid7()), HelloAnswer).seq
        except PzctlError:
            self.close()
            raise
        self._heard_at = time.monotonic()

    def receive(self, patience: float) -> ReceivedEvent | None:
        """Return the next event that is no beat, or None where none comes within `patience` seconds.

        Raises DaemonError where the daemon has fallen silent, WireError where it speaks another wire.
        """
        deadline = time.monotonic() + patience
        while not self._waiting:
            left = deadline - time.monotonic()
            if not self._socket.poll(max(0, int(1000 * min(left, 0.5)))):
                if time.monotonic() - self._heard_at > SILENCE:
                    raise DaemonError(
                        f"daemon at {self.endpoint}: not a sound for {SILENCE:g} s; it has ended or hangs"
                    )
                if left <= 0:
                    return None
                continue
            self._heard_at = time.monotonic()
            self._take(self._socket.recv_multipart())
        return self._waiting.popleft()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _welcome(self) -> None:
        if not self._socket.poll(int(1000 * SILENCE)):
            raise DaemonError(f"daemon at {self.endpoint}: no welcome within {SILENCE:g} s; is it running?")
        self._take_welcome(self._socket.recv_multipart())

    def _take_welcome(self, frames: list[bytes]) -> None:
        if frames != [WELCOME]:
            raise WireError(f"endpoint {self.endpoint}: it begins with {frames[0][:40]!r}; a pzctl daemon says welcome")

    def _take(self, frames: list[bytes]) -> None:
        """Put what was heard in order behind what was heard before."""
        if frames == [WELCOME]:  # again after a broken connection
            return
        found = envelope(frames)
        is_beat = found.kind == "beat"
        if found.seq > self.seq + (0 if is_beat else 1):
            self._fill(found.seq if is_beat else found.seq - 1)
        if is_beat or found.seq <= self.seq:
            return
        self.seq = found.seq
        self._keep(found, frames)

    def _keep(self, found: Envelope, frames: list[bytes]) -> None:
        if found.kind in Envelope.KINDS:  # a later daemon may say more than is known here
            self._waiting.append(decode(frames))

    def _fill(self, until: int) -> None:
        """Ask for what was missed, up to and including `until`."""
        more = True
        while more:
            heard, more = self._asker.events(ReplayRequest(id=uuid7(), since=self.seq + 1, until=until))
            for event in heard:
                self.seq = event.event.seq
                self._waiting.append(event)
        self.seq = max(self.seq, until)


_answer = msgspec.json.Decoder(Answer)
_refusal = msgspec.json.Decoder(Refusal)


def read_answer(header: bytes, expected: type[A]) -> A:
    """Return an answer's header. Raises DaemonError where it is a refusal."""
    if not from_json(header, _answer, LARGEST_FRAME).ok:
        problem = from_json(header, _refusal).error
        raise DaemonError(f"{problem.message}{'; ' + problem.hint if problem.hint else ''}", problem.code)
    return from_json(header, msgspec.json.Decoder(expected), LARGEST_FRAME)


def read_events(answer: EventsAnswer, frames: Sequence[bytes]) -> list[ReceivedEvent]:
    """Return the events whose frames stand behind an answer. Raises WireError."""
    heard: list[ReceivedEvent] = []
    for count in answer.frames:
        event, frames = frames[:count], frames[count:]
        heard.append(decode(event))
    return heard
