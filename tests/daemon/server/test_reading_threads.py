"""Answers that other threads read from the journal: none is refused, read twice or kept without end."""

import asyncio
import json
import os
import socket
import sys
import threading
from collections import Counter
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, closing
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import pytest
import zmq
import zmq.asyncio

from pzctl.daemon.journal.journal_reader import JournalMeasurement, JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.server.access.connection_guard import _sockets
from pzctl.daemon.server.access.unread_answers import LITTLE, Connection, UnreadAnswers
from pzctl.daemon.server.requests.request_handlers import RequestHandlers
from pzctl.daemon.server.requests.request_server import RequestServer
from pzctl.daemon.wire.events import StateEvent
from pzctl.daemon.wire.replies import Answer, SamplesAnswer
from pzctl.daemon.wire.requests import Request, SamplesRequest
from pzctl.models.build import Build

Handler = Callable[[Request], list[bytes]]


@asynccontextmanager
async def _asking(handler: Handler, **options: int) -> AsyncGenerator[tuple["zmq.Socket[bytes]", Counter[str]]]:
    """Yield a client of a server whose handlers answer with an empty header and these frames, and its counters.

    Then the server ends.
    """
    counts = Counter[str]()
    metrics = SimpleNamespace(counts=counts, lasted=lambda _what, _seconds: None)
    handlers = SimpleNamespace(
        metrics=metrics, answer=lambda request, _raw, _client: (Answer(id=request.id), handler(request))
    )
    access = SimpleNamespace(check=lambda _key, request: request.by or "ana")
    with zmq.asyncio.Context() as context, context.socket(zmq.ROUTER) as router, zmq.Context() as theirs:
        port = router.bind_to_random_port("tcp://127.0.0.1")
        with theirs.socket(zmq.DEALER) as client:
            client.linger = 0
            for name, value in options.items():
                setattr(client, name, value)
            client.connect(f"tcp://127.0.0.1:{port}")
            server = RequestServer(router, handlers, access, SimpleNamespace(heard=lambda _handle: None))  # type: ignore[arg-type]
            serving = asyncio.create_task(server.serve())
            yield client, counts
            serving.cancel()
            await asyncio.wait({serving})
            await server.end()
            while not client.closed and client.poll(200):
                counts[f"at the end: {json.loads(client.recv_multipart()[0])['id']}"] += 1


async def _answers(client: "zmq.Socket[bytes]", number: int) -> list[dict[str, object]]:
    """Return the headers of the next answers."""
    answers: list[dict[str, object]] = []
    async with asyncio.timeout(60):
        while len(answers) < number:
            if client.poll(0):
                answers.append(json.loads(client.recv_multipart()[0]))
            else:
                await asyncio.sleep(0.01)
    return answers


def _send(client: "zmq.Socket[bytes]", request: str, name: str) -> None:
    client.send(json.dumps({"request": request, "id": name, "measurement": "m"}).encode())


def test_lists_of_all_samples_delay_no_sweeps() -> None:
    go_on = threading.Event()

    def read(request: Request) -> list[bytes]:
        if isinstance(request, SamplesRequest):
            go_on.wait(60)
        return []

    async def first() -> object:
        async with _asking(read) as (client, _):
            for number in range(3):
                _send(client, "samples", f"samples {number}")
            _send(client, "sweeps", "sweeps")
            try:
                return (await _answers(client, 1))[0]["id"]
            finally:
                go_on.set()
                await _answers(client, 3)

    assert asyncio.run(first()) == "sweeps"


@pytest.mark.parametrize("name", ["samples", "sweeps", "fits", "replay"])
def test_others_are_answered_while_the_journal_is_read(name: str) -> None:
    go_on = threading.Event()

    def read(request: Request) -> list[bytes]:
        if request.id == "slow":
            go_on.wait(20)
        return []

    async def first() -> object:
        async with _asking(read) as (client, _):
            client.send(json.dumps({"request": name, "id": "slow", "measurement": "m", "since": 1}).encode())
            _send(client, "status", "status")
            try:
                return (await _answers(client, 1))[0]["id"]
            finally:
                go_on.set()
                await _answers(client, 1)

    assert asyncio.run(first()) == "status"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells which connection asked")
def test_nothing_is_read_for_a_client_that_has_gone() -> None:
    go_on, reads = threading.Event(), list[str]()

    def read(request: Request) -> list[bytes]:
        reads.append(request.id)
        go_on.wait(60)
        return []

    async def told() -> None:
        async with _asking(read) as (client, counts):
            for number in range(20):
                _send(client, "sweeps", str(number))
            while not reads:
                await asyncio.sleep(0.01)
            connections = _sockets_of_this_process()
            client.close()
            while _sockets_of_this_process() > connections - 2:  # both ends are in this process
                await asyncio.sleep(0.01)
            go_on.set()
            async with asyncio.timeout(60):
                while counts["requests"] < 20:
                    await asyncio.sleep(0.01)

    asyncio.run(told())
    assert reads == ["0"]


def _sockets_of_this_process() -> int:
    return len(list(_sockets()))


def test_clients_take_turns() -> None:
    """A client that asks a thousand times delays another one by one answer."""
    go_on, reads = threading.Event(), list[str]()

    def read(request: Request) -> list[bytes]:
        if request.id != "status":
            reads.append(request.id)
            go_on.wait(60)
        return []

    async def told() -> None:
        async with _asking(read) as (client, _):
            for number in range(20):
                _send(client, "sweeps", f"ana {number}")
            client.send(json.dumps({"request": "replay", "id": "bea", "since": 1, "by": "bea"}).encode())
            _send(client, "status", "status")
            await _answers(client, 1)
            go_on.set()
            await _answers(client, 21)

    asyncio.run(told())
    assert reads.index("bea") == 1


def test_many_measurements_are_asked_for_at_the_same_time() -> None:
    go_on = threading.Event()

    def read(request: Request) -> list[bytes]:
        if request.id != "status":
            go_on.wait(60)
        return []

    async def told() -> list[dict[str, object]]:
        async with _asking(read) as (client, _):
            for number in range(300):
                _send(client, "fits", str(number))
            _send(client, "status", "status")
            early = await _answers(client, 1)
            while early[-1]["id"] != "status":  # a refusal comes at once
                early += await _answers(client, 1)
            go_on.set()
            return early + await _answers(client, 301 - len(early))

    assert [answer["error"] for answer in asyncio.run(told()) if not answer["ok"]] == []


def test_a_request_that_is_sent_again_is_read_once() -> None:
    go_on, asked = threading.Event(), Counter[str]()

    def read(request: Request) -> list[bytes]:
        asked[request.id] += 1
        go_on.wait(60)
        return []

    async def told() -> list[object]:
        async with _asking(read) as (client, _):
            for name in ("a", "a", "b", "a"):
                _send(client, "sweeps", name)
            await asyncio.sleep(0)
            while asked["a"] == 0:
                await asyncio.sleep(0.01)
            go_on.set()
            return [answer["id"] for answer in await _answers(client, 4)]

    assert sorted(map(str, asyncio.run(told()))) == ["a", "a", "a", "b"]
    assert asked == {"a": 1, "b": 1}


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what was read")
def test_a_client_that_reads_nothing_does_not_fill_the_memory() -> None:
    large, number = [bytes(8 << 20)], 20

    async def told() -> list[dict[str, object]]:
        async with _asking(lambda _: large, rcvhwm=1) as (client, counts):
            for name in range(number):
                _send(client, "sweeps", str(name))
            async with asyncio.timeout(60):
                while counts["requests"] < number:
                    await asyncio.sleep(0.01)
            return await _answers(client, number)

    refused = [answer for answer in asyncio.run(told()) if not answer["ok"]]
    assert refused
    assert {answer["error"]["code"] for answer in refused} == {"too-much"}  # type: ignore[index]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what was read")
def test_an_answer_to_a_client_that_has_gone_does_not_count_for_the_next_one() -> None:
    """The kernel gives its descriptor to the next connection."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        ours = socket.create_connection(server.getsockname())
        theirs = socket.create_connection(server.getsockname())
        with ours, theirs:
            asked = Connection(ours.fileno())
            assert asked.handle == ours.fileno()
            os.dup2(theirs.fileno(), ours.fileno())
            unread = UnreadAnswers()
            for _ in range(2000):
                unread.answered(asked.handle, LITTLE)
            assert unread.too_much(ours.fileno()) == 0


def test_what_is_listed_is_of_one_moment(tmp_path: Path, build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    """While another thread lists the measurements, one is added."""
    journal, listed = JournalWriter(tmp_path / "journal"), JournalReader.measurements

    def meanwhile(reader: JournalReader, *where: str) -> list[JournalMeasurement]:
        measurement, _ = journal.begin_measurement("r", build, "disk")
        journal.append(StateEvent(state="measured", measurement=measurement))
        return listed(reader, *where)

    others = {one.name: None for one in fields(RequestHandlers)}
    handlers = RequestHandlers(**others | {"journal": journal})  # type: ignore[arg-type]
    with closing(journal), monkeypatch.context() as changed:
        changed.setattr(JournalReader, "measurements", meanwhile)
        answer, _ = handlers.answer(SamplesRequest(id="s"), (), "ana")
    assert isinstance(answer, SamplesAnswer)
    assert answer.samples == (), "its sweeps were looked for before it was there"


def test_an_ending_server_sends_the_answers_that_are_being_read() -> None:
    asked = Counter[str]()

    def read(request: Request) -> list[bytes]:
        asked[request.id] += 1
        ended.wait(0.5)
        return []

    ended = threading.Event()

    async def told() -> Counter[str]:
        async with _asking(read) as (client, counts):
            _send(client, "sweeps", "a")
            _send(client, "samples", "b")
            while len(asked) < 2:
                await asyncio.sleep(0.01)
        return counts

    counts = asyncio.run(told())
    assert (counts["at the end: a"], counts["at the end: b"]) == (1, 1)
