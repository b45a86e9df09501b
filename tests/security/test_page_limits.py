"""A client of the page cannot crash it with a body, hold its connections, or use up its event streams."""

import asyncio
import http.client
import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from page_requests import BUILD, ask

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.daemon.page import event_stream, page_server, request_body, timed_protocol
from pzctl.daemon.page.event_stream import EventStream
from pzctl.daemon.page.page_server import page_app

OWN = {"origin": "http://127.0.0.1:8294"}


@pytest.fixture(autouse=True)
def _home(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (b"[" * 60_000, "Expected `object`, got `array`"),
        (b'{"step":' * 8_000, "Expected `str`, got `object`"),
        (b"{", "not a JSON object"),
        (b"\xff\xfe", "not a JSON object"),
        (b"[]", "Expected `object`, got `array`"),
        (b'[["step", "disk"]]', "Expected `object`, got `array`"),
        (b'{"step": NaN}', "not a JSON object"),
        (b'{"step": "\\ud800"}', "not a JSON object"),
        (b'{"step": 7}', "Expected `str`, got `int`"),
        (b"{}", "missing required field `step`"),
        (b'{"step": "disk", "token": 1}', "unknown field `token`"),
        (b'{"step": "disk", "step": "ml1"}', "the field 'step' is given twice; give it once"),
        (b'{"step": "disk", "metadata": {"batch": "1", "batch": "2"}}', "the field 'batch' is given twice"),
        (b'{"step": ""}', "Expected `str` of length >= 1 - at `$.step`"),
        (b'{"step": "disk", "analyzer": ""}', "Expected `str` of length >= 1 - at `$.analyzer`"),
        (b'{"step": "disk", "metadata": {"temperature_C": "warm"}}', "temperature_C is 'warm'; a number is needed"),
        (b'{"step": "disk", "mass_g": {"value": 1, "u": 1}}', "the uncertainty is 1 g and the mass 1 g; it has to be"),
        (b'{"step": "disk", "mass_g": {"value": 1e300, "u": 1}}', "at `$.mass_g.value`"),
    ],
)
def test_every_malformed_body_is_answered_400_with_one_sentence(body: bytes, says: str) -> None:
    status, _, answer = ask("/api/measure", method="POST", body=body, **OWN)
    assert status == 400
    assert says in json.loads(answer)["error"]
    assert len(answer.splitlines()) == 1


def test_a_field_that_a_form_gives_twice_is_refused() -> None:
    form = {"content-type": "application/x-www-form-urlencoded"}
    status, _, answer = ask("/api/measure", method="POST", body=b"step=disk&step=ml1", **form, **OWN)
    assert (status, json.loads(answer)["error"]) == (400, "request: the field 'step' is given twice; give it once")


@pytest.mark.parametrize(
    ("asked", "status", "says"),
    [
        ({"path": "/nowhere"}, 404, "nothing is at this path"),
        ({"path": "/static/nothing.js"}, 404, "nothing is at this path"),
        ({"path": "/api/measure"}, 405, "GET is not allowed at this path; allowed is POST"),
        ({"path": "/", "token": "at least sixteen characters"}, 401, "this page needs a token"),
        ({"path": "/", "host": "evil.example"}, 421, "not by another name"),
        ({"path": "/", "via": "1.1 proxy"}, 421, "behind a proxy"),
    ],
)
def test_every_refusal_is_json_with_one_sentence(asked: dict[str, Any], status: int, says: str) -> None:
    got, headers, answer = ask(**asked)
    assert (got, headers["content-type"]) == (status, "application/json")
    assert says in json.loads(answer)["error"]


def test_a_range_that_cannot_be_is_no_error() -> None:
    status, headers, _ = ask("/static/page.css", range="bytes=9-1")
    assert (status, headers["content-type"]) == (200, "text/css; charset=utf-8")


def test_a_defect_is_answered_in_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served() as address, closing(http.client.HTTPConnection(*address, timeout=60)) as asked:
        monkeypatch.setattr(page_server, "STATIC", tmp_path)
        asked.request("GET", "/", headers={"Host": "127.0.0.1"})
        answer = asked.getresponse()
        assert answer.status == 500
        assert "a defect of pzctl, see the page's log" in json.loads(answer.read())["error"]


def test_a_band_is_two_frequencies() -> None:
    wish = json.dumps({"measurement": "m", "bands": {"disk": [[1e6, 2e6, 3e6]]}}).encode()
    status, _, answer = ask("/api/look", method="POST", body=wish, **OWN)
    assert (status, b"of length 2" in answer) == (400, True)


def test_a_body_is_read_no_further_than_its_limit() -> None:
    status, _, answer = ask("/api/look", method="POST", body=b" " * (request_body.MOST_BODY + 1), **OWN)
    assert (status, b"bytes that are allowed" in answer) == (413, True)


def test_a_body_that_does_not_come_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_body, "BODY_SECONDS", 0.05)
    status, _, answer = ask("/api/look", method="POST", body=None, **OWN)
    assert (status, b"did not come within" in answer) == (408, True)


def test_one_event_stream_too_many_is_refused_and_a_closed_one_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_stream, "MOST_PAGES", 2)
    asyncio.run(_streams())


async def _streams() -> None:
    hub = EventStream()

    async def opened() -> tuple[int, "asyncio.Task[None]"]:
        status: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        async def send(message: Any) -> None:
            if message["type"] == "http.response.start":
                status.set_result(message["status"])

        scope = {"type": "http", "method": "GET", "asgi": {"spec_version": "2.3"}, "headers": []}
        task = asyncio.create_task(hub(scope, asyncio.Event().wait, send))  # type: ignore[arg-type]
        return await status, task

    (first, page), (second, other) = await opened(), await opened()
    third, refused = await opened()
    assert (first, second, third) == (200, 200, 503)
    page.cancel()
    await asyncio.wait([page, refused])
    again, last = await opened()
    assert again == 200
    for task in (other, last):
        task.cancel()
    await asyncio.wait([other, last])


@contextmanager
def served(limit_concurrency: int | None = None) -> Iterator[tuple[str, int]]:
    """Serve the page as `pzctl page` does, in a thread; idle connections are closed after 1 s instead of 5."""
    listener = socket.create_server(("127.0.0.1", 0))
    page = page_app(parse_build(BUILD))
    timed = timed_protocol.TimedProtocol
    options = {"ws": "none", "log_level": "critical", "timeout_keep_alive": 1, "limit_concurrency": limit_concurrency}
    config = uvicorn.Config(page, http=timed, **options)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=lambda: asyncio.run(server.serve([listener])))
    thread.start()
    try:
        yield listener.getsockname()
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


@pytest.mark.parametrize(
    "begun", [b"", b"GET / HTTP/1.1\r\nHost: 127", b"GET /nowhere HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET / HT"]
)
def test_a_head_that_does_not_come_ends_its_connection(begun: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timed_protocol, "HEADER_SECONDS", 0.2)
    with served() as address, socket.create_connection(address, timeout=60) as slow:
        slow.sendall(begun)
        while True:
            try:
                if not slow.recv(1 << 16):
                    break
            except ConnectionResetError:
                break  # ended as promised; a connection that stays open times out above


def status_of(address: tuple[str, int], source: str = "127.0.0.1") -> int:
    with closing(http.client.HTTPConnection(*address, timeout=60, source_address=(source, 0))) as asked:
        asked.request("GET", "/api/openapi.json", headers={"Host": "127.0.0.1"})
        return asked.getresponse().status


def test_a_connection_too_many_takes_the_place_of_an_idle_one() -> None:
    with served(limit_concurrency=4) as address, ExitStack() as kept:
        first = kept.enter_context(socket.create_connection(address, 60, source_address=("127.0.0.2", 0)))
        idle = [kept.enter_context(socket.create_connection(address, 60)) for _ in range(3)]
        assert idle[0].recv(1) == b"", "closed"  # it is of the address with the most connections, not the oldest of all
        assert status_of(address, "127.0.0.3") == 200
        first.sendall(b"GET /api/openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert first.recv(12) == b"HTTP/1.1 200"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_idle_connections_under_a_low_limit_of_files_close_the_page_to_nobody_and_fill_no_log(tmp_path: Path) -> None:
    build, log = tmp_path / "B.toml", tmp_path / "log"
    build.write_text(BUILD)
    with socket.create_server(("127.0.0.1", 0)) as trial:
        address = trial.getsockname()
    few = ["sh", "-c", 'ulimit -n 256; exec "$@"', "sh"]
    command = [*few, sys.executable, "-P", "-m", "pzctl.daemon.page.page_process", str(build), str(address[1])]
    with ExitStack() as kept:
        lines = kept.enter_context(log.open("wb"))
        page = kept.enter_context(subprocess.Popen(command, stdin=subprocess.PIPE, stderr=lines))
        kept.callback(page.kill)
        while page.poll() is None:
            with suppress(ConnectionRefusedError):
                for _ in range(300):
                    kept.enter_context(socket.create_connection(address, 60))
                break
            time.sleep(0.05)
        assert [status_of(address) for _ in range(3)] == [200, 200, 200]
    assert log.read_text() == ""


def test_somebody_who_does_not_read_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timed_protocol, "READ_SECONDS", 0.2)
    with served() as address, socket.socket() as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.settimeout(60)
        deaf.connect(address)
        with pytest.raises(ConnectionError):
            _ask_without_end(deaf)


def _ask_without_end(deaf: socket.socket) -> None:
    while True:
        deaf.sendall(b"GET /static/uPlot.iife.min.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 100)
