"""The second analyzer with its simulator: it is found, measures, compensates, and is restored."""

import socket
import tomllib
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from pzctl.drivers import capabilities_of, open_analyzer
from pzctl.drivers.base.analyzer import Analyzer, Cancelled, InstrumentError
from pzctl.models.sweep_plan import PlanError, Segment, SweepPlan
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimOptions, Simulator, running

ROOT = Path(__file__).parents[3]
PLAN = SweepPlan((Segment(1e6, 6e6, 301),))


@pytest.fixture
def registered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The entry points of this source tree, whatever is installed."""
    points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["pzctl.analyzers"]
    info = tmp_path / "pzctl_source-0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: pzctl-source\nVersion: 0\n")
    lines = "".join(f"{name} = {value}\n" for name, value in points.items())
    (info / "entry_points.txt").write_text("[pzctl.analyzers]\n" + lines)
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with running(SimOptions(model="E4990A", port=0, bench_port=0, time_scale=0, noise=False, jig="clips")) as simulator:
        yield simulator


@pytest.fixture
def analyzer(sim: Simulator, registered: None) -> Iterator[Analyzer]:
    with closing(open_analyzer(sim.resource)) as opened:
        yield opened


def say(sim: Simulator, message: str) -> str:
    with socket.create_connection(("127.0.0.1", sim.port), 5) as line, line.makefile("r") as answers:
        line.sendall(message.encode() + b"\n")
        return answers.readline().strip()


def off(sim: Simulator, analyzer: Analyzer) -> float:
    (sweep,) = analyzer.measure(PLAN)
    return float(
        np.abs(sweep.impedance / sim.instrument.bench.sample.stack("disk").impedance(sweep.frequency) - 1).max()
    )


def test_it_is_found_by_its_identification(sim: Simulator, analyzer: Analyzer) -> None:
    who = analyzer.identify()
    assert (who.model, who.serial) == ("E4990A", "MY43202956")
    can = capabilities_of("Agilent Technologies,E4990A,MY54100800,A.02.12")
    assert (can.model, can.frequency_Hz, can.points_per_sweep) == ("E4990A", (20.0, 120e6), 1601)
    accuracy = can.accuracy(PLAN, np.array([1e5]), np.array([100 + 0j]))
    assert accuracy == pytest.approx(0.0008, rel=0.05), "its basic accuracy"


def test_a_plan_is_measured_and_the_settings_are_restored(sim: Simulator, analyzer: Analyzer) -> None:
    before = ":SENS1:FREQ:STAR 2E6;:SENS1:FREQ:STOP 3E6;:SENS1:SWE:POIN 55;:SOUR1:VOLT 0.1;:CALC1:PAR1:DEF CP;"
    say(sim, before + ":SENS1:AVER:COUN 7;:TRIG:SOUR INT;:INIT1:CONT ON;:SOUR:BIAS:STAT ON;*OPC?")
    (sweep,) = analyzer.measure(SweepPlan((Segment(1e6, 6e6, 1601, "log"),), bias_V=3, bandwidth=2, direction="down"))
    jig = sim.instrument.bench.jig
    device = sim.instrument.bench.sample.stack("disk").impedance(sweep.frequency)
    np.testing.assert_allclose(sweep.impedance, jig.through(sweep.frequency, 1 / device), rtol=1e-5)
    assert (sweep.settings["bias_V"], sweep.settings["bandwidth"], sweep.settings["direction"]) == (3, 2, "down")
    asked = {":SENS1:FREQ:STAR?": 2e6, ":SENS1:FREQ:STOP?": 3e6, ":SENS1:SWE:POIN?": 55, ":SOUR1:VOLT?": 0.1}
    assert {q: float(say(sim, q)) for q in asked} == asked
    assert [say(sim, q) for q in (":CALC1:PAR1:DEF?", ":TRIG:SOUR?", ":INIT1:CONT?", ":SYST:ERR?")] == [
        *("CP", "INT", "1", '+0,"No error"'),
    ]
    assert say(sim, ":SOUR:BIAS:STAT?") == "0", "a bias is not switched on again"


def test_joined_segments_are_one_sweep(analyzer: Analyzer) -> None:
    segments = (Segment(1e6, 2e6, 101), Segment(3e6, 5e6, 1500))
    (sweep,) = analyzer.measure(SweepPlan(segments, joined=True, sweep_average=3))
    assert sweep.frequency.size == 1601
    assert [s["points"] for s in sweep.settings["segments"]] == [101, 1500]
    assert sweep.settings["sweep_average"] == 3


def test_a_compensation_takes_the_jig_away_and_is_given_back(sim: Simulator, analyzer: Analyzer) -> None:
    assert off(sim, analyzer) > 0.1
    contents = iter(("open", "short", "load"))

    def put_in(_: str) -> None:
        bench_command("127.0.0.1", sim.bench_port, command="connect", what=next(contents))

    taken = analyzer.compensate(("open", "short", "load"), put_in)
    bench_command("127.0.0.1", sim.bench_port, command="connect", what="device")
    assert abs(taken.arrays["open"][0]) < 1e-6, "in siemens"
    assert off(sim, analyzer) < 1e-3
    say(sim, "*RST;*OPC?")
    sim.instrument.compensation.drop()
    assert off(sim, analyzer) > 0.1
    analyzer.restore(taken)
    assert off(sim, analyzer) < 1e-3
    (sweep,) = analyzer.measure(PLAN)
    assert sweep.settings["compensation"] == ["open", "short", "load"]
    with pytest.raises(InstrumentError, match=r"open compensation: .* S was measured"):
        analyzer.compensate(
            ("open",), lambda _: bench_command("127.0.0.1", sim.bench_port, command="connect", what="short")
        )


@pytest.mark.parametrize(
    ("plan", "says"),
    [
        (SweepPlan((Segment(10, 6e6),)), "start is 10 Hz; the E4990A can do 20 to 120000000 Hz"),
        (SweepPlan((Segment(1e6, 6e6, 1602),)), "has 1602 points; an E4990A sweeps at most 1601"),
        (SweepPlan((Segment(1e6, 6e6),), oscillator_A=1e-3), "can only be set in volts"),
        (SweepPlan((Segment(1e6, 6e6),), point_delay_s=1), "point delay is 1 s"),
        (
            SweepPlan((Segment(1e6, 2e6, 9, "log"), Segment(3e6, 4e6, 9)), joined=True),
            "a joined segment is logarithmic",
        ),
        (SweepPlan((Segment(1e6, 2e6, 801), Segment(3e6, 4e6, 801)), joined=True), "have 1602 points"),
    ],
)
def test_a_plan_beyond_it_is_refused_before_anything_is_sent(analyzer: Analyzer, plan: SweepPlan, says: str) -> None:
    with pytest.raises(PlanError) as caught:
        analyzer.measure(plan)
    assert says in str(caught.value)


def test_a_cancelled_sweep_leaves_the_bias_off_and_the_settings_as_found(registered: None) -> None:
    with running(SimOptions(model="E4990A", port=0, bench_port=0, time_scale=0.5)) as slow:
        with closing(open_analyzer(slow.resource)) as analyzer:
            seen = []
            with pytest.raises(Cancelled):
                analyzer.measure(SweepPlan((Segment(1e6, 6e6, 1001),), bias_V=1), seen.append, lambda: len(seen) > 3)
        assert (say(slow, ":SOUR:BIAS:STAT?"), say(slow, ":SENS1:SWE:POIN?"), say(slow, ":STAT:OPER:COND?")) == (
            *("0", "+201", "+0"),
        )


def overrule(analyzer: Analyzer, monkeypatch: pytest.MonkeyPatch, start: str, answer: str) -> None:
    """Let the instrument carry out every message, and replace the answers to those that begin with `start`."""
    ask = analyzer._link.ask
    monkeypatch.setattr(analyzer._link, "ask", lambda m: (ask(m), answer)[m.startswith(start)])


def test_the_bias_is_off_after_an_error_whatever_else_cannot_be_restored(
    sim: Simulator, analyzer: Analyzer, monkeypatch: pytest.MonkeyPatch
) -> None:
    overrule(analyzer, monkeypatch, ":INIT1:CONT OFF", "1")
    with pytest.raises(Cancelled, match=r"was cancelled .* Besides: .*continuous initiation .* reads back ON"):
        analyzer.measure(SweepPlan((Segment(1e6, 6e6, 201),), bias_V=5), cancelled=lambda: True)
    assert say(sim, ":SOUR:BIAS:STAT?") == "0"


def test_a_good_sweep_is_kept_where_a_setting_cannot_be_restored(
    sim: Simulator, analyzer: Analyzer, monkeypatch: pytest.MonkeyPatch
) -> None:
    overrule(analyzer, monkeypatch, ":TRIG:SOUR INT", "BUS")
    (sweep,) = analyzer.measure(PLAN)
    assert sweep.frequency.size == 301
    assert sweep.notes[-1].startswith("The instrument could not be left as found: ")
    assert "trigger source (:TRIG:SOUR) was set to INT but reads back BUS" in sweep.notes[-1]


def test_a_bias_that_stays_on_is_said(analyzer: Analyzer, monkeypatch: pytest.MonkeyPatch) -> None:
    overrule(analyzer, monkeypatch, ":SOUR:BIAS:STAT OFF", "1")
    with pytest.raises(InstrumentError, match=r"the DC bias is still ON .* switch it off at the front panel"):
        analyzer.make_safe()


@pytest.mark.parametrize("fault", ["meddle", "cut", "garbage", "drop", "ignore", "power-cycle", "wrong-count"])
def test_a_fault_gives_an_error_or_the_right_data(sim: Simulator, analyzer: Analyzer, fault: str) -> None:
    (right,) = analyzer.measure(PLAN)
    analyzer._link.timeout_seconds = 0.3
    for at in (1, 30, 60, 95):
        options = {"message": ":SENS1:SWE:POIN 77"} if fault == "meddle" else {}
        bench_command("127.0.0.1", sim.bench_port, command="fault", kind=fault, at=at, **options)
        try:
            (sweep,) = analyzer.measure(PLAN)
        except InstrumentError:
            pass
        else:
            np.testing.assert_array_equal(sweep.impedance, right.impedance)
        bench_command("127.0.0.1", sim.bench_port, command="fault", kind="none")
