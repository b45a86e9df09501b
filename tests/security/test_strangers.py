"""Without a key nobody can command anything: not from this machine, not by a web page, not with a module's name."""

import json
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import sleep

import pytest
import zmq
from keyed import unlocked

from pzctl import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import daemon_file, home, keys_folder
from pzctl.models.build import Build

SHUTDOWN = b'{"id":"1","request":"shutdown"}'


@pytest.fixture
def plain_socket() -> "Iterator[zmq.Socket[bytes]]":
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.DEALER) as link:
        link.set(zmq.LINGER, 0)
        link.set(zmq.RCVTIMEO, 20_000)
        yield link
    context.term()


def test_a_program_without_a_key_is_not_heard_on_loopback(start_daemon, plain_socket) -> None:
    where = start_daemon()
    plain_socket.connect(where.requests)
    plain_socket.send(SHUTDOWN)
    assert not plain_socket.poll(1000)
    with connect() as lab:
        assert lab.status().seq > 0


@pytest.mark.parametrize("head", [b"POST / HTTP/1.1\r\nContent-Length: 99\r\n\r\n", b""], ids=["HTTP", "bare"])
def test_unversioned_zmtp_commands_nothing(start_daemon, head: bytes) -> None:
    """ZMTP 1.0 has no handshake: the body of a web page's POST can be valid frames."""
    where = start_daemon()
    host, _, port = where.requests.removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port)), timeout=10) as link, suppress(ConnectionResetError):
        link.sendall(head + b"\x01\x00" + bytes([len(SHUTDOWN) + 1, 0]) + SHUTDOWN)
        while link.recv(4096):
            pass
    with connect() as lab:
        assert lab.status().seq > 0


def test_the_keys_of_an_account_are_readable_by_it_alone(start_daemon) -> None:
    start_daemon()
    for path in (daemon_file(home()), keys_folder(home()) / "local.json", keys_folder(home())):
        assert path.stat().st_mode & 0o077 == 0, path


def test_a_name_from_the_wire_is_never_imported(start_daemon, build: Build, tmp_path: Path, plain_socket) -> None:
    """A hello from a fitter `module:Class` does not make the daemon load that module."""
    where = start_daemon("Echo")
    unlocked(plain_socket, where).connect(where.requests)
    plain_socket.send(b'{"id":"h","request":"hello","fitter":"evil:X","version":"1"}')
    assert json.loads(plain_socket.recv())["error"]["code"] == "bad-name"
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        plain_socket.send(b'{"id":"v","request":"hello","fitter":"visitor","version":"1"}')
        assert json.loads(plain_socket.recv())["ok"]
        for name in ("evil:X", "visitor"):
            with pytest.raises(DaemonError, match="is not installed here"):
                lab.fit(measurement, name)


def test_files_beside_the_daemon_are_no_part_of_it(
    start_daemon, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A `statistics.py` in the working folder is imported neither by the daemon nor by its fitters."""
    for name in ("statistics", "random", "numpy", "pzctl"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported')\n")
    monkeypatch.chdir(tmp_path)
    start_daemon("Echo")
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        assert lab.wait_fit("guest_examples:Echo", measurement).steps == ("disk",)


def heard_from(address: str, *parts: bytes) -> bytes:
    """Send bytes to a port, one part after the other; return its whole answer until it closes or is silent."""
    host, port = address.rsplit(":", 1)
    found = b""
    with socket.create_connection((host, int(port)), timeout=3) as link, suppress(OSError):
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for part in parts:
            link.sendall(part)
            sleep(0.05)
        while data := link.recv(4096):
            found += data
            if data.endswith(b"\n"):
                break
    return found


def test_a_web_page_commands_neither_the_simulator_nor_its_bench(start_daemon, build: Build) -> None:
    """A page posts text; these ports accept text line by line, so its lines would be commands."""
    where = start_daemon()
    instrument = ":".join(where.resource.split("::")[1:3])
    with connect() as lab:
        lab.measure(build, "disk")
        for method in ("GET", "POST", "PUT", "OPTIONS"):
            head = f"{method} / HTTP/1.1\r\nHost: x\r\n\r\n".encode()
            for first in ([head], [head[:3], head[3:]]):
                assert heard_from(where.bench, *first, b'{"command": "step", "name": "ml1"}\n') == b""
                assert heard_from(instrument, *first, b"\n*IDN?\n") == b""
        assert lab.bench({"command": "status"})["step"] == "disk"
    assert b"4294A" in heard_from(instrument, b"*IDN?\n"), "a client that is not a web page is answered"
    assert b'"ok"' in heard_from(where.bench, b'{"command"', b': "status"}\n')
