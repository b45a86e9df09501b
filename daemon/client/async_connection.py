"""The asyncio client's side of the two sockets: many questions at a time, and listeners that lose nothing."""

import asyncio
from collections import deque
from collections.abc import Sequence
from typing import TypeVar

import msgspec
import zmq
import zmq.asyncio

from ..wire.curve_keys import ClientKey
from ..wire.events import WELCOME, Envelope, ReceivedEvent, decode, envelope
from ..wire.frames import LARGEST_FRAME, WireError, from_json, to_json
from ..wire.replies import Answer, EventsAnswer, HelloAnswer
from ..wire.requests import HelloRequest, ReplayRequest, Request
from ..wire.socket_options import limit, unlock
from ..wire.uuid7 import uuid7
from .connection import PATIENCE, SILENCE, TRIES, DaemonError, not_let_in, read_answer, read_events

A = TypeVar("A", bound=Answer)


class AsyncRequestClient:
    """Asks the daemon; answers find who asked by their id. A request is sent again where no answer comes."""

    def __init__(self, context: zmq.asyncio.Context, endpoint: str, key: ClientKey | None) -> None:
        self.endpoint = endpoint
        self._socket = context.socket(zmq.DEALER)
        limit(self._socket)  # pyright: ignore[reportArgumentType]
        unlock(self._socket, key)  # pyright: ignore[reportArgumentType]
        self._socket.connect(endpoint)
        self._waiting: dict[str, asyncio.Future[list[bytes]]] = {}
        self._reader = asyncio.create_task(self._read())

    async def ask(self, request: Request, expected: type[A], patience: float = PATIENCE) -> A:
        """Return the answer. Raises DaemonError where it is a refusal, or where there is none."""
        return (await self.ask_frames(request, expected, patience))[0]

    async def ask_frames(
        self, request: Request, expected: type[A], patience: float = PATIENCE
    ) -> tuple[A, Sequence[bytes]]:
        """Return the answer and the frames behind it. Raises DaemonError."""
        answered = self._waiting[request.id] = asyncio.get_running_loop().create_future()
        try:
            for _ in range(TRIES):
                try:
                    await self._socket.send(to_json(request), zmq.NOBLOCK)
                except zmq.Again:
                    raise not_let_in(self.endpoint) from None
                done, _ = await asyncio.wait({answered}, timeout=patience)
                if done:
                    header, *frames = answered.result()
                    return read_answer(header, expected), frames
        finally:
            del self._waiting[request.id]
        raise DaemonError(f"daemon at {self.endpoint}: no answer in {TRIES} tries of {patience:g} s; is it running?")

    async def events(self, request: Request) -> tuple[list[ReceivedEvent], bool]:
        """Return the events of an answer that carries some, and whether there are more. Raises DaemonError."""
        answer, frames = await self.ask_frames(request, EventsAnswer)
        return read_events(answer, frames), answer.more

    async def close(self) -> None:
        """Close the socket; who still waits for an answer gets none."""
        self._reader.cancel()
        await asyncio.wait({self._reader})
        self._socket.close()

    async def _read(self) -> None:
        while True:
            frames = await self._socket.recv_multipart()
            waiting = self._waiting.get(from_json(frames[0], _answer, LARGEST_FRAME).id or "")
            if waiting is not None and not waiting.done():
                waiting.set_result(frames)


class AsyncSubscription:
    """Hears every event from the moment it is opened, in order, none lost, none twice: `connection.Subscription`."""

    def __init__(
        self, context: zmq.asyncio.Context, endpoint: str, asker: AsyncRequestClient, key: ClientKey | None
    ) -> None:
        self.endpoint = endpoint
        self._asker = asker
        self._waiting: deque[ReceivedEvent] = deque()
        self._seq = 0
        self._socket = context.socket(zmq.SUB)
        limit(self._socket)  # pyright: ignore[reportArgumentType]
        unlock(self._socket, key)  # pyright: ignore[reportArgumentType]
        self._socket.subscribe(b"")
        self._socket.connect(endpoint)

    async def open(self) -> None:
        """Wait until everything arrives. Raises DaemonError, WireError."""
        frames = await self._received(SILENCE, "no welcome")
        if frames != [WELCOME]:
            raise WireError(f"endpoint {self.endpoint}: it begins with {frames[0][:40]!r}; a pzctl daemon says welcome")
        self._seq = (await self._asker.ask(HelloRequest(id=uuid7()), HelloAnswer)).seq

    async def receive(self) -> ReceivedEvent:
        """Return the next event that is no beat. Raises DaemonError where the daemon has fallen silent."""
        while not self._waiting:
            await self._take(await self._received(SILENCE, "not a sound"))
        return self._waiting.popleft()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    async def _received(self, patience: float, what: str) -> list[bytes]:
        if not await self._socket.poll(int(1000 * patience)):
            raise DaemonError(f"daemon at {self.endpoint}: {what} for {patience:g} s; it has ended or hangs")
        return await self._socket.recv_multipart()

    async def _take(self, frames: list[bytes]) -> None:
        """Put what was heard in order behind what was heard before; what was missed is asked for."""
        if frames == [WELCOME]:  # again after a broken connection
            return
        found = envelope(frames)
        is_beat = found.kind == "beat"
        until = found.seq if is_beat else found.seq - 1
        more = until > self._seq
        while more:
            heard, more = await self._asker.events(ReplayRequest(id=uuid7(), since=self._seq + 1, until=until))
            self._waiting.extend(heard)
            self._seq = heard[-1].event.seq if heard else until
        if is_beat or found.seq <= self._seq:
            return
        self._seq = found.seq
        if found.kind in Envelope.KINDS:
            self._waiting.append(decode(frames))


_answer = msgspec.json.Decoder(Answer)
