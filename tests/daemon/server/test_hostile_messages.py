"""Malicious messages: none is accepted or obeyed, and proper requests are answered meanwhile."""

import asyncio
import json
import mmap
import random
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import pytest
import raw_peer
import zmq
from hostile_messages import ENDLESS, mutated
from hypothesis import given, settings
from hypothesis import strategies as st
from keyed import unlocked

from pzctl import connect
from pzctl.daemon.files.paths import home
from pzctl.daemon.server.access.connection_guard import (
    LARGEST_MESSAGE,
    LITTLE,
    MOST_CONNECTIONS,
    MOST_SUBSCRIBED,
    ConnectionGuard,
    _sockets,
)
from pzctl.daemon.server.requests.request_server import NAMES, _read
from pzctl.daemon.server.sockets import LARGEST_SUBSCRIPTION, RECEIVE_BUFFER, REQUESTS_KEPT
from pzctl.daemon.wire.events import decode
from pzctl.daemon.wire.frames import LARGEST_FRAME, WireError
from pzctl.daemon.wire.socket_options import limit
from pzctl.models.build import Build


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32))
def test_readers_say_what_is_wrong_or_read(seed: int) -> None:
    frames = mutated(seed)
    for read in (decode, _read):
        with suppress(WireError):  # any other exception is a defect
            read(frames)


@pytest.fixture
def sender() -> "Iterator[zmq.Socket[bytes]]":
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.DEALER) as link:
        link.setsockopt(zmq.LINGER, 0)
        link.setsockopt(zmq.RCVTIMEO, 20_000)
        yield link
    context.term()


def test_the_daemon_answers_all_of_it_and_goes_on(start_daemon, build: Build, sender) -> None:
    where = start_daemon()
    unlocked(sender).connect(where.requests)
    obeyed = (
        b'"shutdown"',
        b'"lease"',
        b'"bench"',
    )  # an undamaged one would end the daemon, lease the instrument, or glue a layer
    harmless = [frames for frames in map(mutated, range(1500)) if not any(word in frames[0] for word in obeyed)]
    answered = 0
    with connect() as lab:
        for k, frames in enumerate(harmless):
            sender.send_multipart(frames if frames[0] else [b"x", *frames])
            answered += not json.loads(sender.recv_multipart()[0])["ok"]
            if k % 500 == 0:
                assert lab.status().seq > 0
        assert answered > 1000
        assert lab.metrics().counts["garbage"] > 500
        assert lab.measure(build, "disk").sweeps


@pytest.fixture
def guarded() -> Iterator[tuple[dict[bytes, str], Counter[str]]]:
    """Sockets like the daemon's, without keys, so that a hand-made peer can connect, with the connection guard."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.ROUTER) as requests, context.socket(zmq.PUB) as events:
        for one, longest in ((requests, LARGEST_FRAME), (events, LARGEST_SUBSCRIPTION)):
            limit(one)
            one.set(zmq.MAXMSGSIZE, longest)
            one.set(zmq.RCVBUF, RECEIVE_BUFFER)
        requests.set(zmq.RCVHWM, REQUESTS_KEPT)
        ports = {
            kind: one.bind_to_random_port("tcp://127.0.0.1") for kind, one in ((b"DEALER", requests), (b"SUB", events))
        }
        counts: Counter[str] = Counter()
        most = LARGEST_MESSAGE // 4  # without keys, empty frames take eight times less of a connection
        guard = ConnectionGuard({ports[b"DEALER"]: most, ports[b"SUB"]: MOST_SUBSCRIBED}, counts)
        stop = threading.Event()

        def watch() -> None:
            while not stop.wait(0.02):
                events.send(b"beat")  # a PUB socket processes subscriptions when it sends
                guard.look(time.monotonic())

        watcher = threading.Thread(target=watch)
        watcher.start()
        yield {kind: f"tcp://127.0.0.1:{port}" for kind, port in ports.items()}, counts
        stop.set()
        watcher.join()
    context.term()


@pytest.mark.skipif(sys.platform != "linux", reason="this needs Linux")
def test_a_message_that_comes_slowly_is_not_cut_off_while_the_daemon_grows(
    guarded: tuple[dict[bytes, str], Counter[str]], wait_until
) -> None:
    """As it does while it reads a long answer for somebody else; unless such messages are too many."""
    endpoints, counts = guarded
    part = raw_peer.LARGE + (3 << 20).to_bytes(8, "big") + bytes(3 << 20)
    with ExitStack() as links:
        slow = [links.enter_context(raw_peer.greeted(endpoints[b"DEALER"], b"DEALER")) for _ in range(6)]
        time.sleep(0.2)  # the guard has seen them
        slow[0].sendall(part)
        answer = bytes(1) * (128 << 20)
        time.sleep(0.5)
        assert counts["cut-off"] == 0
        for link in slow[1:]:
            link.sendall(part)
        more = bytes(1) * (128 << 20)
        wait_until(lambda: counts["cut-off"] > 0)
        assert len(answer) == len(more)


@pytest.mark.skipif(sys.platform != "linux", reason="this needs Linux")
@pytest.mark.parametrize("what", ENDLESS)
def test_who_sends_without_end_is_cut_off_before_memory_runs_out(
    guarded: tuple[dict[bytes, str], Counter[str]], what: str, wait_until
) -> None:
    endpoints, counts = guarded
    kind, sent = ENDLESS[what]
    before = int(Path("/proc/self/statm").read_text().split()[1])
    with raw_peer.greeted(endpoints[kind], kind) as link:
        assert raw_peer.send_until_cut(link, sent * (65_536 // len(sent) or 1), 4 << 30)
    assert int(Path("/proc/self/statm").read_text().split()[1]) - before < (500 << 20) // mmap.PAGESIZE
    wait_until(lambda: counts["cut-off"] == 1)


def test_missing_kernel_statistics_are_reported_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("pzctl.daemon.server.access.connection_guard.sys.platform", "darwin")
    intake = ConnectionGuard({5470: 1}, Counter())
    asyncio.run(asyncio.wait_for(intake.watch(), 5))
    intake.look(0.0)
    assert [one.levelname for one in caplog.records] == ["WARNING"]
    assert "connections that send without end are not cut" in caplog.text


@pytest.mark.skipif(sys.platform != "linux", reason="this needs Linux")
@pytest.mark.parametrize("known", [True, False])
def test_a_connection_that_closes_after_being_listed(known: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)), server.accept()[0] as ours:
            intake, listed = ConnectionGuard({port: 1}, Counter()), list(_sockets())
            if known:
                intake.look(0.0)
            assert ours.fileno() in dict(listed)
    monkeypatch.setattr("pzctl.daemon.server.access.connection_guard._sockets", lambda: iter(listed))
    intake.look(1.0)


@pytest.mark.skipif(sys.platform != "linux", reason="this needs Linux")
def test_heartbeats_do_not_add_up_to_a_message_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A listener says nothing but these, for months, while the daemon's memory grows for other reasons."""
    memory = iter(range(100 << 20, 2 << 30, 1 << 20))
    monkeypatch.setattr("pzctl.daemon.server.access.connection_guard._memory", lambda: next(memory))
    counts: Counter[str] = Counter()
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        guard = ConnectionGuard({port: MOST_SUBSCRIBED}, counts)
        with socket.create_connection(("127.0.0.1", port)) as listener, server.accept()[0] as ours:
            for second in range(1000):
                listener.sendall(bytes(82))  # a ping and a pong under CURVE
                ours.recv(82)
                guard.look(float(second))
            assert not counts
            listener.sendall(bytes(LITTLE + 1))
            ours.recv(LITTLE + 1)
            guard.look(1000.02)
            guard.look(1000.04)
    assert counts["cut-off"] == 1, "more than heartbeats still counts"


def test_bytes_that_are_not_a_message(start_daemon, build: Build) -> None:
    where = start_daemon()
    links: list[socket.socket] = []
    with connect() as lab:
        for endpoint, kind in ((where.events, b"SUB"), (where.requests, b"DEALER")):
            host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
            noise = random.Random(0).randbytes(1 << 20)  # noqa: S311
            for sent in (b"", b"GET / HTTP/1.1\r\n\r\n", raw_peer.GREETING[:20], raw_peer.GREETING + bytes(300), noise):
                links.append(socket.create_connection((host, int(port))))
                with suppress(OSError):
                    links[-1].sendall(sent)
            with pytest.raises(AssertionError, match="is not let in"):
                raw_peer.greeted(endpoint, kind)
        assert lab.measure(build, "disk").sweeps
    for link in links:
        link.close()


def test_idle_connections_leave_file_descriptors_for_the_journal(start_daemon, build: Build, wait_until) -> None:
    where = start_daemon()
    host, _, port = where.events.removeprefix("tcp://").rpartition(":")
    with connect() as lab, ExitStack() as stack:
        lab.status()
        for _ in range(MOST_CONNECTIONS + 100):
            with suppress(ConnectionResetError):  # disconnected already
                stack.enter_context(socket.create_connection((host, int(port))))
        wait_until(lambda: len(list(Path(f"/proc/{where.pid}/fd").iterdir())) < MOST_CONNECTIONS + 60)
        assert lab.measure(build, "disk").sweeps


def test_endless_hellos_of_a_fitter_do_not_fill_the_journal(start_daemon) -> None:
    where = start_daemon()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with connect() as lab, context.socket(zmq.DEALER) as link:
        unlocked(link).connect(where.requests)
        before = lab.status().seq
        for k in range(300):
            link.send(json.dumps({"id": str(k), "request": "hello", "fitter": "f", "version": str(k)}).encode())
            link.recv()
        found = lab.status()
        assert 0 < found.seq - before < 10
        assert found.fitters[0].version == "299"
    context.term()


def test_no_name_leads_out_of_the_data_folder(start_daemon, build: Build) -> None:
    start_daemon("Echo")
    with connect() as lab:
        before = set(home().parent.iterdir())
        for name in ("../../../escape", "/tmp/escape", ".."):  # noqa: S108
            lab.measure(replace(build, name=name), "disk")
            assert set(home().parent.iterdir()) == before
            assert lab.samples(name)[0].name == name


def test_every_request_is_in_the_docs() -> None:
    text = (Path(__file__).parents[3] / "docs" / "wire.md").read_text(encoding="utf-8")
    assert not [name for name in NAMES if f"| `{name}` |" not in text]
