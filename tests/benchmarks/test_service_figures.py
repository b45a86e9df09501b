"""The daemon as a service, measured: soak, kills, hostile messages. Run with -s to read the figures.

Modest sizes unless the environment asks for more: PZCTL_SOAK=10000 PZCTL_KILLS=200 PZCTL_HOSTILE=1000000
PZCTL_PRICED=2000. All runs use CURVE and the hash chain; `test_price` switches them off to compare.
"""

import logging
import os
import random
import signal
import sqlite3
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from datetime import datetime
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zmq
from hostile_messages import ENDLESS
from keyed import unlocked

from pzctl.daemon.client.client import Client, connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.stores import chain
from pzctl.daemon.server.launch import start
from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, StateEvent, SweepEvent, decode, encode, sweep_columns
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import Segment, SweepPlan

SOAK = int(os.environ.get("PZCTL_SOAK", "300"))
KILLS = int(os.environ.get("PZCTL_KILLS", "10"))
PRICED = int(os.environ.get("PZCTL_PRICED", "300"))
HOSTILE = int(os.environ.get("PZCTL_HOSTILE", "20000"))
FLOOD_SECONDS = float(os.environ.get("PZCTL_FLOOD_SECONDS", "2"))

AIR = LoadSpec("air", Quantity(413.0))
PLAN = SweepPlan((Segment(1e6, 6e6, 801),))
LAYERS = (LayerSpec("disk", "piezo", {"thickness": Quantity(5.12e-4, u=1e-6)}),)
BUILD = Build("soak", Quantity(2e-4), LAYERS, AIR, AIR, (Step("disk", ("disk",)),), plan=PLAN)
FLOODER = Path(__file__).with_name("flooder.py")
ECHO = "guest_examples:Echo"

pytestmark = pytest.mark.timeout(6 * 3600)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1] / "support"))
    yield tmp_path
    try:
        with connect() as lab:
            lab.shutdown()
    except DaemonError:
        return


def begin(*fitters: str) -> Location:
    return start(DaemonOptions(fitters=fitters, simulator={"time_scale": 0}))


def rss_MB(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Reader(threading.Thread):
    """Receives every event; from time to time it disconnects, reconnects, and requests the missed events."""

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
            while time.monotonic() < until and not self._done():
                self._follow(lab, until)

    def _follow(self, lab: Client, until: float) -> None:
        """Request the missed events, then receive until nothing arrives for a second."""
        with closing(lab.listen(patience=1.0)) as events:
            newest = lab.hello().seq
            first = self.seqs[-1] + 1 if self.seqs else newest + 1
            self.seqs += [heard.event.seq for heard in lab.replay(first, newest)] if first <= newest else []
            for heard in events:
                if heard.event.seq > (self.seqs[-1] if self.seqs else 0):
                    self.seqs.append(heard.event.seq)
                if time.monotonic() >= until or self._done():
                    return


AHEAD = 20
"""Measurements requested ahead of the running one."""


def measure_on(lab: Client, where: Location, count: int = SOAK) -> tuple[float, list[float]]:
    """Measure sweeps one after the other; return the seconds, and the daemon's memory by tenths."""
    events, done, asked, rss = lab.listen(patience=60), 0, 0, list[float]()
    began = time.perf_counter()
    while done < count:
        while asked < min(count, done + AHEAD):
            lab.begin(BUILD, "disk")
            asked += 1
        event = next(events).event
        if isinstance(event, StateEvent) and event.state == "measured":
            if done % max(1, count // 10) == 0:
                rss.append(rss_MB(where.pid))
            done += 1
    return time.perf_counter() - began, [*rss, rss_MB(where.pid)]


def test_soak(home: Path) -> None:
    """Sweeps of 801 points through daemon, journal and three subscribers: one never reads, one restarts at random."""
    where = begin()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    sleeper = context.socket(zmq.SUB)
    sleeper.setsockopt(zmq.RCVHWM, 1)
    sleeper.subscribe(b"")
    unlocked(sleeper).connect(where.events)
    sleeper.recv()
    readers = [Reader(restarts=False), Reader(restarts=True)]
    for reader in readers:
        reader.start()
    time.sleep(1)
    used = cpu_seconds(where.pid)
    with connect() as lab, connect() as other:
        seconds, rss = measure_on(lab, where)
        used = cpu_seconds(where.pid) - used
        newest, metrics = other.hello().seq, other.metrics()
        for reader in readers:
            reader.ends = newest
        other.begin(BUILD, "disk")  # one more event, so that all of them see the end
        for reader in readers:
            reader.join(120)
    sleeper.close()
    context.term()
    counts = metrics.counts
    commits = (
        sum(n for name, n in counts.items() if name in ("sweep", "progress") or name.startswith("state-")) / SOAK + 1
    )
    alone, bound = journal_alone(home), bare_commit(home)
    print(
        f"\nsoak: {SOAK} sweeps in {seconds:.1f} s = {SOAK / seconds:.1f} a second, {commits:.1f} commits each; ",
        end="",
    )
    print(f"{1e3 * used / SOAK:.2f} ms of the daemon's processor time each")
    print(f"one event kept and said: median {1e3 * (metrics.seconds['publish'].median or 0):.2f} ms, ", end="")
    print(f"99 % {1e3 * (metrics.seconds['publish'].p99 or 0):.2f} ms; ", end="")
    print(f"a sweep kept by the journal alone {1e3 * alone:.2f} ms; ", end="")
    print(f"SQLite's commit of it and one memcpy {1e3 * bound:.2f} ms = at most {1 / bound:.0f} sweeps a second")
    print(f"replayed {counts.get('replayed', 0)} events; memory by tenths: {[round(m, 1) for m in rss]} MB")
    lost, twice = 0, 0
    for reader in readers:
        assert not reader.is_alive()
        assert reader.seqs[-1] >= newest
        lost += len({*range(reader.seqs[0], newest + 1)} - {*reader.seqs})
        twice += len(reader.seqs) - len({*reader.seqs})
        assert reader.seqs == sorted(reader.seqs)
    print(f"two readers: {lost} events lost, {twice} heard twice of {newest}")
    archive = JournalReader(journal_folder(home))
    assert (lost, twice, archive.verify()) == (0, 0, [])
    archive.close()


def a_sweep() -> tuple[SweepEvent, tuple[bytes, ...]]:
    columns, payload = sweep_columns(Sweep(np.linspace(1e6, 6e6, 801), np.exp(1j * np.arange(801))))
    event = SweepEvent(
        run="r",
        time="t",
        measurement="m",
        sample=SampleStep("soak", "disk"),
        instrument=InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True),
        build=BUILD,
        segment=1,
        segments=1,
        started="t",
        settings={},
        columns=columns,
    )
    return event, payload


def test_price_of_the_chain_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep written durably with and without an entry in the chain, in turns."""
    event, payload = a_sweep()
    append, taken = chain._append, dict[str, list[float]](chained=[], plain=[])
    with closing(JournalWriter(tmp_path / "chained")) as chained, closing(JournalWriter(tmp_path / "plain")) as plain:
        for _ in range(max(300, PRICED)):
            for name, journal in (("chained", chained), ("plain", plain)):
                monkeypatch.setattr(chain, "_append", append if name == "chained" else lambda *_: None)
                began = time.perf_counter()
                journal.append(event, payload)
                taken[name].append(time.perf_counter() - began)
    ratio = statistics.median(taken["chained"]) / statistics.median(taken["plain"])
    print(
        f"\na sweep kept with the chain: {spread(taken['chained'])}, {ratio:.2f} times that without: "
        f"{spread(taken['plain'])}"
    )


def journal_alone(home: Path) -> float:
    """Seconds that the journal needs for one sweep, with nobody listening."""
    event, payload = a_sweep()
    journal = JournalWriter(home / "bare")
    began = time.perf_counter()
    for _ in range(300):
        journal.append(event, payload)
    seconds = (time.perf_counter() - began) / 300
    journal.close()
    return seconds


def bare_commit(home: Path) -> float:
    """Seconds that SQLite needs to commit a sweep's bytes as one row durably (WAL, synced), and to copy them."""
    event, payload = a_sweep()
    row = b"".join(encode(event, payload))
    db = sqlite3.connect(home / "bare.sqlite", isolation_level=None)
    db.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; CREATE TABLE t (k INTEGER PRIMARY KEY, d BLOB)")
    began = time.perf_counter()
    for _ in range(300):
        db.execute("INSERT INTO t (d) VALUES (?)", (bytes(bytearray(row)),))
    seconds = (time.perf_counter() - began) / 300
    db.close()
    return seconds


def family(pid: int) -> dict[str, int]:
    """The processes of a daemon by role."""
    found = {"daemon": pid}
    for child in map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()):
        with suppress(OSError):
            line = Path(f"/proc/{child}/cmdline").read_bytes()
            found["fitter" if b"guest" in line else "simulator"] = child
    return found


CLIENT = """
from pathlib import Path
import pzctl
from pzctl.daemon.files.builds.build_file import read_build

build = read_build(Path(pzctl.__file__).parent / "daemon" / "files" / "builds" / "thesis.toml")
with pzctl.connect() as lab:
    while True:
        lab.measure(build, "disk")
"""
"""A client that measures for ever."""


def test_kills(home: Path) -> None:
    """`kill -9` of daemon, fitter, simulator or client at random moments: no announced event is lost."""
    chance = random.Random(0)  # noqa: S311
    killed = {"daemon": 0, "fitter": 0, "simulator": 0, "client": 0}
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    lost = checked = 0
    where = begin(ECHO)
    ear = listening(context, where)
    client = subprocess.Popen([sys.executable, "-c", CLIENT], stderr=subprocess.DEVNULL)
    for _ in range(KILLS):
        heard = overheard(ear, chance.uniform(0.3, 1.5))
        what, victim = chance.choice([*family(where.pid).items(), ("client", client.pid)])
        os.kill(victim, signal.SIGKILL)
        killed[what] += 1
        heard += overheard(ear, 0.2)
        if what == "simulator":  # its simulated instrument does not come back
            with suppress(DaemonError), connect() as lab:
                lab.shutdown()
        if what in ("daemon", "simulator"):
            wait_gone(where.pid)
            heard += overheard(ear, 0.2)
            ear.close()
            where = begin(ECHO)
            ear = listening(context, where)
        if client.poll() is not None or what in ("daemon", "simulator", "client"):
            client.kill()
            client.wait()
            client = subprocess.Popen([sys.executable, "-c", CLIENT], stderr=subprocess.DEVNULL)
        announced = [frames for frames in heard if frames[0] not in (b"welcome.", b"beat.")]
        archive = JournalReader(journal_folder(home))
        assert archive.verify() == []
        for frames in announced:
            seq = msgspec.json.decode(frames[1])["seq"]
            lost += archive.replay(seq, seq, 1) != [frames]
        checked += len(announced)
        archive.close()
        if sum(killed.values()) % 50 == 0:
            print(f"\n{sum(killed.values())} kills: {checked} announced events heard, {lost} lost", flush=True)
    client.kill()
    client.wait()
    ear.close()
    context.term()
    print(f"\nkills: {killed}; {checked} announced events heard, {lost} lost; the journal verified {KILLS} times")
    assert checked
    assert not lost


def overheard(ear: "zmq.Socket[bytes]", seconds: float) -> list[list[bytes]]:
    """The next event, within some seconds."""
    heard: list[list[bytes]] = []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if ear.poll(20):
            heard.append(ear.recv_multipart())
    return heard


def wait_gone(pid: int) -> None:
    """Wait until a process has ended; `start` has a thread that reaps it."""
    deadline = time.monotonic() + 30
    while Path(f"/proc/{pid}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)


def listening(context: "zmq.Context[zmq.Socket[bytes]]", where: Location) -> "zmq.Socket[bytes]":
    """A socket that receives all events from now on."""
    ear = context.socket(zmq.SUB)
    ear.setsockopt(zmq.LINGER, 0)
    ear.setsockopt(zmq.RCVTIMEO, 10_000)
    ear.subscribe(b"")
    unlocked(ear).connect(where.events)
    ear.recv()
    return ear


def cpu_seconds(pid: int) -> float:
    """Seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


ECHO_SERVER = """
import zmq
link = zmq.Context().socket(zmq.ROUTER)
print(link.bind_to_random_port("tcp://127.0.0.1"), flush=True)
while True:
    link.send_multipart(link.recv_multipart())
"""
"""An echo process that is not flooded: if it slows down, the machine is the cause."""


class Questions:
    """Queries a daemon and a plain echo in turns during a flood; records response times and memory."""

    def __init__(self, where: Location) -> None:
        self.quiet = answers_of(where, 200)
        self.ours: list[float] = []
        self.echo: list[float] = []
        self.rss: list[float] = []
        self._where = where

    def ask_while(self, flood: "subprocess.Popen[bytes] | subprocess.Popen[str]") -> None:
        """Query until the flood has ended."""
        server = subprocess.Popen([sys.executable, "-c", ECHO_SERVER], stdout=subprocess.PIPE)
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        link = context.socket(zmq.REQ)
        try:
            assert server.stdout is not None
            link.connect(f"tcp://127.0.0.1:{int(server.stdout.readline())}")
            with connect() as lab:
                while flood.poll() is None:
                    began = time.perf_counter()
                    lab.status()
                    between = time.perf_counter()
                    link.send(b"?")
                    link.recv()
                    self.ours.append(between - began)
                    self.echo.append(time.perf_counter() - between)
                    self.rss.append(rss_MB(self._where.pid))
                    time.sleep(0.02)
        finally:
            server.kill()
            server.communicate()
            link.close()
            context.term()

    def says(self) -> str:
        """The result as text."""
        parts: list[str] = []
        for name, found in (("daemon", self.ours), ("echo that nobody floods", self.echo)):
            ordered = sorted(1e3 * one for one in found)
            late = sum(one > 100 for one in ordered)
            parts.append(
                f"{name}: median {statistics.median(ordered):.1f} ms, 99 % {ordered[int(0.99 * len(ordered))]:.1f} ms, "
                f"99.9 % {ordered[int(0.999 * len(ordered))]:.1f} ms, worst {ordered[-1]:.1f} ms, {late} above 100 ms"
            )
        ratio = statistics.median(self.ours) / statistics.median(self.quiet)
        parts.append(f"{ratio:.1f} times the median of the daemon before the flood, {spread(self.quiet)}")
        return f"{len(self.ours)} questions; " + "; ".join(parts)


def answers_of(where: Location, count: int) -> list[float]:
    """Return how long a daemon takes to answer, in seconds, `count` times."""
    taken: list[float] = []
    with Client(where.events, where.requests, where.key) as lab:
        for _ in range(count):
            began = time.perf_counter()
            lab.status()
            taken.append(time.perf_counter() - began)
    return taken


ROUNDS = 10


def plainly(left_out: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make daemons started from now on run without CURVE, the chain or both."""
    folder = Path(__file__).with_name("plain")
    monkeypatch.setenv("PZCTL_PLAIN", left_out)
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)


def test_price(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cost of CURVE and the hash chain: daemons with and without them answer and measure in turns."""
    ways = {"with both": "", "without the chain": "chain", "without CURVE": "curve", "with neither": "curve,chain"}
    places: dict[str, Location] = {}
    for name, left_out in ways.items():
        monkeypatch.setenv("PZCTL_HOME", str(tmp_path / (left_out or "both")))
        plainly(left_out, monkeypatch)
        places[name] = begin()
    monkeypatch.delenv("PZCTL_PLAIN")
    answers: dict[str, list[float]] = {name: [] for name in ways}
    paces: dict[str, list[float]] = {name: [] for name in ways}
    used: dict[str, float] = dict.fromkeys(ways, 0.0)
    for _ in range(ROUNDS):  # in turns, so that other load on the machine affects all of them
        for name, where in places.items():
            answers[name] += answers_of(where, max(20, PRICED // ROUNDS))
            with Client(where.events, where.requests, where.key) as lab:
                before = cpu_seconds(where.pid)
                seconds, _ = measure_on(lab, where, max(10, PRICED // ROUNDS))
                used[name] += cpu_seconds(where.pid) - before
                paces[name].append(max(10, PRICED // ROUNDS) / seconds)
    for where in places.values():
        with Client(where.events, where.requests, where.key) as lab:
            lab.shutdown()
    print()
    for name in ways:
        pace, answer = statistics.median(paces[name]), statistics.median(answers[name])
        print(
            f"{name}: an answer {spread(answers[name])}, "
            f"{answer / statistics.median(answers['with neither']):.2f} times that with neither; "
            f"{pace:.1f} sweeps a second, {pace / statistics.median(paces['with neither']):.2f} times; "
            f"{used[name] / used['with neither']:.2f} times its processor time"
        )
    archive = JournalReader(journal_folder(tmp_path / "both"))
    assert archive.verify() == []
    archive.close()


@pytest.mark.parametrize("left_out", ["", "curve,chain"])
def test_hostile(home: Path, left_out: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Malicious messages from another process over eight connections; a proper request is sent meanwhile."""
    plainly(left_out, monkeypatch)
    where = begin()
    monkeypatch.delenv("PZCTL_PLAIN")
    before, began, used = rss_MB(where.pid), time.perf_counter(), cpu_seconds(where.pid)
    flood = subprocess.Popen([sys.executable, str(FLOODER), where.requests, str(HOSTILE), "8"])
    asked = Questions(where)
    asked.ask_while(flood)
    seconds, used = time.perf_counter() - began, cpu_seconds(where.pid) - used
    with connect() as lab:
        counts = lab.metrics().counts
    print(f"\nwithout {left_out or 'nothing'}: {HOSTILE} hostile messages in {seconds:.1f} s; ", end="")
    print(f"{counts.get('garbage', 0)} counted as garbage, ", end="")
    print(f"{1e6 * used / HOSTILE:.0f} us of the daemon's processor time each; load {os.getloadavg()[0]:.1f}")
    print(asked.says())
    tenths = [round(asked.rss[k * len(asked.rss) // 10], 1) for k in range(10)]
    print(f"memory {before:.1f} MB before; by tenths {tenths} MB; {rss_MB(where.pid):.1f} MB after")
    assert flood.returncode == 0


@pytest.mark.parametrize("what", sorted(ENDLESS))
def test_without_end(home: Path, what: str) -> None:
    """Endless subscriptions and messages that never end, over four connections that reconnect when cut."""
    where = begin()
    before = rss_MB(where.pid)
    endpoint = where.requests if ENDLESS[what][0] == b"DEALER" else where.events
    command = [sys.executable, str(FLOODER.with_name("raw_flooder.py")), endpoint, what, str(FLOOD_SECONDS)]
    flood = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    asked = Questions(where)
    asked.ask_while(flood)
    MB, cuts = (flood.communicate()[0]).split()
    print(f"\n{what} without end, {FLOOD_SECONDS:g} s: {MB} MB sent, {cuts} times cut off; ", end="")
    print(f"memory {before:.0f} MB before, {max(asked.rss):.0f} MB at most; load {os.getloadavg()[0]:.1f}")
    print(asked.says())
    assert int(cuts)


def spread(seconds: list[float]) -> str:
    ordered = sorted(1e3 * one for one in seconds)
    return f"median {statistics.median(ordered):.2f} ms, 99 % {ordered[int(0.99 * len(ordered))]:.2f} ms"


def test_heard_after(home: Path) -> None:
    """Time from an event's time stamp, before it is stored, until a subscriber in another process has it."""
    begin()
    delays: list[float] = []
    with connect() as lab:
        events = lab.listen(patience=10)
        for _ in range(300):
            lab.begin(BUILD, "disk")
            while not isinstance(event := next(events).event, SweepEvent):
                pass
            delays.append(time.time() - datetime.fromisoformat(event.time).timestamp())
    print(f"\nstamped to heard, by a clock of whole milliseconds: {spread(delays)} of {len(delays)}")


def test_beside_others(home: Path) -> None:
    """Publisher to subscriber, 801 points in one process: plain pyzmq, pyleco through its proxy, this wire."""
    proxy_server = pytest.importorskip("pyleco.coordinators.proxy_server")
    from pyleco.core.data_message import DataMessage

    event, payload = a_sweep()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    pub, sub, to_proxy, from_proxy = (context.socket(kind) for kind in (zmq.PUB, zmq.SUB, zmq.PUB, zmq.SUB))
    port = pub.bind_to_random_port("tcp://127.0.0.1")
    sub.connect(f"tcp://127.0.0.1:{port}")
    proxy = proxy_server.start_proxy()
    to_proxy.connect(f"tcp://127.0.0.1:{proxy_server.port}")
    from_proxy.connect(f"tcp://127.0.0.1:{proxy_server.port - 1}")
    for one in (sub, from_proxy):
        one.subscribe(b"")
    time.sleep(0.5)
    journal = JournalWriter(home / "rival")
    frames = encode(event, payload)
    header = msgspec.json.decode(frames[1])

    def plain() -> object:
        pub.send_multipart(frames)
        return sub.recv_multipart()

    def pyleco() -> object:
        message = DataMessage("sweep", data=header, additional_payload=list(payload))
        to_proxy.send_multipart(message.to_frames())
        found = DataMessage.from_frames(*from_proxy.recv_multipart())
        return found.data, [np.frombuffer(found.payload[1]), np.frombuffer(found.payload[2], dtype="<c16")]

    def ours(said: Callable[[], list[bytes]]) -> object:
        pub.send_multipart(said())
        return decode(sub.recv_multipart()).sweep()

    ways: dict[str, Callable[[], object]] = {
        "plain pyzmq, bytes alone": plain,
        "pyleco, packed and unpacked": pyleco,
        "this wire, packed and unpacked": lambda: ours(lambda: encode(event, payload)),
        "this wire, kept first": lambda: ours(lambda: journal.append(event, payload)[1]),
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(500):  # in turns, so that other load on the machine affects all of them
        for name, way in ways.items():
            began = time.perf_counter()
            way()
            seconds[name].append(time.perf_counter() - began)
    print()
    base = statistics.median(seconds["plain pyzmq, bytes alone"])
    for name, found in seconds.items():
        print(f"{name}: {spread(found)} = {statistics.median(found) / base:.1f} times plain")
    journal.close()
    logging.disable()  # it raises when it is ended
    proxy.destroy(linger=0)
    context.destroy(linger=0)


def test_both_engines(home: Path) -> None:
    """A sweep written durably to a folder and to a PostgreSQL server on this machine, and read again."""
    import postgres

    if postgres.reason_why_not():
        pytest.skip(postgres.reason_why_not())
    event, payload = a_sweep()
    with postgres.running() as server:
        url = server.url
        journals = {"folder": JournalWriter(home / "a"), "PostgreSQL": JournalWriter(home / "b", url, "bench")}
        kept: dict[str, list[float]] = {name: [] for name in journals}
        read: dict[str, list[float]] = {name: [] for name in journals}
        for _ in range(200):
            for name, journal in journals.items():
                began = time.perf_counter()
                journal.append(event, payload)
                kept[name].append(time.perf_counter() - began)
                began = time.perf_counter()
                journal.replay(journal.last_seq, None, 1)
                read[name].append(time.perf_counter() - began)
        print()
        for name, journal in journals.items():
            print(f"{name}: kept {spread(kept[name])}; read {spread(read[name])}")
            journal.close()
