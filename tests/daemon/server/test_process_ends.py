"""Every process may end or be killed at any moment: no announced event is lost, and no file is left half written."""

import os
import random
import signal
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import zmq
from keyed import unlocked

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import find
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import journal_folder, log_file
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.server.launch import running, start
from pzctl.daemon.server.workers.subprocesses import last_line
from pzctl.daemon.wire.events import ProgressEvent, StateEvent
from pzctl.daemon.wire.frames import to_json
from pzctl.daemon.wire.requests import MeasureRequest
from pzctl.daemon.wire.uuid7 import uuid7
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions
from pzctl.sim.server import running as simulator

as_for_users = pytest.mark.usefixtures("as_for_users")
ECHO = "guest_examples:Echo"


def overhear(endpoint: str, heard: list[list[bytes]], stop: threading.Event) -> None:
    """Record all published messages as bytes."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.SUB) as link:
        link.subscribe(b"")
        unlocked(link).connect(endpoint)
        while not stop.is_set():
            if link.poll(50):
                heard.append(link.recv_multipart())
    context.term()


def ask_for_measurements(endpoint: str, build: Build, go_on: Callable[[], bool]) -> None:
    """Request one measurement after the other, without waiting for answers."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.DEALER) as link:
        link.setsockopt(zmq.LINGER, 0)
        unlocked(link).connect(endpoint)
        while go_on():
            link.send(to_json(MeasureRequest(id=uuid7(), build=build, step="disk")))
            time.sleep(0.02)
    context.term()


@pytest.mark.parametrize("seed", range(4))
def test_kill_9_loses_nothing_that_was_announced(start_daemon, build: Build, end, tmp_path: Path, seed: int) -> None:
    where = start_daemon("Echo")
    heard: list[list[bytes]] = []
    stop = threading.Event()
    listener = threading.Thread(target=overhear, args=(where.events, heard, stop))
    listener.start()
    moment = random.Random(seed).uniform(0.3, 1.2)  # noqa: S311
    killer = threading.Timer(moment, end, (where.pid, signal.SIGKILL))
    killer.start()
    ask_for_measurements(where.requests, build, killer.is_alive)
    killer.join()
    stop.set()
    listener.join()

    again = start_daemon()
    archive = JournalReader(journal_folder(tmp_path))
    assert archive.verify() == []
    recorded = archive.replay(1, None, 1_000_000)
    announced = [frames for frames in heard if frames[0] not in (b"welcome.", b"beat.")]
    assert announced
    assert all(frames in recorded for frames in announced)
    assert all(one.state in ("measured", "abandoned") for one in archive.measurements())
    archive.close()
    with connect() as lab:
        assert lab.hello().run == again.run
        assert lab.measure(build, "disk").sweeps


@as_for_users
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_asked_to_end_it_leaves_the_instrument_as_it_should_be(
    start_daemon, build: Build, end, how, tmp_path, wait_until
) -> None:
    with simulator(SimOptions(port=0, bench_port=0, time_scale=1.0)) as sim:
        where = start_daemon("Echo", resource=sim.resource, bench=f"127.0.0.1:{sim.bench_port}")
        with connect() as lab:
            events = lab.listen(patience=60)
            lab.begin(build, "disk", SweepPlan((Segment(1e6, 6e6),), bias_V=1.0))
            lab.begin(build, "ml1")
            while not (isinstance(event := next(events).event, StateEvent) and event.state == "measuring"):
                pass
            wait_until(lambda: ask_instrument(sim.port, "DCO?") == "1")
            os.kill(where.pid, how)
            states: list[str] = []
            while states.count("cancelled") < 2:
                if isinstance(event := next(events).event, StateEvent) and not event.fitter:
                    states.append(event.state)
        end(where.pid, signal.SIGTERM)
        assert states[-3:] == ["stopping", "cancelled", "cancelled"]
        assert find(tmp_path) is None
        assert not (tmp_path / "daemon.json").exists()
        archive = JournalReader(journal_folder(tmp_path))
        assert [one.state for one in archive.measurements()] == ["cancelled", "cancelled"]
        archive.close()
        assert ask_instrument(sim.port, "DCO?") == "0"


def ask_instrument(port: int, query: str) -> str:
    with socket.create_connection(("127.0.0.1", port)) as link, link.makefile("rwb") as lines:
        lines.write(query.encode() + b"\n")
        lines.flush()
        return lines.readline().decode().strip()


@as_for_users
def test_cancel_ends_the_running_measurement_and_the_next_one_begins(start_daemon, build: Build) -> None:
    start_daemon(time_scale=1.0)
    with connect() as lab, connect() as other:
        asked: list[None] = []

        def cancel(_: ProgressEvent) -> None:
            if not asked:
                asked.append(other.cancel())

        with pytest.raises(DaemonError, match="cancel") as refusal:
            lab.measure(build, "disk", progress=cancel)
        assert refusal.value.code == "cancelled"
        waiting = [lab.begin(build, "disk"), lab.begin(build, "ml1")]
        lab.cancel(waiting[1])
        lab.cancel(waiting[0])
        with pytest.raises(DaemonError, match="neither runs nor waits"):
            lab.cancel("nonsense")


@as_for_users
def test_ctrl_c_of_who_waits_cancels_the_measurement(start_daemon, build: Build) -> None:
    start_daemon(time_scale=1.0)

    def interrupt(_: ProgressEvent) -> None:
        raise KeyboardInterrupt

    with connect() as lab:
        events = lab.listen(patience=60)
        with pytest.raises(KeyboardInterrupt):
            lab.measure(build, "disk", progress=interrupt)
        while not (isinstance(event := next(events).event, StateEvent) and event.state == "cancelled"):
            pass


@as_for_users
def test_a_disk_that_fails_ends_the_daemon_before_it_says_what_it_has_not_kept(
    start_daemon, build: Build, wait_until, tmp_path: Path
) -> None:
    start_daemon()
    arrays = journal_folder(tmp_path) / "arrays"
    arrays.rmdir()
    with connect() as lab:
        lab.begin(build, "disk")
        wait_until(lambda: "the journal cannot be read or written" in last_line(log_file(tmp_path, "daemon")))
    assert find(tmp_path) is None
    arrays.mkdir()
    start_daemon()
    archive = JournalReader(journal_folder(tmp_path))
    assert [one.state for one in archive.measurements()] == ["abandoned"]
    assert archive.verify() == []
    archive.close()


@as_for_users
def test_a_killed_fitter_is_restarted_and_answers(start_daemon, build: Build, wait_until) -> None:
    where = start_daemon("Echo")
    with connect() as lab:
        wait_until(lambda: lab.hello().fitters[0].state == "ready")
        (guest,) = [pid for pid in children(where.pid) if "pzctl.daemon.server.workers.fitter_worker" in command(pid)]
        os.kill(guest, signal.SIGKILL)
        measurement = lab.measure(build, "disk")
        assert lab.wait_fit(ECHO, measurement.id).steps == ("disk",)


@as_for_users
def test_a_killed_daemon_ends_its_child_processes(start_daemon, end, wait_until) -> None:
    where = start_daemon("Echo")
    with connect() as lab:
        wait_until(lambda: lab.hello().fitters[0].state == "ready")
    family = children(where.pid)
    assert len(family) == 2, "the simulated instrument and one fitter"
    end(where.pid, signal.SIGKILL)
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in family))


@as_for_users
def test_a_simulator_that_dies_fails_the_measurement_only(start_daemon, build: Build) -> None:
    where = start_daemon()
    (sim,) = children(where.pid)
    os.kill(sim, signal.SIGKILL)
    with connect() as lab:
        with pytest.raises(DaemonError, match=r"TCPIP0::127\.0\.0\.1"):
            lab.measure(build, "disk")
        assert lab.status().measuring is None


@as_for_users
def test_one_daemon_right_after_another(start_daemon, build: Build) -> None:
    runs: list[str] = []
    for _ in range(3):
        runs.append(start_daemon("Echo").run)
        with connect() as lab:
            lab.begin(build, "disk")
            lab.shutdown()
    assert len(set(runs)) == 3


@as_for_users
def test_one_daemon_for_one_data_folder(start_daemon, end, tmp_path: Path) -> None:
    where = start_daemon()
    assert start() == where == running()
    with pytest.raises(DaemonError, match=r"runs already .* not GPIB0::17::INSTR; end it first"):
        start_daemon(resource="GPIB0::17::INSTR")
    end(where.pid, signal.SIGKILL)
    assert (tmp_path / "daemon.json").exists()
    assert running() is None
    with pytest.raises(DaemonError, match="no daemon runs on the data folder"):
        connect()


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def command(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
