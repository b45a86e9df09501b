"""The client for asyncio programs: the methods of `client.Client`, each to be awaited, any number at the same time.

async with connect_async() as lab:
    measurement = await lab.measure(build, "disk")
    result = await lab.wait_fit("mason", measurement.id)
"""

import asyncio
import math
from collections.abc import AsyncGenerator, Callable, Coroutine
from contextlib import asynccontextmanager
from functools import wraps
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, cast

import zmq
import zmq.asyncio

from ..wire.curve_keys import ClientKey
from ..wire.frames import WireError
from ..wire.socket_options import limit, unlock
from .conversations import Conversations
from .location import address
from .protocol import Ask, Conversation, Hear, Knock, Outcome, Stream, Subscribe, T, Underway, addressee, not_let_in
from .reachability import is_refused

P = ParamSpec("P")


def connect_async(
    events: str | None = None, requests: str | None = None, key: str | Path | None = None
) -> "AsyncClient":
    """Return a client of the daemon at these endpoints, or of the one that runs here, as `client.connect` does.

    Call it while an event loop runs. Raises DaemonError if no daemon runs, KeyFileError if the key cannot be used.
    """
    return AsyncClient(*address(events, requests, key))


def _returning(
    conversation: Callable[Concatenate[Conversations, P], Conversation[T]],
) -> "Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]]":
    """Return a method that runs the conversation and returns its result."""

    @wraps(conversation)
    async def method(client: "AsyncClient", *args: P.args, **kwargs: P.kwargs) -> T:
        return await client.run(conversation(client.conversations, *args, **kwargs))

    return method


def _yielding(
    conversation: Callable[Concatenate[Conversations, P], Stream[T]],
) -> "Callable[Concatenate[AsyncClient, P], AsyncGenerator[T]]":
    """Return a method that runs the conversation and yields its deliveries."""

    @wraps(conversation)
    def method(client: "AsyncClient", *args: P.args, **kwargs: P.kwargs) -> AsyncGenerator[T]:
        return client.stream(conversation(client.conversations, *args, **kwargs))

    return method


def _listening(
    conversation: Callable[Concatenate[Conversations, P], Stream[T | None]],
) -> "Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, AsyncGenerator[T]]]":
    """Return a method that runs the conversation up to its first delivery and then yields the later ones."""

    @wraps(conversation)
    async def method(client: "AsyncClient", *args: P.args, **kwargs: P.kwargs) -> AsyncGenerator[T]:
        deliveries = client.stream(conversation(client.conversations, *args, **kwargs))
        await anext(deliveries)
        return cast("AsyncGenerator[T]", deliveries)

    return method


class AsyncClient:
    """A connection to a daemon, for the event loop it was made in; use it as an asynchronous context manager.

    `Conversations` documents its methods; each raises DaemonError if the daemon refuses, does not answer or has ended.
    """

    def __init__(self, events: str, requests: str, key: ClientKey | None = None) -> None:
        self.conversations = Conversations(events, requests)
        self._events = events
        self._requests = requests
        self._key = key
        self._context = zmq.asyncio.Context()
        self._asker = self._connected(zmq.DEALER, requests)
        self._waiting: dict[str, asyncio.Future[list[bytes]]] = {}
        self._reader = asyncio.create_task(self._read_answers())

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close all sockets, those of listeners too; calls that still wait for an answer get none."""
        self._reader.cancel()
        try:
            await asyncio.wait({self._reader})
        finally:  # also if this task is cancelled while it waits
            self._context.destroy(linger=0)

    async def run(self, conversation: Conversation[T]) -> T:
        """Run a conversation to its end and return its result."""
        underway = Underway(conversation)
        async for _ in self._deliveries(underway):
            pass
        return underway.result

    def stream(self, conversation: Stream[T]) -> AsyncGenerator[T]:
        """Run a conversation and yield its deliveries."""
        return cast("AsyncGenerator[T]", self._deliveries(Underway(conversation)))

    hello = _returning(Conversations.hello)
    status = _returning(Conversations.status)
    metrics = _returning(Conversations.metrics)
    settings = _returning(Conversations.settings)
    samples = _returning(Conversations.samples)
    sweeps = _returning(Conversations.sweeps)
    fits = _returning(Conversations.fits)
    unanswered = _returning(Conversations.unanswered)
    bench = _returning(Conversations.bench)
    begin = _returning(Conversations.begin)
    cancel = _returning(Conversations.cancel)
    lease = asynccontextmanager(_yielding(Conversations.lease))
    submit = _returning(Conversations.submit)
    submit_diagnosis = _returning(Conversations.submit_diagnosis)
    shutdown = _returning(Conversations.shutdown)
    listen = _listening(Conversations.listen)
    replay = _yielding(Conversations.replay)
    measure = _returning(Conversations.measure)
    wait_fit = _returning(Conversations.wait_fit)
    fit = _returning(Conversations.fit)
    diagnose = _returning(Conversations.diagnose)
    wait_diagnosis = _returning(Conversations.wait_diagnosis)

    async def _deliveries(self, underway: Underway[T]) -> AsyncGenerator[object]:
        """Carry out the steps of a conversation and yield its deliveries."""
        subscriber: zmq.asyncio.Socket | None = None
        try:
            while (step := underway.step) is not None:
                outcome: Outcome = None
                try:
                    if isinstance(step, Ask):
                        outcome = await self._ask(step)
                    elif isinstance(step, Subscribe):
                        subscriber = self._connected(zmq.SUB, self._events)
                    elif isinstance(step, Hear):
                        if subscriber is not None and await subscriber.poll(math.ceil(1000 * step.seconds)):
                            outcome = await subscriber.recv_multipart()
                    elif isinstance(step, Knock):
                        outcome = None if await asyncio.to_thread(is_refused, self._events) else []
                    else:
                        yield step.item
                except BaseException as error:
                    underway.fail(error)
                else:
                    underway.go_on(outcome)
        finally:
            if subscriber is not None:
                subscriber.close()

    async def _ask(self, step: Ask) -> Outcome:
        """Send a request and return an answer that it waits for."""
        answered: asyncio.Future[list[bytes]] = asyncio.get_running_loop().create_future()
        self._waiting |= dict.fromkeys(step.requests, answered)
        try:
            await self._asker.send_multipart(step.frames, zmq.NOBLOCK)  # pyright: ignore[reportUnknownMemberType]
            done, _ = await asyncio.wait({answered}, timeout=step.seconds)
            return answered.result() if done else None
        except zmq.Again:
            raise not_let_in(self._requests) from None
        finally:
            for request in step.requests:
                del self._waiting[request]

    async def _read_answers(self) -> None:
        """Pass each answer to the request that waits for it, until cancelled; a malformed one fails all of them."""
        while True:
            frames = await self._asker.recv_multipart()
            try:
                request = addressee(frames, self._waiting)
            except WireError as error:
                for answered in self._waiting.values():
                    if not answered.done():
                        answered.set_exception(error)
                continue
            if request is not None and not self._waiting[request].done():
                self._waiting[request].set_result(frames)

    def _connected(self, kind: int, endpoint: str) -> zmq.asyncio.Socket:
        socket = self._context.socket(kind)
        limit(socket)  # pyright: ignore[reportArgumentType]
        unlock(socket, self._key)  # pyright: ignore[reportArgumentType]
        if kind == zmq.SUB:
            socket.subscribe(b"")
        socket.connect(endpoint)
        return socket
