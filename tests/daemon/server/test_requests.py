"""The requests socket used with plain ZeroMQ and JSON, and with arbitrary bytes."""

import json
import os
import re
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
import pytest
import zmq
from keyed import unlocked

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.paths import daemon_file, home
from pzctl.daemon.server.sockets import is_loopback
from pzctl.models.build import Build


@pytest.fixture
def dealer() -> Iterator[Callable[[str], "zmq.Socket[bytes]"]]:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    links: list[zmq.Socket[bytes]] = []

    def link(endpoint: str, kind: int = zmq.DEALER) -> "zmq.Socket[bytes]":
        made = context.socket(kind)
        made.setsockopt(zmq.LINGER, 0)
        made.setsockopt(zmq.RCVTIMEO, 10_000)
        unlocked(made).connect(endpoint)
        links.append(made)
        return made

    yield link
    for made in links:
        made.close()
    context.term()


def test_plain_json_over_req_and_dealer_sockets(start_daemon, dealer) -> None:
    where: Location = start_daemon()
    for kind in (zmq.REQ, zmq.DEALER):
        link = dealer(where.requests, kind)
        link.send(b'{"id":"7","request":"hello"}')
        answer = json.loads(link.recv())
        assert (answer["id"], answer["ok"], answer["wire"], answer["run"]) == ("7", True, 1, where.run)


def test_the_program_in_the_docs_reads_the_same_numbers(start_daemon, build: Build) -> None:
    start_daemon()
    with connect() as lab:
        sweep = lab.measure(build, "disk").sweeps[0]
    text = (Path(__file__).resolve().parents[3] / "docs" / "wire.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", text.partition("## Without pzctl")[2], re.DOTALL)
    names: dict[str, object] = {"daemon_json": str(daemon_file(home()))}
    exec(program, names)  # noqa: S102
    assert names["f"] == tuple(sweep.frequency)
    assert names["z"] == list(sweep.impedance)


def test_a_request_id_is_done_once_even_after_the_daemon_is_killed(start_daemon, dealer, build: Build, end) -> None:
    where = start_daemon()
    request = json.dumps({"id": "x", "request": "measure", "build": msgspec.to_builtins(build), "step": "disk"})
    answers = []
    link = dealer(where.requests)
    for _ in range(3):
        link.send(request.encode())
        answers.append(json.loads(link.recv()))
    with connect() as lab:
        assert lab.measure(build, "disk").sweeps, "the first one is done when the second is"
    end(where.pid, signal.SIGKILL)
    link = dealer(start_daemon().requests)
    link.send(request.encode())
    answers.append(json.loads(link.recv()))
    assert all(answer == answers[0] for answer in answers)
    with connect() as lab:
        (history,) = lab.samples()
        assert [one.state for one in history.measurements] == ["measured", "measured"]


def test_what_is_wrong_with_a_request_is_said(start_daemon, dealer) -> None:
    link = dealer(start_daemon().requests)
    for request_text, says in (
        (b'{"id":"1","request":"dance"}', "'dance' is not known; known are hello, status"),
        (b'{"id":"1","request":"hello","v":9}', "it has wire version 9; this daemon reads version 1"),
        (b'{"id":"1","request":"replay","since":1,"max":1000000}', "Expected `int` <= 50 - at `$.max`"),
        (b'{"id":"1","request":"replay","since":9223372036854775808}', "<= 9223372036854775807 - at `$.since`"),
        (b'{"id":"1","request":"replay","since":1,"until":-9223372036854775809}', "Expected `int` >= 0 - at `$.until`"),
        (b'{"id":"1","request":"replay","since":1,"until":1000000000000000000000000000000}', "- at `$.until`"),
        (
            b'{"id":"1","request":"cancel","measurement":"a","measurement":"b"}',
            "the field 'measurement' is given twice",
        ),
        (b'{"id":"1","request":"bench","command":{"command":"next","command":"status"}}', "'command' is given twice"),
        (b'{"id":"1","request":"hello","unknown":{"a":1,"\\u0061":2}}', "the field 'a' is given twice; give it once"),
        (b'{"id":"1","request":"hello","unknown":' + b"[" * 64 + b"]" * 64 + b"}", "65 objects and lists are nested"),
        (
            b'{"id":"1","request":"fit","measurement":"m","fitter":"' + b"x" * 70_000 + b'"}',
            "at most 65536 are allowed",
        ),
        (b'{"id":"1","request":"submit","measurement":"m"}', "missing required field `fitter`"),
        (b'{"id":"1","request":"measure","step":"disk","build":{"name":1}}', "Expected `str`, got `int`"),
    ):
        link.send(request_text)
        answer = json.loads(link.recv())
        assert (answer["id"], answer["ok"]) == ("1", False)
        assert says in answer["error"]["message"]


def test_garbage_is_counted_and_harms_nobody(start_daemon, dealer) -> None:
    where = start_daemon()
    garbage = [[os.urandom(n)] for n in range(20)] + [[b"[" * 50_000], [b"{}"] * 300, [b"", b""], [b'{"id":5}']]
    link = dealer(where.requests)
    for frames in garbage:
        link.send_multipart(frames)
        assert not json.loads(link.recv_multipart()[-1])["ok"]
    for endpoint in (where.requests, where.events):
        at = urlsplit(endpoint)
        with socket.create_connection((at.hostname, at.port)) as raw:
            raw.sendall(b"GET / HTTP/1.1\r\n\r\n" + os.urandom(1000))
    big = dealer(where.requests)
    big.send(b"x" * (9 << 20))
    with connect() as lab:
        assert lab.status().garbage >= len(garbage), "bytes that are not ZMTP may still look like frames"


@pytest.mark.parametrize(
    ("endpoint", "inside"),
    [
        ("tcp://127.0.0.1:*", True),
        ("tcp://127.8.8.8:5470", True),
        ("tcp://[::1]:5470", True),
        ("tcp://localhost:5470", True),
        ("ipc:///tmp/pzctl", True),
        ("tcp://*:5470", False),
        ("tcp://0.0.0.0:5470", False),
        ("tcp://[::]:5470", False),
        ("tcp://eth0:5470", False),
        ("tcp://192.168.1.5:5470", False),
        ("nonsense", False),
    ],
)
def test_what_counts_as_loopback(endpoint: str, inside: bool) -> None:
    assert is_loopback(endpoint) is inside
