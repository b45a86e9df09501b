"""The daemon as a service, measured: soak, kills, hostile messages. Run with -s to read the figures.

Modest sizes unless the environment asks for more: PZCTL_SOAK=10000 PZCTL_KILLS=200 PZCTL_HOSTILE=1000000.
"""

import os
import random
import signal
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zmq

from pzctl.daemon.archive import Archive
from pzctl.daemon.client import connect
from pzctl.daemon.connection import DaemonError
from pzctl.daemon.frames import to_json
from pzctl.daemon.journal import Journal
from pzctl.daemon.launch import start
from pzctl.daemon.location import Location
from pzctl.daemon.paths import journal_folder
from pzctl.daemon.requests import Measure
from pzctl.daemon.service import Options
from pzctl.daemon.uuid7 import uuid7
from pzctl.daemon.wire import Instrument, Sample, SweepEvent, sweep_columns
from pzctl.models.build import Build, LayerSpec, Load, Quantity, Step
from pzctl.models.plan import Segment, SweepPlan
from pzctl.models.sweep import Sweep

SOAK = int(os.environ.get("PZCTL_SOAK", "300"))
KILLS = int(os.environ.get("PZCTL_KILLS", "10"))
HOSTILE = int(os.environ.get("PZCTL_HOSTILE", "20000"))

AIR = Load("air", Quantity(413.0))
PLAN = SweepPlan((Segment(1e6, 6e6, 801),))
LAYERS = (LayerSpec("disk", "piezo", {"thickness": Quantity(5.12e-4, u=1e-6)}),)
BUILD = Build("soak", Quantity(2e-4), LAYERS, AIR, AIR, (Step("disk", ("disk",)),), plan=PLAN)
FLOODER = Path(__file__).with_name("flooder.py")
ECHO = "guest_examples:Echo"

pytestmark = pytest.mark.timeout(6 * 3600)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1] / "daemon"))
    yield tmp_path
    try:
        with connect() as lab:
            lab.shutdown()
    except DaemonError:
        return


def begin(*fitters: str) -> Location:
    return start(Options(fitters=fitters, simulator={"time_scale": 0}))


def rss_MB(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Reader(threading.Thread):
    """Hears every event; from time to time it goes away and comes back, asking for what it missed."""

    def __init__(self, restarts: bool) -> None:
        super().__init__()
        self.seqs: list[int] = []
        self.ends = 0
        self._restarts = restarts
        self._chance = random.Random(1)  # noqa: S311

    def run(self) -> None:
        while not self._done():
            self._listen(self._chance.uniform(0.5, 3.0) if self._restarts else 1e9)

    def _done(self) -> bool:
        return bool(self.ends and self.seqs and self.seqs[-1] >= self.ends)

    def _listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        with connect() as lab:
            events = lab.listen(patience=1.0)
            newest = lab.hello().seq
            first = self.seqs[-1] + 1 if self.seqs else newest + 1
            missed = [heard.event.seq for heard in lab.replay(first, newest)] if first <= newest else []
            self.seqs += missed
            while time.monotonic() < until and not self._done():
                heard = next(events, None)
                if heard is not None and heard.event.seq > (self.seqs[-1] if self.seqs else 0):
                    self.seqs.append(heard.event.seq)
                if heard is None:
                    events = lab.listen(patience=1.0)


def test_soak(home: Path) -> None:
    """Sweeps of 801 points through daemon, journal and three subscribers: one never reads, one restarts at random."""
    where = begin()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    sleeper = context.socket(zmq.SUB)
    sleeper.setsockopt(zmq.RCVHWM, 1)
    sleeper.subscribe(b"")
    sleeper.connect(where.events)
    sleeper.recv()
    readers = [Reader(restarts=False), Reader(restarts=True)]
    for reader in readers:
        reader.start()
    time.sleep(1)
    rss: list[float] = []
    began = time.perf_counter()
    with connect() as lab:
        for k in range(SOAK):
            lab.measure(BUILD, "disk")
            if k % max(1, SOAK // 10) == 0:
                rss.append(rss_MB(where.pid))
        seconds = time.perf_counter() - began
        newest, metrics = lab.hello().seq, lab.metrics()
        for reader in readers:
            reader.ends = newest
        lab.begin(BUILD, "disk")  # something to be heard, so that all of them see the end
        for reader in readers:
            reader.join(120)
    sleeper.close()
    context.term()
    bound = floor(home)
    print(f"\nsoak: {SOAK} sweeps in {seconds:.1f} s = {SOAK / seconds:.1f} a second")
    print(f"an event kept and said: median {1e3 * (metrics.seconds['publish'].median or 0):.2f} ms; ", end="")
    print(
        f"a sweep kept by the journal alone: {1e3 * bound:.2f} ms; replayed {metrics.counts.get('replayed', 0)} events"
    )
    print(f"memory by tenths: {[round(m, 1) for m in rss]} MB")
    for reader in readers:
        assert not reader.is_alive()
        assert reader.seqs[-1] >= newest
        assert reader.seqs == list(range(reader.seqs[0], reader.seqs[0] + len(reader.seqs))), "none lost, none twice"
    archive = Archive(journal_folder(home))
    assert archive.verify() == []
    archive.close()


def floor(home: Path) -> float:
    """Seconds that the journal needs for one sweep, with nobody listening."""
    columns, payload = sweep_columns(Sweep(np.linspace(1e6, 6e6, 801), np.exp(1j * np.arange(801))))
    event = SweepEvent(
        measurement="m",
        sample=Sample("soak", "disk"),
        instrument=Instrument("R", "I", "4294A", "1", "1", simulated=True),
        build=BUILD,
        segment=1,
        segments=1,
        started="t",
        settings={},
        columns=columns,
    )
    journal = Journal(home / "bare")
    began = time.perf_counter()
    for _ in range(100):
        journal.append(event, payload)
    seconds = (time.perf_counter() - began) / 100
    journal.close()
    return seconds


def family(pid: int) -> list[int]:
    return [pid, *map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())]


def test_kills(home: Path) -> None:
    """`kill -9` of daemon, fitter or simulator at random moments: nothing that was announced is lost."""
    chance = random.Random(0)  # noqa: S311
    heard: list[list[bytes]] = []
    killed = {"daemon": 0, "child": 0}
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    where = begin(ECHO)
    ear, mouth = tied(context, where)
    for _ in range(KILLS):
        until = time.monotonic() + chance.uniform(0.3, 1.5)
        while time.monotonic() < until:
            mouth.send(to_json(Measure(id=uuid7(), build=BUILD, step="disk")))
            while ear.poll(20):
                heard.append(ear.recv_multipart())
        alive = family(where.pid)
        victim = chance.choice(alive)
        os.kill(victim, signal.SIGKILL)
        if victim == where.pid:
            killed["daemon"] += 1
        else:
            killed["child"] += 1
            with suppress(DaemonError), connect() as lab:
                lab.shutdown()  # the simulator's instrument is gone for good with it
        wait_gone(where.pid)
        while ear.poll(200):
            heard.append(ear.recv_multipart())
        ear.close()
        mouth.close()
        where = begin(ECHO)
        ear, mouth = tied(context, where)
    ear.close()
    mouth.close()
    context.term()
    archive = Archive(journal_folder(home))
    assert archive.verify() == []
    recorded = {tuple(frames) for frames in archive.replay(1, None, 10_000_000)}
    announced = [frames for frames in heard if frames[0] not in (b"welcome.", b"beat.")]
    lost = [frames for frames in announced if tuple(frames) not in recorded]
    archive.close()
    print(f"\nkills: {killed}, {len(announced)} announced events heard, {len(lost)} lost, journal verifies")
    assert announced
    assert not lost


def wait_gone(pid: int) -> None:
    """Wait until a process has gone; `start` has a thread that reaps it."""
    deadline = time.monotonic() + 30
    while Path(f"/proc/{pid}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)


def tied(context: "zmq.Context[zmq.Socket[bytes]]", where: Location) -> "tuple[zmq.Socket[bytes], zmq.Socket[bytes]]":
    """One socket that hears everything from now on, and one that asks."""
    ear, mouth = context.socket(zmq.SUB), context.socket(zmq.DEALER)
    for link in (ear, mouth):
        link.setsockopt(zmq.LINGER, 0)
        link.setsockopt(zmq.RCVTIMEO, 10_000)
    ear.subscribe(b"")
    ear.connect(where.events)
    ear.recv()
    mouth.connect(where.requests)
    return ear, mouth


def cpu_seconds(pid: int) -> float:
    """Seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_hostile(home: Path) -> None:
    """Messages made to harm, from another process over eight connections; a proper question is asked meanwhile."""
    where = begin()
    delays: list[float] = []
    before, began, used = rss_MB(where.pid), time.perf_counter(), cpu_seconds(where.pid)
    flood = subprocess.Popen([sys.executable, str(FLOODER), where.requests, str(HOSTILE), "8"])
    rss: list[float] = []
    with connect() as lab:
        while flood.poll() is None:
            asked = time.perf_counter()
            lab.status()
            delays.append(time.perf_counter() - asked)
            rss.append(rss_MB(where.pid))
            time.sleep(0.02)
        seconds, used = time.perf_counter() - began, cpu_seconds(where.pid) - used
        counts = lab.metrics().counts
    ordered = sorted(1e3 * delay for delay in delays)
    print(f"\nhostile: {HOSTILE} messages in {seconds:.1f} s; {counts.get('garbage', 0)} counted as garbage, ", end="")
    print(f"{1e6 * used / HOSTILE:.0f} us of the daemon's processor time each")
    print(f"a proper question meanwhile, {len(ordered)} of them: median {statistics.median(ordered):.1f} ms, ", end="")
    print(f"99.9 % {ordered[int(0.999 * len(ordered))]:.1f} ms, most {ordered[-1]:.1f} ms")
    tenths = [round(rss[k * len(rss) // 10], 1) for k in range(10)]
    print(f"memory {before:.1f} MB before; by tenths {tenths} MB; {rss_MB(where.pid):.1f} MB after")
    assert flood.returncode == 0


def test_beside_a_bare_socket(home: Path) -> None:
    """Sweep to subscriber: what journal and checks cost beside a plain PUB/SUB that keeps nothing."""
    begin()
    with connect() as lab:
        for _ in range(50):
            lab.measure(BUILD, "disk")
        published = lab.metrics().seconds["publish"].median or 0
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    pub, sub = context.socket(zmq.PUB), context.socket(zmq.SUB)
    port = pub.bind_to_random_port("tcp://127.0.0.1")
    sub.subscribe(b"")
    sub.connect(f"tcp://127.0.0.1:{port}")
    time.sleep(0.3)
    message = [b"sweep.", msgspec.json.encode({"k": 1}), struct.pack("<1602d", *range(1602))]
    bare: list[float] = []
    for _ in range(200):
        began = time.perf_counter()
        pub.send_multipart(message)
        sub.recv_multipart()
        bare.append(time.perf_counter() - began)
    pub.close()
    sub.close()
    context.term()
    plain = statistics.median(bare)
    print(
        f"\nkept and said {1e3 * published:.2f} ms; plain PUB/SUB {1e3 * plain:.2f} ms: {published / plain:.1f} times"
    )
