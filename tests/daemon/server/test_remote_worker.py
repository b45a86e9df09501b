"""A fitter on another host: a process with its own data folder and key, which the daemon did not start."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pzctl import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.wire.curve_keys import make_client, make_server, revoke, write_secret
from pzctl.daemon.wire.frames import to_json
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"


@pytest.fixture
def visitor(tmp_path: Path) -> "Iterator[Callable[[Location, str], subprocess.Popen[str]]]":
    """Return a function that starts a fitter with a key of this right, at another of this machine's addresses."""
    started: list[subprocess.Popen[str]] = []

    def begin(where: Location, right: str) -> "subprocess.Popen[str]":
        own = tmp_path / f"elsewhere-{right}"
        write_secret(own / "farm.key", to_json(make_client(keys_folder(tmp_path), right, right)))  # type: ignore[arg-type]
        there = [place.replace("127.0.0.1", "127.0.0.2") for place in (where.events, where.requests)]
        words = ["fitters", "--run", ECHO, "--events", there[0], "--requests", there[1], "--key", str(own / "farm.key")]
        environment = {**os.environ, "PZCTL_HOME": str(own), "PYTHONPATH": str(Path(__file__).parents[2] / "support")}
        program = Path(sys.executable).with_name("pzctl")
        started.append(subprocess.Popen([program, *words], env=environment, stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.skipif(sys.platform != "linux", reason="127.0.0.2 is an address on Linux alone")
def test_it_comes_fits_and_comes_back(start_daemon, end, build: Build, tmp_path: Path, visitor, wait_until) -> None:
    make_server(keys_folder(tmp_path))
    make_client(keys_folder(tmp_path), "anybody", "watch")
    first = 10_000 + 2 * (os.getpid() % 10_000)  # below the ephemeral ports of the system, and unique to this test run
    ports = {"events": f"tcp://0.0.0.0:{first}", "requests": f"tcp://0.0.0.0:{first + 1}"}
    where = start_daemon(**ports)
    watcher = visitor(where, "watch")
    assert watcher.wait(60) == 2
    assert "'watch' has the right to watch; 'hello' needs 'measure'" in watcher.stderr.read()

    guest = visitor(where, "measure")
    with connect() as lab:
        wait_until(lambda: [one.name for one in lab.hello().fitters] == ["Echo"])
        measurement = lab.measure(build, "disk").id
        assert lab.wait_fit("Echo", measurement).steps == ("disk",)
    end(where.pid, signal.SIGKILL)
    start_daemon(**ports)
    with connect() as lab:
        wait_until(lambda: [one.name for one in lab.hello().fitters] == ["Echo"])
        assert lab.wait_fit("Echo", lab.measure(build, "disk").id).steps == ("disk",)
        revoke(keys_folder(tmp_path), "measure")
        with pytest.raises(DaemonError, match="no answer within 1 s"):
            lab.wait_fit("Echo", lab.measure(build, "disk").id, patience=1.0)
    assert guest.poll() is None or "revoked" in guest.stderr.read()
