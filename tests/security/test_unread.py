"""A client that requests much and reads nothing costs the daemon no memory, and others are answered meanwhile."""

import json
import os
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import zmq
from keyed import unlocked

from pzctl import connect
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, StateEvent, SweepEvent, sweep_columns
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep


def rss_MB(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.fixture
def measurement(tmp_path: Path, build: Build) -> str:
    """A measurement of four segments with 200,000 points each, in the journal before the daemon starts."""
    with closing(JournalWriter(journal_folder(tmp_path))) as journal:
        name, _ = journal.begin_measurement("1", build, "disk")
        columns, payload = sweep_columns(Sweep(np.linspace(1e6, 2e6, 200_000), np.ones(200_000) + 1j))
        info = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
        for segment in range(1, 5):
            said = {"instrument": info, "build": build, "segment": segment, "segments": 4, "started": ""}
            sample = SampleStep(build.name, "disk")
            journal.append(SweepEvent(measurement=name, sample=sample, settings={}, columns=columns, **said), payload)
        journal.append(StateEvent(state="measured", measurement=name, sample=sample))
        return name


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="this needs Linux")
def test_answers_that_nobody_reads_are_not_kept_without_end(
    start_daemon: Callable[..., Location], measurement: str, build: Build, wait_until: Callable[..., None]
) -> None:
    where = start_daemon()
    with zmq.Context() as context, context.socket(zmq.DEALER) as deaf, connect() as lab:
        deaf.linger = 0
        deaf.set(zmq.RCVHWM, 1)
        unlocked(deaf, where).connect(where.requests)
        before = rss_MB(where.pid)
        for k in range(60):
            request = {"v": 1, "id": str(k), "request": "sweeps", "measurement": measurement}
            deaf.send(json.dumps(request).encode())
        wait_until(lambda: lab.metrics().counts.get("refused", 0) > 20)
        assert rss_MB(where.pid) - before < 300
        assert lab.measure(build, "disk").sweeps, "others are served"
        deaf.rcvtimeo = 20_000
        while json.loads((answer := deaf.recv_multipart())[0])["ok"]:
            pass
        error = json.loads(answer[0])["error"]
        assert (error["code"], "MB of earlier answers were not read yet" in error["message"]) == ("too-much", True)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="this needs Linux")
def test_a_client_that_reads_slowly_is_not_refused(start_daemon: Callable[..., Location], measurement: str) -> None:
    """It asks for ten answers of 19 MB at once, and for each of them twice, as if it had lost its patience."""
    where = start_daemon()
    with zmq.Context() as context, context.socket(zmq.DEALER) as slow, connect() as lab:
        slow.linger = 0
        slow.set(zmq.RCVHWM, 1)
        slow.rcvtimeo = 60_000
        unlocked(slow, where).connect(where.requests)
        before = rss_MB(where.pid)
        for k in [*range(10), *range(10)]:
            request = {"v": 1, "id": str(k), "request": "sweeps", "measurement": measurement}
            slow.send(json.dumps(request).encode())
        answers = []
        while len(answers) < 10:
            time.sleep(0.5)
            answers.append(json.loads(slow.recv_multipart()[0]))
            assert rss_MB(where.pid) - before < 300
        assert sorted((answer["id"], answer["ok"]) for answer in answers) == [(str(k), True) for k in range(10)]
        lab.status()


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="this needs Linux")
def test_a_client_that_leaves_without_reading_frees_its_connection(
    start_daemon: Callable[..., Location], measurement: str, wait_until: Callable[..., None]
) -> None:
    """The kernel asked for room for its answers on and on, and five hundred such connections let in nobody else."""
    where = start_daemon()
    descriptors = Path(f"/proc/{where.pid}/fd")
    with connect() as lab:
        lab.fits(measurement)  # a file of the journal stays open
        before = len(list(descriptors.iterdir()))
        with zmq.Context() as context, context.socket(zmq.DEALER) as deaf:
            deaf.linger = 0
            deaf.set(zmq.RCVHWM, 1)
            unlocked(deaf, where).connect(where.requests)
            for k in range(3):
                request = {"v": 1, "id": str(k), "request": "sweeps", "measurement": measurement}
                deaf.send(json.dumps(request).encode())
            wait_until(lambda: lab.metrics().counts["requests"] > 5)
            time.sleep(2.0)  # what the kernel had room for is read and acknowledged
            assert len(list(descriptors.iterdir())) > before
        wait_until(lambda: len(list(descriptors.iterdir())) <= before)
        lab.status()


def test_a_client_that_reads_may_continue(start_daemon: Callable[..., Location], measurement: str) -> None:
    where = start_daemon()
    with Client(where.events, where.requests, where.key) as lab:
        for _ in range(8):
            assert len(lab.sweeps(measurement)) == 4
