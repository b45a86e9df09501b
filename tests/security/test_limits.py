"""What one request, or what a killed daemon left, must not do: fill the memory, keep the analyzer, leave a bias on."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.journal import journal_reader
from pzctl.daemon.wire.events import decode
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment
from pzctl.sim.server import SimOptions, running

PZCTL = Path(sys.executable).with_name("pzctl")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"segments": (Segment(1e6, 2e6, 1_000_000_000),)}, "1000000000 points; at most 200000 are allowed"),
        ({"segments": (Segment(1e6, 2e6, 3),) * 501}, "501 segments; at most 500 are allowed"),
        ({"sweep_average": 256, "point_average": 256, "segments": (Segment(1e6, 2e6, 801),) * 50}, "hours; at most 24"),
        ({"bias_V": 6.0}, "bias is 6 V; this bench allows 5 V"),
        ({"bias_V": -6.0}, "bias is -6 V; this bench allows 5 V"),
        ({"oscillator_V": 0.9}, r"oscillator is 0.9 V; this bench allows 0.6 V"),
        ({"bias_V": 41.0}, "bias is 41 V; this bench allows 5 V"),
    ],
)
def test_a_plan_beyond_the_limits_is_refused_before_it_is_accepted(
    start_daemon: Callable[..., object], build: Build, changes: dict[str, object], says: str
) -> None:
    assert build.plan is not None
    start_daemon(max_bias_V=5.0, max_oscillator_V=0.6)
    with connect() as lab:
        began = time.monotonic()
        with pytest.raises(DaemonError, match=says):
            lab.begin(build, "disk", replace(build.plan, **changes))
        assert time.monotonic() - began < 5
        assert lab.samples() == ()
        assert lab.measure(build, "disk").sweeps


def test_a_bias_that_a_killed_daemon_left_on_goes_off_when_the_next_one_connects(
    start_daemon: Callable[..., object],
) -> None:
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0)) as analyzer:
        resource = f"TCPIP0::127.0.0.1::{analyzer.port}::SOCKET"
        assert asked(analyzer.port, b"DCMOD CVOLT;DCRNG M10;DCV 5;DCO ON;DCO?") == b"1"
        start_daemon(resource=resource)
        assert asked(analyzer.port, b"DCO?") == b"0"


def asked(port: int, line: bytes) -> bytes:
    """Return what the analyzer answers to one line, as whoever else has its port could ask it."""
    with socket.create_connection(("127.0.0.1", port), timeout=30) as panel:
        panel.sendall(line + b"\n")
        return panel.recv(100).strip()


@pytest.mark.parametrize("token", ["", "short"])
def test_an_empty_or_short_token_opens_the_page_to_nobody(tmp_path: Path, token: str) -> None:
    done = subprocess.run(
        [PZCTL, "page", "--token", token, "--host", "0.0.0.0"],  # noqa: S104 - it must not come to listening
        env={**os.environ, "PZCTL_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert "at least 16 characters are needed" in done.stderr


def test_a_replay_comes_in_answers_of_bounded_size(
    start_daemon: Callable[..., object], build: Build, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    start_daemon()
    with connect() as lab:
        for _ in range(3):
            lab.measure(build, "disk")
        whole = list(lab.replay(1))
    monkeypatch.setattr(journal_reader, "MOST_REPLAYED", 1000)
    journal = journal_reader.JournalReader(tmp_path / "journal")
    events, since = [], 1
    while found := journal.replay(since, None, 1000):
        assert sum(len(frame) for event in found[:-1] for frame in event) <= 1000
        events += found
        since += len(found)
    journal.close()
    assert [decode(event).event for event in events] == [one.event for one in whole]
