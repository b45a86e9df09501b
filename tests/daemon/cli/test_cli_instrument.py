"""`pzctl compensate` and `pzctl screenshot` against a simulated 4294A whose jig adds an impedance."""

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pzctl.drivers import open_analyzer
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions, Simulator, running

PZCTL = Path(sys.executable).with_name("pzctl")
PLAN = SweepPlan((Segment(1e6, 8e6, 51),))


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, jig="clips", noise=False)) as simulator:
        yield simulator


Start = Callable[..., "subprocess.Popen[bytes]"]


def bench(sim: Simulator, **command: Any) -> None:
    with socket.create_connection(("127.0.0.1", sim.bench_port), 5) as line:
        line.sendall(json.dumps(command).encode() + b"\n")
        assert json.loads(line.makefile().readline())["ok"]


@pytest.fixture
def start(start_program: Start) -> Start:
    """Return a function that starts a command in a folder, which is also its data folder."""

    def begin(home: Path, *words: object) -> "subprocess.Popen[bytes]":
        return start_program(
            [PZCTL, *map(str, words)],
            env={**os.environ, "PZCTL_HOME": str(home)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=home,
        )

    return begin


def end(process: "subprocess.Popen[bytes]", status: int = 0) -> str:
    out, err = process.communicate(timeout=120)
    text = err.decode()
    assert process.returncode == status, text
    assert not out.strip()
    return text


def told(process: "subprocess.Popen[bytes]") -> dict[str, Any]:
    """The JSON that a command with --json prints; it prints nothing else."""
    out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (0, b"")
    return json.loads(out)


def read_until(process: "subprocess.Popen[bytes]", words: bytes) -> None:
    """Read the command's output until it contains `words`."""
    heard = b""
    while words not in heard:
        assert process.stderr is not None
        piece = os.read(process.stderr.fileno(), 4096)
        assert piece, heard
        heard += piece


def enter(process: "subprocess.Popen[bytes]") -> None:
    assert process.stdin is not None
    process.stdin.write(b"\n")
    process.stdin.flush()


def error_of(sim: Simulator) -> float:
    """Relative error of a sweep of the device: the jig's inductance shows at 8 MHz."""
    analyzer = open_analyzer(sim.resource)
    (sweep,) = analyzer.measure(PLAN)
    analyzer.close()
    true = sim.instrument.sweeper.bench.sample.stack("disk").impedance(sweep.frequency)
    return float(np.max(np.abs(sweep.impedance / true - 1)))


def test_a_guided_compensation_removes_the_jig_and_can_be_applied_later(
    sim: Simulator, tmp_path: Path, start: Start
) -> None:
    assert error_of(sim) > 0.1
    words = ("compensate", "clips.json", "--resource", sim.resource)
    guided = start(tmp_path, *words, "--fixture", "clips-2")
    for standard, asked in (("open", b"Leave the fixture open"), ("short", b"Short-circuit the fixture")):
        read_until(guided, asked)
        bench(sim, command="connect", what=standard)
        enter(guided)
    assert "clips.json: open, short, taken " in end(guided)
    (record,) = json.loads((tmp_path / "compensation.json").read_bytes()).values()
    assert (record["fixture"], record["standards"]) == ("clips-2", ["open", "short"])
    bench(sim, command="connect", what="device")
    compensated = error_of(sim)
    assert compensated < 1e-3
    analyzer = socket.create_connection(("127.0.0.1", sim.port), 5)
    with analyzer, analyzer.makefile("r") as replies:
        analyzer.sendall(b"COMSTA OFF;COMSTB OFF;COMSTB?\n")
        assert replies.readline().strip() == "0"
    assert error_of(sim) > 0.1
    given_back = told(start(tmp_path, *words, "--apply", "--json"))
    assert (given_back["standards"], given_back["measured"]) == (["open", "short"], False)
    assert (given_back["fixture"], given_back["taken"]) == ("clips-2", record["taken"])
    assert error_of(sim) == pytest.approx(compensated, abs=1e-6), "to the seven digits of the arrays"


def test_a_standard_that_is_none_is_refused(sim: Simulator, tmp_path: Path, start: Start) -> None:
    guided = start(tmp_path, "compensate", "x.json", "--resource", sim.resource, "--standard", "short")
    read_until(guided, b"Short-circuit")
    bench(sim, command="connect", what="open")
    enter(guided)
    assert "short compensation: " in end(guided, 2)
    assert not (tmp_path / "x.json").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--standard", "thru"), "--standard thru: there are open, short, load"),
        (("--adapter", "7mm"), "--adapter 7mm: there are OFF, M1, M2, APC7, PROBE"),
        (("--apply", "--standard", "open"), "--apply: the file gives standards, adapter and fixture"),
        (("--apply",), "x.json: the compensation cannot be read: No such file"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    sim: Simulator, tmp_path: Path, start: Start, words: tuple[str, ...], says: str
) -> None:
    assert says in end(start(tmp_path, "compensate", "x.json", "--resource", sim.resource, *words), 2)


def test_screen_and_sweep_are_fetched_as_files(sim: Simulator, tmp_path: Path, start: Start) -> None:
    for name, begins in (("s.tif", (b"II*", b"MM\0*")), ("s.txt", (b"4294A REV",)), ("s.s1p", (b"!", b"#"))):
        assert f"{name}: " in end(start(tmp_path, "screenshot", name, "--resource", sim.resource))
        assert (tmp_path / name).read_bytes().startswith(begins), name
    seen = told(start(tmp_path, "screenshot", "t.tif", "--resource", sim.resource, "--json"))
    assert seen == {"file": "t.tif", "kind": "screen", "bytes": (tmp_path / "t.tif").stat().st_size}
    (tmp_path / "folder.tif").mkdir()
    assert "folder.tif: cannot be written" in end(
        start(tmp_path, "screenshot", "folder.tif", "--resource", sim.resource), 2
    )
    refused = end(start(tmp_path, "screenshot", "s.png", "--resource", sim.resource), 2)
    assert "s.png: the name ends with '.png'; allowed are .tif, .txt, .dat, .s1p" in refused


def test_the_instrument_is_the_flags_else_the_environments_else_the_files(
    sim: Simulator, tmp_path: Path, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "no instrument is named: give --resource" in end(start(tmp_path, "screenshot", "s.tif"), 2)
    (tmp_path / "config.toml").write_text('resource = "nobody.invalid:5025"\n')
    assert "nobody.invalid" in end(start(tmp_path, "screenshot", "s.tif"), 2)
    measure = start(tmp_path, "measure", "--step", "disk", "--json")
    assert "no daemon runs: starting one for nobody.invalid:5025" in end(measure, 2)
    monkeypatch.setenv("PZCTL_RESOURCE", "other.invalid:5025")
    assert "other.invalid" in end(start(tmp_path, "screenshot", "s.tif"), 2)
    assert "s.tif: " in end(start(tmp_path, "screenshot", "s.tif", "--resource", sim.resource))
