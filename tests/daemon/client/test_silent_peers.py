"""Who is at the other end and is no daemon, or says nothing: the clients say so."""

import asyncio
import threading
from collections.abc import Iterator

import pytest
import zmq

from pzctl.daemon.client.async_client import AsyncClient
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.protocol import DaemonError
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


def ask_blocking(events: str, requests: str) -> None:
    with Client(events, requests) as lab:
        with pytest.raises(DaemonError, match=NO_ANSWER):
            lab.run(lab.conversations.answer_to(HelloRequest(id="1"), HelloAnswer, patience=0.01))
        with pytest.raises(WireError, match=NO_DAEMON):
            lab.listen()


async def ask_async(events: str, requests: str) -> None:
    async with AsyncClient(events, requests) as lab:
        with pytest.raises(DaemonError, match=NO_ANSWER):
            await lab.run(lab.conversations.answer_to(HelloRequest(id="1"), HelloAnswer, patience=0.01))
        with pytest.raises(WireError, match=NO_DAEMON):
            await lab.listen()


def test_a_peer_that_is_no_daemon_is_said(strangers: tuple[str, str]) -> None:
    ask_blocking(*strangers)
    asyncio.run(asyncio.wait_for(ask_async(*strangers), 10))
