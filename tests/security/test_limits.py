"""A single request or a killed daemon cannot exhaust the memory, block the analyzer, or leave a bias on."""

import socket
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run_here

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.analyzer_options import AnalyzerOptions
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, BuildError, parse_build
from pzctl.daemon.journal import journal_reader
from pzctl.daemon.server.analyzers.plan_limits import MOST_POINTS, MOST_SEGMENTS
from pzctl.daemon.wire.events import SweepEvent, decode
from pzctl.daemon.wire.frames import MOST_FRAMES, to_json
from pzctl.daemon.wire.result_messages import LARGEST_CURVES, curve_columns
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.fitters.diagnosis.design.candidate_sweeps import experiments
from pzctl.fitters.diagnosis.design.experiment_design import bearable
from pzctl.fitters.interface import Curve
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import LevelLimits, Segment, SweepPlan
from pzctl.sim.server import SimOptions, running

PZCTL = Path(sys.executable).with_name("pzctl")


BEYOND_THE_BENCH: tuple[tuple[dict[str, object], str], ...] = (
    ({"segments": (Segment(1e6, 2e6, 1_000_000_000),)}, "1000000000 points; at most 200000 are allowed"),
    ({"segments": (Segment(1e6, 2e6, 3),) * 501}, "501 segments; at most 500 are allowed"),
    ({"sweep_average": 256, "point_average": 256, "segments": (Segment(1e6, 2e6, 801),) * 50}, "hours; at most 24"),
    ({"bias_V": 6.0}, "bias is 6 V; this bench allows 5 V"),
    ({"bias_V": -6.0}, "bias is -6 V; this bench allows 5 V"),
    ({"oscillator_V": 0.9}, r"oscillator is 0.9 V; this bench allows 0.6 V"),
    ({"bias_V": 41.0}, "bias is 41 V; this bench allows 5 V"),
)
BEYOND_THE_SAMPLE: tuple[tuple[dict[str, object], str], ...] = (
    ({"bias_V": 3.0}, "bias is 3 V; sample 'S4.a' allows 2 V"),
    ({"bias_V": -3.0}, "bias is -3 V; sample 'S4.a' allows 2 V"),
    ({"bias_V": 6.0}, "bias is 6 V; this bench allows 5 V"),
    ({"oscillator_V": 0.5}, "oscillator is 0.5 V; sample 'S4.a' allows 0.2 V"),
    ({"oscillator_A": 0.001}, "oscillator is 0.001 A, whatever voltage that takes; sample 'S4.a' allows 0.2 V"),
)


def test_a_plan_beyond_the_limits_is_refused_before_it_is_accepted(
    start_daemon: Callable[..., object], build: Build
) -> None:
    assert build.plan is not None
    start_daemon(max_bias_V=5.0, max_oscillator_V=0.6)
    with connect() as lab:
        for changes, says in BEYOND_THE_BENCH:
            began = time.monotonic()
            with pytest.raises(DaemonError, match=says):
                lab.begin(build, "disk", replace(build.plan, **changes))
            assert time.monotonic() - began < 5
            assert lab.samples() == ()
        assert lab.measure(build, "disk").sweeps


def test_a_plan_beyond_what_the_sample_stands_is_refused_before_it_is_accepted(
    start_daemon: Callable[..., object], build: Build
) -> None:
    start_daemon(max_bias_V=5.0)
    tender = replace(build, limits=LevelLimits(max_bias_V=2.0, max_oscillator_V=0.2))
    gentle = SweepPlan((Segment(1e6, 2e6, 3),), oscillator_V=0.2, bias_V=2.0)
    with connect() as lab:
        for changes, says in BEYOND_THE_SAMPLE:
            with pytest.raises(DaemonError, match=says):
                lab.begin(tender, "disk", replace(gentle, **changes))
            assert lab.samples() == ()
        assert lab.measure(tender, "disk", gentle).sweeps
        assert lab.measure(build, "disk", replace(gentle, oscillator_V=0.5)).sweeps, "another sample allows more"


def test_nobody_begins_with_a_build_whose_sweep_is_too_much_for_its_sample(tmp_path: Path) -> None:
    """The file itself is refused, so that neither `measure` nor the page glues before the refusal."""
    path = tmp_path / "S4.toml"
    path.write_text(THESIS_BUILD.read_text() + "\n[sample]\nmax_bias_V = 10\nmax_oscillator_V = 0.1\n")
    for command in (["measure"], ["page", "--port", "1"], ["daemon", "--page"]):
        done = run_here(tmp_path / "home", *command, "--build", path)
        assert done.returncode == 2
        says = "S4.toml: sweep plan: oscillator is 0.5 V; [sample] allows 0.1 V (max_oscillator_V)"
        assert done.stderr.splitlines()[-1].endswith(says)
    assert not list(tmp_path.glob("home/**/journal*")), "nothing was started"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("max_bias_V = -1", "max_bias_V is -1; 0 V or more is needed"),
        ('max_bias_V = "5"', "a number is needed"),
        ("max_oscillator_mV = 5", "max_oscillator_mV is not a known key"),
    ],
)
def test_an_invalid_limit_is_refused(line: str, says: str) -> None:
    with pytest.raises(BuildError, match=says):
        parse_build(f"{THESIS_BUILD.read_text()}\n[sample]\n{line}\n")


def test_a_measurement_can_be_cancelled_in_every_state(
    start_daemon: Callable[..., object], build: Build, wait_until: Callable[..., None]
) -> None:
    """The longest accepted plan at the instrument's real speed: nobody has to wait for its end."""
    start_daemon(time_scale=1.0)
    long = SweepPlan(tuple(Segment(1e6, 6e6, 801) for _ in range(200)))
    with connect() as lab:
        runs, waits = lab.begin(build, "disk", long), lab.begin(build, "disk", long)
        wait_until(lambda: lab.status().measuring == runs)
        lab.cancel(waits)
        states = [one.event.state for one in lab.replay(1) if getattr(one.event, "measurement", None) == waits]
        assert (states, lab.status().queue) == (["queued", "cancelling", "cancelled"], ()), "at once, not after `runs`"
        with pytest.raises(DaemonError, match="neither runs nor waits"):
            lab.cancel(waits)
        lab.cancel(runs)
        wait_until(lambda: lab.status().measuring is None and not lab.status().queue)
        assert [one.state for one in lab.samples()[0].measurements] == ["cancelled", "cancelled"]
        with pytest.raises(DaemonError, match="neither runs nor waits"):
            lab.cancel(runs)


def test_a_long_sweep_that_is_accepted_can_be_read(start_daemon: Callable[..., object], build: Build) -> None:
    """Its header has two numbers for each point, more than 1 MiB in all."""
    start_daemon()
    with connect() as lab:
        measured = lab.measure(build, "disk", SweepPlan((Segment(1e6, 6e6, 90_000),)))
        (heard,) = lab.sweeps(measured.id)
        assert isinstance(heard.event, SweepEvent)
        assert len(to_json(heard.event)) > 1 << 20
        again = [one.sweep() for one in lab.replay(1) if isinstance(one.event, SweepEvent)]
    assert [one.frequency.size for one in (*measured.sweeps, heard.sweep(), *again)] == [90_000] * 3


def test_a_fit_of_many_sweeps_is_submitted(start_daemon: Callable[..., object], build: Build) -> None:
    """Each has four columns; as many as a plan may have take half a minute."""
    start_daemon("Echo")
    segments = tuple(Segment(1e6 + 1e4 * k, 1.1e6 + 1e4 * k, 3) for k in range(120))
    with connect() as lab:
        measured = lab.measure(build, "disk", SweepPlan(segments))
        result = lab.wait_fit("guest_examples:Echo", measured.id)
    assert len(measured.sweeps) == len(result.curves) == len(segments)
    assert 3 * 5 * MOST_SEGMENTS < MOST_FRAMES, "three steps, with `explained`"
    assert np.array_equal(result.curves[-1].fitted, 3 * measured.sweeps[-1].impedance)


def test_curves_beyond_one_message_keep_fewer_points() -> None:
    sweep = Sweep(np.linspace(1e6, 2e6, MOST_POINTS), np.ones(MOST_POINTS) + 1j)
    curve = Curve("disk", sweep.frequency, sweep.impedance, sweep.impedance, sweep.impedance)
    assert curve_columns([curve])[0][0].shape == (MOST_POINTS,)
    for curves in ([curve] * 2, [replace(curve, explained=sweep.impedance)] * 3):
        columns, raw = curve_columns(curves)
        assert sum(map(len, raw)) <= LARGEST_CURVES + 1000
        assert len({column.shape for column in columns}) == 1, "all columns of a curve keep the same points"


def test_no_experiment_is_proposed_that_the_sample_does_not_stand() -> None:
    sweep = Sweep(np.linspace(1e6, 2e6, 11), np.full(11, 50 - 10j), {"oscillator_V": 0.2})
    plans = [one.plan for one in experiments([sweep], CAPABILITIES)]
    limits = LevelLimits(max_oscillator_V=0.2)
    assert not all(map(limits.allows, plans)), "a higher level is one of them"
    build = replace(parse_build(THESIS_BUILD.read_text()), plan=None, limits=limits)
    assert all(limits.allows(one.plan) for one in bearable(experiments([sweep], CAPABILITIES), build))


def test_a_bias_that_a_killed_daemon_left_on_goes_off_when_the_next_one_connects(
    start_daemon: Callable[..., object],
) -> None:
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0)) as analyzer:
        resource = f"TCPIP0::127.0.0.1::{analyzer.port}::SOCKET"
        assert asked(analyzer.port, b"DCMOD CVOLT;DCRNG M10;DCV 5;DCO ON;DCO?") == b"1"
        start_daemon(resource=resource)
        assert asked(analyzer.port, b"DCO?") == b"0"


def test_an_analyzer_that_does_not_answer_leaves_no_bias_on_at_another(start_daemon: Callable[..., object]) -> None:
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0)) as analyzer:
        asked(analyzer.port, b"DCMOD CVOLT;DCRNG M10;DCV 5;DCO ON;DCO?")
        two = {
            "away": AnalyzerOptions("TCPIP0::127.0.0.1::1::SOCKET"),
            "here": AnalyzerOptions(f"TCPIP0::127.0.0.1::{analyzer.port}::SOCKET"),
        }
        with pytest.raises(DaemonError, match=r"away: .*127\.0\.0\.1"):
            start_daemon(analyzers=two)
        assert asked(analyzer.port, b"DCO?") == b"0"


def asked(port: int, line: bytes) -> bytes:
    """Return the analyzer's answer to one line, sent over a second connection to its port."""
    with socket.create_connection(("127.0.0.1", port), timeout=30) as panel:
        panel.sendall(line + b"\n")
        return panel.recv(100).strip()


@pytest.mark.parametrize("token", ["", "short"])
def test_an_empty_or_short_token_opens_the_page_to_nobody(tmp_path: Path, token: str) -> None:
    done = run_here(tmp_path, "page", "--token", token, "--host", "0.0.0.0")  # noqa: S104 - it must not listen
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
