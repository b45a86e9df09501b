"""Clients report a peer that is not a daemon or does not answer."""

import asyncio
from collections.abc import Iterator

import pytest
import zmq

from pzctl.daemon.client.async_client import AsyncClient
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.event_follower import EventFollower
from pzctl.daemon.client.protocol import Ask, DaemonError, Hear, Subscribe, Underway
from pzctl.daemon.wire.events import InstrumentInfo
from pzctl.daemon.wire.frames import WireError, to_json
from pzctl.daemon.wire.replies import HelloAnswer
from pzctl.daemon.wire.requests import HelloRequest

NO_ANSWER = "no answer in 4 tries of 0.01 s; is it running"


@pytest.fixture
def silent() -> Iterator[str]:
    """The endpoint of a socket that never answers."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.ROUTER) as router:
        yield f"tcp://127.0.0.1:{router.bind_to_random_port('tcp://127.0.0.1')}"
    context.term()


async def ask_async(endpoint: str) -> None:
    async with AsyncClient(endpoint, endpoint) as lab:
        with pytest.raises(DaemonError, match=NO_ANSWER):
            await lab.run(lab.conversations.answer_to(HelloRequest(id="1"), HelloAnswer, patience=0.01))


def test_a_peer_that_does_not_answer_is_said(silent: str) -> None:
    with Client(silent, silent) as lab, pytest.raises(DaemonError, match=NO_ANSWER):
        lab.run(lab.conversations.answer_to(HelloRequest(id="1"), HelloAnswer, patience=0.01))
    asyncio.run(asyncio.wait_for(ask_async(silent), 10))


@pytest.mark.parametrize(
    ("heard", "kind", "says"),
    [
        ([b"good morning"], WireError, "endpoint E: it begins with b'good morning'; a pzctl daemon says welcome"),
        (None, DaemonError, "daemon at E: no welcome within 20 s; is it running?"),
    ],
)
def test_a_peer_that_does_not_welcome_is_said(heard: list[bytes] | None, kind: type[Exception], says: str) -> None:
    opening = Underway(EventFollower("E", "R").open())
    assert isinstance(opening.step, Ask)
    instrument = InstrumentInfo("R", "", "4294A", "", "", simulated=True)
    answer = HelloAnswer(
        id="1", wire=1, version="1", pid=1, run="", seq=3, instrument=instrument, events="", requests="", bench=None,
        fitters=(),
    )  # fmt: skip
    opening.go_on([to_json(answer)])
    assert opening.step == Subscribe()
    opening.go_on(None)
    assert opening.step == Hear(20.0)
    with pytest.raises(kind) as refused:
        opening.go_on(heard)
    assert str(refused.value) == says
