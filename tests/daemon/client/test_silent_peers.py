"""Who is at the other end and is no daemon, or says nothing: the clients say so."""

import asyncio
import threading
from collections.abc import Iterator

import pytest
import zmq
import zmq.asyncio

from pzctl.daemon.client.async_connection import AsyncRequestClient, AsyncSubscription
from pzctl.daemon.client.connection import DaemonError, RequestClient, Subscription
from pzctl.daemon.wire.frames import WireError
from pzctl.daemon.wire.replies import HelloAnswer
from pzctl.daemon.wire.requests import HelloRequest

NO_ANSWER = "no answer in 4 tries of 0.01 s; is it running"
NO_DAEMON = "it begins with b'good morning'; a pzctl daemon says welcome"


@pytest.fixture
def strangers() -> Iterator[tuple[str, str]]:
    """A socket that greets in its own way, and one that never answers."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.XPUB) as greeter, context.socket(zmq.ROUTER) as silent:
        greeter.set(zmq.XPUB_WELCOME_MSG, b"good morning")
        ports = [one.bind_to_random_port("tcp://127.0.0.1") for one in (greeter, silent)]
        ended = threading.Event()
        greeting = threading.Thread(target=greet_all, args=(greeter, ended))
        greeting.start()
        yield f"tcp://127.0.0.1:{ports[0]}", f"tcp://127.0.0.1:{ports[1]}"
        ended.set()
        greeting.join()
    context.term()


def greet_all(greeter: "zmq.Socket[bytes]", ended: threading.Event) -> None:
    """Greet whoever comes: libzmq does so in the thread that polls."""
    while not ended.is_set():
        if greeter.poll(20):
            greeter.recv()


def ask(events: str, requests: str, context: "zmq.Context[zmq.Socket[bytes]]") -> None:
    asker = RequestClient(context, requests)
    try:
        with pytest.raises(DaemonError, match=NO_ANSWER):
            asker.ask(HelloRequest(id="1"), HelloAnswer, patience=0.01)
        with pytest.raises(WireError, match=NO_DAEMON):
            Subscription(context, events, asker)
    finally:
        asker.close()


async def ask_async(events: str, requests: str) -> None:
    context = zmq.asyncio.Context()
    asker = AsyncRequestClient(context, requests, None)
    listener = AsyncSubscription(context, events, asker, None)
    try:
        with pytest.raises(DaemonError, match=NO_ANSWER):
            await asker.ask(HelloRequest(id="1"), HelloAnswer, patience=0.01)
        with pytest.raises(WireError, match=NO_DAEMON):
            await listener.open()
    finally:
        listener.close()
        await asker.close()
        context.term()


def test_a_peer_that_is_no_daemon_is_said(strangers: tuple[str, str]) -> None:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    ask(*strangers, context)
    context.term()
    asyncio.run(asyncio.wait_for(ask_async(*strangers), 10))
