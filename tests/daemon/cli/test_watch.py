"""`pzctl watch` beside a real daemon: piped, in a terminal, and stopped by Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pruned_hole import endpoints, prune_unheard

from pzctl.daemon.client.client import connect
from pzctl.daemon.report.tables.watch_view import line, sparkline
from pzctl.daemon.wire.events import ReceivedEvent, StateEvent
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

PZCTL = Path(sys.executable).with_name("pzctl")


@pytest.mark.parametrize("as_json", [False, True])
def test_every_event_is_one_line(start_daemon, build: Build, tmp_path: Path, as_json: bool) -> None:
    start_daemon("Echo")
    words = '"state": "measured"' if as_json else "S4.a disk: measured, 2 sweep(s)"
    output = tmp_path / "watched.txt"
    with output.open("w") as file:
        watching = subprocess.Popen([PZCTL, "watch", *(["--json"] if as_json else [])], stdout=file)
    try:
        with connect() as lab:
            while words not in output.read_text():  # what is measured before it listens is not shown
                assert watching.poll() is None
                lab.measure(build, "disk")
        watching.send_signal(signal.SIGINT)
        assert watching.wait(60) == 130
    finally:
        watching.kill()
        watching.wait()
    read = output.read_text().splitlines()
    if as_json:
        assert all(json.loads(text)["kind"] for text in read)
    else:
        assert not any("\x1b" in text for text in read), "no colour where it is piped"


@pytest.mark.parametrize("as_json", [False, True])
def test_what_was_missed_and_pruned_is_one_sentence(
    start_daemon, build: Build, tmp_path: Path, as_json: bool, wait_until
) -> None:
    where, output = start_daemon("Echo", **endpoints()), tmp_path / "watched.txt"
    with output.open("w") as file:
        watching = subprocess.Popen([PZCTL, "watch", *(["--json"] if as_json else [])], stdout=file)
    try:
        with connect() as lab:
            while "measured" not in output.read_text():
                lab.measure(build, "disk")
        last = prune_unheard(start_daemon, where, tmp_path, build)
        begun = '"state": "started"' if as_json else "daemon: started"
        wait_until(lambda: begun in output.read_text())
    finally:
        watching.kill()
        watching.wait()
    (says,) = [text for text in output.read_text().splitlines() if "pruned on" in text]
    if as_json:
        hole = json.loads(says)
        assert (hole["kind"], hole["last"]) == ("missing", last)
    else:
        assert f"to {last} are no longer in the journal: pruned on" in says


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminal")
def test_in_a_terminal_the_curve_is_seen(start_daemon, build: Build) -> None:
    import pty

    start_daemon("Echo")
    ours, theirs = pty.openpty()
    watching = subprocess.Popen([PZCTL, "watch"], stdout=theirs, env={**os.environ, "COLUMNS": "100", "TERM": "xterm"})
    os.close(theirs)
    try:
        shown = ""
        with connect() as lab:
            while "|Z| 1 to 6 MHz" not in shown:
                lab.measure(build, "disk")
                shown += os.read(ours, 1 << 16).decode(errors="replace")
        assert "S4.a disk" in shown
    finally:
        watching.kill()
        watching.wait()
        os.close(ours)


def test_without_a_daemon_it_says_so(tmp_path: Path) -> None:
    environment = {**os.environ, "PZCTL_HOME": str(tmp_path)}
    done = subprocess.run([PZCTL, "watch"], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no daemon runs" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_command_to_the_bench_is_told_in_words() -> None:
    event = StateEvent(state="bench", says='{"command":"step","name":"ml1"}')
    assert line(ReceivedEvent(event, {})) == "daemon: bench, step, name ml1"


def test_the_sparkline_keeps_narrow_peaks() -> None:
    z = np.full(1000, 10.0 + 0j)
    z[500] = 1000.0
    bars = sparkline(Sweep(np.linspace(1e6, 2e6, 1000), z), 20)
    assert bars == "▁" * 10 + "█" + "▁" * 9
