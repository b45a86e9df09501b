"""The blocking client of a running daemon: measure, wait for fits, listen to events, look up measurements.

with connect() as lab:
    measurement = lab.measure(build, "disk")
    result = lab.wait_fit("mason", measurement.id)
"""

import math
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from types import TracebackType
from typing import Concatenate, ParamSpec, Self, TypeAlias, cast

import zmq

from ..wire.curve_keys import ClientKey
from ..wire.socket_options import limit, unlock
from .conversations import Conversations
from .location import address
from .protocol import Ask, Conversation, Hear, Knock, Outcome, Stream, Subscribe, T, Underway, addressee, not_let_in
from .reachability import is_refused

P = ParamSpec("P")
Socket: TypeAlias = "zmq.Socket[bytes]"

_SLICE = 0.5
"""Seconds of one poll: on Windows, Ctrl-C is only noticed between two polls."""


def connect(events: str | None = None, requests: str | None = None, key: str | Path | None = None) -> "Client":
    """Return a client of the daemon at these endpoints, or of the one that runs here.

    `key` is a file made by `pzctl keys client`; a daemon on another machine requires one. Raises DaemonError if no
    daemon runs, KeyFileError if the key cannot be used.
    """
    return Client(*address(events, requests, key))


def _returning(
    conversation: Callable[Concatenate[Conversations, P], Conversation[T]],
) -> "Callable[Concatenate[Client, P], T]":
    """Return a method that runs the conversation and returns its result."""

    @wraps(conversation)
    def method(client: "Client", *args: P.args, **kwargs: P.kwargs) -> T:
        return client.run(conversation(client.conversations, *args, **kwargs))

    return method


def _yielding(
    conversation: Callable[Concatenate[Conversations, P], Stream[T]],
) -> "Callable[Concatenate[Client, P], Generator[T]]":
    """Return a method that runs the conversation and yields its deliveries."""

    @wraps(conversation)
    def method(client: "Client", *args: P.args, **kwargs: P.kwargs) -> Generator[T]:
        return client.stream(conversation(client.conversations, *args, **kwargs))

    return method


def _listening(
    conversation: Callable[Concatenate[Conversations, P], Stream[T | None]],
) -> "Callable[Concatenate[Client, P], Generator[T]]":
    """Return a method that runs the conversation up to its first delivery and then yields the later ones."""

    @wraps(conversation)
    def method(client: "Client", *args: P.args, **kwargs: P.kwargs) -> Generator[T]:
        deliveries = client.stream(conversation(client.conversations, *args, **kwargs))
        next(deliveries)
        return cast("Generator[T]", deliveries)

    return method


class Client:
    """A connection to a daemon, to be used as a context manager and by one thread only.

    `Conversations` documents its methods; each raises DaemonError if the daemon refuses, does not answer or has ended.
    """

    def __init__(self, events: str, requests: str, key: ClientKey | None = None) -> None:
        self.conversations = Conversations(events, requests)
        self._events = events
        self._requests = requests
        self._key = key
        self._context: zmq.Context[Socket] = zmq.Context()
        self._asker = self._connected(zmq.DEALER, requests)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close all sockets, those of listeners too."""
        self._context.destroy(linger=0)

    def run(self, conversation: Conversation[T]) -> T:
        """Run a conversation to its end and return its result."""
        underway = Underway(conversation)
        for _ in self._deliveries(underway):
            pass
        return underway.result

    def stream(self, conversation: Stream[T]) -> Generator[T]:
        """Run a conversation and yield its deliveries."""
        return cast("Generator[T]", self._deliveries(Underway(conversation)))

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
    lease = contextmanager(_yielding(Conversations.lease))
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

    def _deliveries(self, underway: Underway[T]) -> Generator[object]:
        """Carry out the steps of a conversation and yield its deliveries."""
        subscriber: Socket | None = None
        try:
            while (step := underway.step) is not None:
                outcome: Outcome = None
                try:
                    if isinstance(step, Ask):
                        outcome = self._ask(step)
                    elif isinstance(step, Subscribe):
                        subscriber = self._connected(zmq.SUB, self._events)
                    elif isinstance(step, Hear):
                        outcome = _received(subscriber, step.seconds) if subscriber is not None else None
                    elif isinstance(step, Knock):
                        outcome = None if is_refused(self._events) else []
                    else:
                        yield step.item
                except BaseException as error:
                    underway.fail(error)
                else:
                    underway.go_on(outcome)
        finally:
            if subscriber is not None:
                subscriber.close()

    def _ask(self, step: Ask) -> Outcome:
        """Send a request and return an answer that it waits for; skip late answers to earlier requests."""
        try:
            self._asker.send_multipart(step.frames, zmq.NOBLOCK)
        except zmq.Again:
            raise not_let_in(self._requests) from None
        deadline = time.monotonic() + step.seconds
        while (frames := _received(self._asker, max(0.0, deadline - time.monotonic()))) is not None:
            if addressee(frames, step.requests) is not None:
                return frames
        return None

    def _connected(self, kind: int, endpoint: str) -> Socket:
        socket = self._context.socket(kind)
        limit(socket)
        unlock(socket, self._key)
        if kind == zmq.SUB:
            socket.subscribe(b"")
        socket.connect(endpoint)
        return socket


def _received(socket: Socket, seconds: float) -> Outcome:
    """Return the next message, or None if none comes in time."""
    deadline, left = time.monotonic() + seconds, seconds
    while not socket.poll(math.ceil(1000 * min(left, _SLICE))):
        left = deadline - time.monotonic()
        if left <= 0:
            return None
    return socket.recv_multipart()
