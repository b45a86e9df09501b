"""Measured cost and throughput of the daemon; run with -s to read the figures."""

import os
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import zmq
from keyed import unlocked

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.server.launch import start
from pzctl.daemon.wire.events import FitEvent, InstrumentInfo, SampleStep, SweepEvent, decode, encode, sweep_columns
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import Segment, SweepPlan

AIR = LoadSpec("air", Quantity(413.0))
PLAN = SweepPlan((Segment(1e6, 6e6, 801),))
LAYERS = (LayerSpec("disk", "piezo", {"thickness": Quantity(5.12e-4, u=1e-6)}),)
BUILD = Build("bench", Quantity(2e-4), LAYERS, AIR, AIR, (Step("disk", ("disk",)),), plan=PLAN)
ECHO = "guest_examples:Echo"


@pytest.fixture
def begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Location]]:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1] / "support"))
    yield lambda *fitters: start(DaemonOptions(fitters=fitters, simulator={"time_scale": 0}))
    with connect() as lab:
        lab.shutdown()


def sweep_event() -> tuple[SweepEvent, tuple[bytes, ...]]:
    columns, payload = sweep_columns(Sweep(np.linspace(1e6, 6e6, 801), np.exp(1j * np.arange(801))))
    event = SweepEvent(
        run="r",
        time="t",
        measurement="m",
        sample=SampleStep("bench", "disk"),
        instrument=InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True),
        build=BUILD,
        segment=1,
        segments=1,
        started="t",
        settings={},
        columns=columns,
    )
    return event, payload


def seconds_each(act: Callable[[], object], times: int) -> float:
    began = time.perf_counter()
    for _ in range(times):
        act()
    return (time.perf_counter() - began) / times


def rss_MB(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def test_message_and_journal(tmp_path: Path) -> None:
    """One 801-point sweep: encoded and decoded, and written durably, compared with a bare write to the disk."""
    event, payload = sweep_event()
    message = seconds_each(lambda: decode(encode(event, payload)).sweep(), 2000)
    journal = JournalWriter(tmp_path / "journal")
    record = seconds_each(lambda: journal.append(event, payload), 200)
    journal.close()
    bare_file = tmp_path / "bare"

    def bare() -> None:
        with bare_file.open("wb") as file:
            file.write(b"".join(payload))
            os.fsync(file.fileno())

    floor = seconds_each(bare, 200)
    print(f"\nsweep of 801 points: encode + decode {1e6 * message:.0f} us")
    print(f"journalled (array, row, both synced): {1e3 * record:.2f} ms = {record / floor:.1f} bare synced writes")
    assert message < record


def test_sweep_to_fit(begin: Callable[..., Location]) -> None:
    """Time from the sweep event to the fit event of a fitter that does nothing: the overhead of daemon and worker."""
    begin(ECHO)
    delays: list[float] = []
    with connect() as lab:
        lab.wait_fit(ECHO, lab.measure(BUILD, "disk").id)
        events = lab.listen(patience=10)
        for _ in range(100):
            lab.begin(BUILD, "disk")
            while not isinstance(next(events).event, SweepEvent):
                pass
            heard = time.perf_counter()
            while not isinstance(next(events).event, FitEvent):
                pass
            delays.append(time.perf_counter() - heard)
    ordered = sorted(1e3 * delay for delay in delays)
    print(f"\nsweep to fit: median {statistics.median(ordered):.1f} ms, 99 % {ordered[98]:.1f} ms of 100")
    assert len(delays) == 100


def test_soak(begin: Callable[..., Location]) -> None:
    """A thousand sweeps through daemon, journal and two subscribers, one of which never reads."""
    where = begin()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    sleeper = context.socket(zmq.SUB)
    sleeper.setsockopt(zmq.RCVHWM, 1)
    sleeper.subscribe(b"")
    unlocked(sleeper).connect(where.events)
    with connect() as lab:
        events = lab.listen(patience=10)
        seqs: list[int] = []
        rss: list[float] = []
        began = time.perf_counter()
        for k in range(1000):
            lab.begin(BUILD, "disk")
            while not isinstance(event := next(events).event, SweepEvent):
                seqs.append(event.seq)
            seqs.append(event.seq)
            if k % 250 == 249:
                rss.append(rss_MB(where.pid))
        seconds = time.perf_counter() - began
    sleeper.close()
    context.term()
    print(f"\n1000 sweeps of 801 points in {seconds:.1f} s; daemon's memory by quarters: {[round(m) for m in rss]} MB")
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs))), "none lost, none twice"
