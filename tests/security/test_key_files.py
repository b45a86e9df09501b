"""A key file affects its own key only, takes effect as soon as it changes, and expires on its date."""

import json
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path

import pytest

from pzctl.daemon.client.client import Client
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.server.access.access_control import AccessControl
from pzctl.daemon.server.requests.request_errors import RequestError
from pzctl.daemon.wire.curve_keys import (
    KeyFileError,
    client_files,
    clients,
    local_keys,
    make_client,
    make_server,
    read_client,
    read_client_key,
    revoke,
    rotate,
)
from pzctl.daemon.wire.requests import BenchRequest, StatusRequest
from pzctl.models.build import Build

STATUS = StatusRequest(id="1")


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    """A folder of keys with a server's."""
    make_server(keys_folder(tmp_path))
    return keys_folder(tmp_path)


def spoil(path: Path, how: str) -> None:
    """Make a client's key file unusable."""
    if how == "mode":
        path.chmod(0o644)
        return
    content = path.read_text()
    path.unlink()
    match how:
        case "link":
            path.symlink_to("nowhere")
        case "pipe":
            os.mkfifo(path, 0o600)
        case "folder":
            path.mkdir()
        case "name of another":
            path.write_text(content.replace("ben", "ana"))
            path.chmod(0o600)
        case _:
            path.write_bytes({"empty": b"", "bytes": b"\xff\xfe", "nested": b"[" * 100_000}[how])
            path.chmod(0o600)


@pytest.mark.parametrize("how", ["mode", "link", "pipe", "folder", "name of another", "empty", "bytes", "nested"])
@pytest.mark.timeout(20)
def test_a_bad_key_file_bars_its_own_key_alone_and_is_said_once(
    keys: Path, caplog: pytest.LogCaptureFixture, how: str
) -> None:
    ana, ben = (make_client(keys, name, "measure") for name in ("ana", "ben"))
    gate = AccessControl(keys, outside=True)
    assert gate.check(ben.public, STATUS) == "ben"
    path = keys / "clients" / "ben.json"
    whole = path.read_bytes()
    with caplog.at_level(logging.WARNING):
        spoil(path, how)
        for _ in range(3):
            assert gate.check(ana.public, STATUS) == "ana"
            assert not gate.allows(ben.public)
        make_client(keys, "eve", "watch")
        assert gate.allows(ana.public)
    assert sum("ben.json" in record.getMessage() for record in caplog.records) == 1
    assert gate.somebody_was_barred()
    found, faults = clients(keys)
    assert [one.name for one in found] == ["ana", "eve"]
    assert len(faults) == 1
    assert "ben.json" in faults[0]
    if how == "folder":
        path.rmdir()
    else:
        revoke(keys, "ben")
    path.write_bytes(whole)
    path.chmod(0o600)
    assert gate.check(ben.public, STATUS) == "ben", "mended, it counts"
    assert not gate.somebody_was_barred()


def test_a_right_that_is_lowered_in_place_counts_at_once(start_daemon: Callable[..., Location], keys: Path) -> None:
    """Even if the file keeps its size and its times: the clock of a file system is coarse."""
    key = make_client(keys, "ana", "admin")
    path = keys / "clients" / "ana.json"
    where = start_daemon()
    with Client(where.events, where.requests, key) as lab:
        assert lab.status().seq > 0
        stat = path.stat()
        with path.open("r+") as file:
            file.write(path.read_text().replace("admin", "watch"))
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        with pytest.raises(DaemonError, match="'ana' has the right to watch; 'shutdown' needs 'admin'"):
            lab.shutdown()


def test_a_change_within_a_tick_of_the_file_systems_clock_is_detected(
    keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ana = make_client(keys, "ana", "admin")
    path = keys / "clients" / "ana.json"
    same, stat = path.stat(), Path.stat
    monkeypatch.setattr(Path, "stat", lambda self, **how: same if self == path else stat(self, **how))
    gate = AccessControl(keys, outside=True)
    assert gate.allows(ana.public)
    public = "z" * 40
    path.write_text(path.read_text().replace(ana.public, public))
    assert not gate.allows(ana.public)
    assert gate.allows(public)


def test_a_key_is_refused_after_its_day(keys: Path) -> None:
    today = date(2027, 1, 1)
    gate = AccessControl(keys, outside=False, today=lambda: today)
    ana = make_client(keys, "ana", "admin", date(2027, 1, 1))
    assert gate.check(ana.public, STATUS) == "ana"
    assert not gate.somebody_was_barred()
    today = date(2027, 1, 2)
    assert not gate.allows(ana.public)
    assert gate.somebody_was_barred(), "the listener is disconnected"
    assert not gate.somebody_was_barred()
    with pytest.raises(RequestError, match="the key of 'ana' expired after 2027-01-01"):
        gate.check(ana.public, STATUS)


def test_an_expiry_that_is_written_into_the_file_counts_at_once(
    start_daemon: Callable[..., Location], keys: Path
) -> None:
    key = make_client(keys, "ana", "measure")
    path = keys / "clients" / "ana.json"
    where = start_daemon()
    with Client(where.events, where.requests, key) as lab:
        assert lab.status().seq > 0
        path.write_text(json.dumps(json.loads(path.read_text()) | {"expires": "2020-01-01"}))
        with pytest.raises(
            DaemonError, match=r"the key of 'ana' expired after 2020-01-01; ask the daemon.s administrator"
        ):
            lab.status()


TODAY = date(2027, 3, 1)
WEEK = timedelta(days=7)


def test_the_key_before_a_rotation_expires_and_allows_no_more_than_the_new_one(keys: Path) -> None:
    today = [TODAY]
    old = make_client(keys, "ana", "bench")
    gate = AccessControl(keys, outside=True, today=lambda: today[0])
    new = rotate(keys, "ana", TODAY + WEEK, TODAY)
    step = BenchRequest(id="1", command={"command": "status"})
    assert [gate.check(key.public, step) for key in (old, new)] == ["ana", "ana"], "one client with two keys"
    path = keys / "clients" / "ana.json"
    path.write_text(path.read_text().replace('"bench"', '"watch"'))
    for key in (old, new):
        assert gate.check(key.public, STATUS) == "ana"
        with pytest.raises(RequestError, match="has the right to watch"):
            gate.check(key.public, step)
    with pytest.raises(KeyFileError, match=r"the key before this one is valid until 2027-03-08; rotate again after"):
        rotate(keys, "ana", TODAY + WEEK, TODAY)
    today[0] = TODAY + WEEK + timedelta(days=1)
    assert [gate.allows(key.public) for key in (old, new)] == [False, True]
    assert gate.somebody_was_barred()
    newest = rotate(keys, "ana", today[0] + WEEK, today[0])
    assert [gate.allows(key.public) for key in (old, new, newest)] == [False, True, True]
    path.unlink()
    assert not gate.allows(new.public), "it is valid only together with the present key"
    fresh = make_client(keys, "ana", "watch")
    assert [gate.allows(key.public) for key in (new, newest, fresh)] == [False, False, True], "nor beside another"
    rotate(keys, "ana", today[0] + WEEK, today[0])
    revoke(keys, "ana")
    assert not gate.allows(fresh.public)


def test_a_rotation_does_not_extend_a_keys_validity(keys: Path) -> None:
    make_client(keys, "ana", "watch", TODAY)
    with pytest.raises(KeyFileError, match="its key expires after 2027-03-01; give the new one a day too"):
        rotate(keys, "ana", TODAY + WEEK, TODAY)
    rotate(keys, "ana", TODAY + WEEK, TODAY, TODAY + 10 * WEEK)
    assert [one.expires for one in clients(keys)[0]] == [TODAY + 10 * WEEK, TODAY]
    with pytest.raises(KeyFileError, match="client 'eve' is not known; there are ana"):
        rotate(keys, "eve", TODAY, TODAY)


def test_both_keys_work_during_a_rotation(
    start_daemon: Callable[..., Location], build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_server(keys_folder(tmp_path))
    old = make_client(keys_folder(tmp_path), "ana", "measure")
    where = start_daemon()
    monkeypatch.chdir(tmp_path)
    with Client(where.events, where.requests, old) as before, before.lease("ana", 60.0) as lease:
        program = Path(sys.executable).with_name("pzctl")
        told = subprocess.run([program, "keys", "rotate", "ana"], capture_output=True, text=True, check=True).stdout
        assert "the old key is valid until" in told
        assert (tmp_path / "ana.new.key").stat().st_mode & 0o077 == 0
        with Client(where.events, where.requests, read_client_key(tmp_path / "ana.new.key")) as after:
            assert after.measure(build, "disk", lease=lease).sweeps, "the lease is the client's, not the key's"
            assert before.status().lease
    again = subprocess.run([program, "keys", "rotate", "nobody"], capture_output=True, text=True, check=False)
    assert again.returncode == 2 or "is not known" in again.stderr
    assert not (tmp_path / "nobody.new.key").exists(), "a key that was not made leaves no file"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of a file's size")
def test_a_key_that_could_not_be_written_to_its_end_is_no_key(tmp_path: Path) -> None:
    folder = keys_folder(tmp_path)
    script = (
        "import resource, signal, sys, pathlib; from pzctl.daemon.wire.curve_keys import local_keys;"
        "signal.signal(signal.SIGXFSZ, signal.SIG_DFL) if sys.argv[2] == 'killed' else None;"
        "resource.setrlimit(resource.RLIMIT_CORE, (0, 0)); resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0));"
        "local_keys(pathlib.Path(sys.argv[1]))"
    )
    for how, says in (("killed", ""), ("refused", f"{folder / 'local.json'} cannot be written: File too large")):
        words = [sys.executable, "-P", "-c", script, folder, how]
        ended = subprocess.run(words, stderr=subprocess.PIPE, text=True, check=False)
        assert ended.returncode != 0
        assert says in ended.stderr
        assert not (folder / "local.json").exists(), how
    pair = local_keys(folder)
    assert local_keys(folder) == pair
    assert (folder / "local.json").stat().st_mode & 0o777 == 0o600


def test_a_key_file_does_not_state_two_rights(keys: Path) -> None:
    make_client(keys, "ana", "watch")
    (path,) = client_files(keys)
    path.write_bytes(path.read_bytes().rstrip()[:-1] + b',"right":"bench"}')
    with pytest.raises(KeyFileError, match=r"ana\.json is not a key: .* the field 'right' is given twice"):
        read_client(path)


def test_a_key_file_that_cannot_be_read_says_what_to_do(tmp_path: Path) -> None:
    folder = keys_folder(tmp_path)
    local_keys(folder)
    (folder / "local.json").write_bytes(b"")
    with pytest.raises(KeyFileError, match=r"local\.json is not a key: .*; remove it: the daemon makes a new one"):
        AccessControl(folder, outside=False)
