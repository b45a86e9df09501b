"""From other machines only clients with a key can connect, and they can do only what their right allows."""

import asyncio
import json
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
import zmq
from typer.testing import CliRunner

from pzctl import connect
from pzctl.daemon.cli.commands import app
from pzctl.daemon.client.async_client import connect_async
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.wire.curve_keys import (
    ClientKey,
    KeyFileError,
    clients,
    make_client,
    make_server,
    read_client_key,
    revoke,
    write_secret,
)
from pzctl.daemon.wire.frames import to_json
from pzctl.daemon.wire.socket_options import unlock
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"


@pytest.fixture
def key_of(tmp_path: Path) -> Callable[[str, str], Path]:
    """Return a function that gives a client access and returns its key file."""

    def make(name: str, right: str) -> Path:
        path = tmp_path / f"{name}.key"
        write_secret(path, to_json(make_client(keys_folder(tmp_path), name, right)))  # type: ignore[arg-type]
        return path

    return make


def open_to_all(start_daemon) -> Location:
    """A daemon that listens at every address of this machine."""
    return start_daemon("Echo", events="tcp://0.0.0.0:*", requests="tcp://0.0.0.0:*")


def test_without_keys_it_does_not_start(start_daemon, tmp_path: Path) -> None:
    with pytest.raises(DaemonError, match=r"can be reached from other machines.*`pzctl keys server`"):
        open_to_all(start_daemon)
    make_server(keys_folder(tmp_path))
    with pytest.raises(DaemonError, match="no client has access yet; make a key with `pzctl keys client NAME`"):
        open_to_all(start_daemon)


def test_every_client_does_what_it_may(start_daemon, build: Build, key_of, tmp_path: Path) -> None:
    make_server(keys_folder(tmp_path))
    watcher, worker = key_of("watcher", "watch"), key_of("worker", "measure")
    where = open_to_all(start_daemon)
    assert stat.S_IMODE((tmp_path / "daemon.json").stat().st_mode) == 0o600
    with connect(where.events, where.requests, watcher) as lab:
        assert lab.status().measuring is None
        events = lab.listen(patience=60)
        for ask, needs in (
            (lambda: lab.measure(build, "disk"), "'measure' needs 'measure'"),
            (lambda: lab.bench({"command": "truth"}), "'bench' needs 'bench'"),
            (lab.shutdown, "'shutdown' needs 'admin'"),
        ):
            with pytest.raises(DaemonError, match=f"'watcher' has the right to watch; {needs}"):
                ask()
        with connect(where.events, where.requests, worker) as other:
            measurement = other.measure(build, "disk").id
            assert other.wait_fit(ECHO, measurement).steps == ("disk",), "a fitter of this machine has a key of its own"
            with pytest.raises(DaemonError, match="needs 'admin'"):
                other.shutdown()
            assert next(events).event.seq > 0
            revoke(keys_folder(tmp_path), "worker")
            with pytest.raises(DaemonError, match="this key has been revoked"):
                other.measure(build, "disk")
    for way in ((), (where.events, where.requests)):
        with connect(*way) as lab:
            assert lab.measure(build, "disk").sweeps, "who can read daemon.json may do all"


def test_a_listener_whose_key_is_revoked_hears_no_more(start_daemon, key_of, tmp_path: Path, wait_until) -> None:
    make_server(keys_folder(tmp_path))
    ana, bob = key_of("ana", "watch"), key_of("bob", "watch")
    where = open_to_all(start_daemon)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.SUB) as of_ana, context.socket(zmq.SUB) as of_bob:
        for link, key in ((of_ana, ana), (of_bob, bob)):
            unlock(link, read_client_key(key))
            link.subscribe(b"")
            link.connect(where.events)
            assert link.recv() == b"welcome."
        assert of_ana.poll(3000), "a beat"
        revoke(keys_folder(tmp_path), "ana")

        def silent() -> bool:
            while of_ana.poll(0):
                of_ana.recv_multipart()
            return not of_ana.poll(1500)

        wait_until(silent)
        while of_bob.poll(0):
            of_bob.recv_multipart()
        assert of_bob.poll(3000), "nobody else is cut off"
    context.term()


def test_a_client_whose_key_could_not_be_written_has_no_access(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    make_server(keys_folder(tmp_path))
    (tmp_path / "file").touch()
    done = CliRunner().invoke(app, ["keys", "client", "ana", "--out", str(tmp_path / "file" / "ana.key")])
    assert isinstance(done.exception, KeyFileError)
    assert clients(keys_folder(tmp_path)) == ((), ())


def test_clients_without_a_valid_key_are_ignored(start_daemon, key_of, tmp_path: Path) -> None:
    """A client without a key, one with a self-made key, one whose key was revoked."""
    server = make_server(keys_folder(tmp_path))
    key_of("known", "watch")
    revoked = json.loads(key_of("gone", "admin").read_bytes())
    where = open_to_all(start_daemon)
    revoke(keys_folder(tmp_path), "gone")
    public, secret = (half.decode() for half in zmq.curve_keypair())
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    for key in (None, ClientKey(server.public, public, secret), ClientKey(**revoked)):
        for kind, endpoint in ((zmq.DEALER, where.requests), (zmq.SUB, where.events)):
            with context.socket(kind) as link:
                link.setsockopt(zmq.LINGER, 0)
                if key:
                    link.curve_serverkey, link.curve_publickey = key.server.encode(), key.public.encode()
                    link.curve_secretkey = key.secret.encode()
                if kind == zmq.SUB:
                    link.subscribe(b"")
                link.connect(endpoint)
                if kind == zmq.DEALER:
                    link.send(b'{"id":"1","request":"hello"}')
                assert not link.poll(400), "no answer, no welcome"
    context.term()
    with connect() as lab:
        assert lab.status().garbage == 0, "nothing of theirs reached the daemon"


def test_a_client_that_is_turned_away_is_told(start_daemon, key_of, tmp_path: Path) -> None:
    make_server(keys_folder(tmp_path))
    key_of("known", "watch")
    barred = key_of("barred", "admin")
    where = open_to_all(start_daemon)
    revoke(keys_folder(tmp_path), "barred")

    def blocking() -> None:
        with connect(where.events, where.requests, barred) as lab:
            lab.status()

    async def both() -> list[BaseException | None]:
        async def waiting() -> None:
            async with connect_async(where.events, where.requests, barred) as lab:
                await lab.status()

        return await asyncio.wait_for(
            asyncio.gather(asyncio.to_thread(blocking), waiting(), return_exceptions=True), 20
        )

    for error in asyncio.run(both()):
        assert isinstance(error, DaemonError)
        assert "it refuses this client" in str(error)
        assert error.code == "not-allowed"


def test_keys_by_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)

    def keys(*words: str) -> str:
        """The command's output, or its error."""
        done = CliRunner().invoke(app, ["keys", *words])
        return str(done.exception) if done.exception else done.stdout

    assert "there is no key" in keys("client", "ana")
    assert "the daemon's public key" in keys("server")
    assert "exists already" in keys("server")
    assert "allowed are watch, measure, bench, admin" in keys("client", "ana", "--right", "all")
    assert "a name has 1 to 64 letters" in keys("client", "../ana", "--out", "a.key")
    assert "ana has the right to measure; pass ana.key on" in keys("client", "ana", "--right", "measure")
    assert all(stat.S_IMODE(path.stat().st_mode) == 0o600 for path in tmp_path.rglob("*") if path.is_file())
    assert keys("list").split("\t")[:2] == ["ana", "measure"]
    assert "'bob' is not known; there are ana" in keys("revoke", "bob")
    assert keys("revoke", "ana") == "ana no longer has access\n"
    assert keys("list") == ""
    assert json.loads(keys("client", "eve", "--json")) == {"name": "eve", "right": "watch", "file": "eve.key"}
    assert json.loads(keys("revoke", "eve", "--json")) == {"name": "eve", "revoked": True}
    (tmp_path / "keys" / "server.json").unlink()
    assert json.loads(keys("server", "--json"))["public"]


def test_a_key_that_others_may_read_is_refused(key_of, tmp_path: Path) -> None:
    make_server(keys_folder(tmp_path))
    path = key_of("ana", "watch")
    path.chmod(0o644)
    with pytest.raises(KeyFileError, match="others than its owner may read this key"):
        connect("tcp://127.0.0.1:1", "tcp://127.0.0.1:2", path)
