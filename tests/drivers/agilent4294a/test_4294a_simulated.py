"""The driver with the simulated 4294A, over the same path as a real one."""

import json
import socket
import threading

import numpy as np
import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.drivers.base import compensation_file
from pzctl.drivers.base.analyzer import Cancelled, InstrumentError
from pzctl.drivers.recordings import read_recording
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions, running

AT_ONCE = SimOptions(port=0, bench_port=0, time_scale=0.0)


def bench(sim, **command):
    with socket.create_connection(("127.0.0.1", sim.bench_port), 5) as line:
        line.sendall(json.dumps(command).encode() + b"\n")
        answer = json.loads(line.makefile().readline())
    assert answer["ok"], answer
    return answer


def ask(sim, *messages):
    """The instrument's answer to another client."""
    with socket.create_connection(("127.0.0.1", sim.port), 5) as line, line.makefile("r") as replies:
        answers = []
        for message in messages:
            line.sendall(message.encode() + b"\n")
            answers.append(replies.readline().strip())
        return answers


@pytest.fixture
def sim():
    with running(AT_ONCE) as simulator:
        yield simulator


@pytest.fixture
def analyzer(sim):
    opened = open_analyzer(sim.resource)
    yield opened
    opened.close()


STATE = ["STAR?", "STOP?", "POIN?", "SWPT?", "SWED?", "BWFACT?", "PAVER?", "PAVERFACT?", "AVER?", "AVERFACT?", "POWE?"]
STATE += ["DCMOD?", "DCRNG?", "DCV?", "DCO?", "CONT?", "MEAS?", "TRAC?", "SDELT?", "PDELT?", "TRGS?"]


def test_a_plan_of_every_kind_of_segment(sim, analyzer):
    ask(sim, "PRES;STAR 5E6;STOP 7E6;POIN 33;AVERFACT 3;SDELT 1;MEAS CPD;TRAC B;DCV 3;CONT;CONT?")
    found = ask(sim, *STATE)
    plan = SweepPlan(
        (Segment(1e6, 6e6), Segment(1e3, 100e6, 201, "log"), Segment(2e6, 8e6, 1700)),
        oscillator_V=0.2,
        bandwidth=4,
        point_average=2,
        sweep_average=3,
        bias_V=5.0,
        direction="down",
    )

    fine, wide, long = analyzer.measure(plan)

    assert ask(sim, *STATE) == found
    np.testing.assert_array_equal(fine.frequency, np.round(np.linspace(1e6, 6e6, 801), 3))
    np.testing.assert_allclose(wide.frequency, np.geomspace(1e3, 100e6, 201), rtol=0, atol=1e-3)
    assert len(long.frequency) == 1700
    assert len(long.settings["sweeps"]) == 3
    noise = fine.settings["noise_relative"]
    assert long.settings["overlap_noise_relative"] == pytest.approx(np.median(noise), rel=1)
    for sweep in (fine, wide, long):
        assert sweep.settings["bias_V"] == 5.0
        assert sweep.settings["direction"] == "down"
        assert sweep.settings["oscillator_V"] == pytest.approx(0.2, abs=6e-4)
        assert np.all(sweep.impedance.imag[:2] < 0)  # a piezoelectric disk far below resonance is a capacitor


def test_a_sweep_of_two_minutes_is_cancelled_at_once():
    said, enough = [], threading.Event()

    def progress(p):
        said.append(p)
        if len(said) > 3:
            enough.set()

    with running(SimOptions(port=0, bench_port=0, time_scale=1.0)) as sim:
        analyzer = open_analyzer(sim.resource)
        with pytest.raises(Cancelled, match="sweep 1 of 1 was cancelled"):
            analyzer.measure(SweepPlan((Segment(1e6, 3e6),), bias_V=2), progress, enough.is_set)
        assert ask(sim, "CONT?", "DCO?", "POIN?") == ["0", "0", "201"]
        assert analyzer.identify().model == "4294A"
        analyzer.close()
    fractions = [p.fraction for p in said]
    assert fractions == sorted(fractions)
    assert all(0 <= f < 0.1 for f in fractions)
    assert 100 < said[-1].seconds_left < said[0].seconds_left < 130


def test_bias_goes_up_a_range_on_error_137_and_gives_up_in_words(sim, analyzer):
    bench(sim, command="fault", kind="bias-overload")
    with pytest.raises(InstrumentError, match=r"bias of 20 V needs more than 100 mA \(error 137\)"):
        analyzer.measure(SweepPlan((Segment(1e6, 3e6),), bias_V=20))
    assert ask(sim, "DCO?", "DCRNG?") == ["0", "M1"]


def test_the_analyzer_continues_after_a_power_failure(sim, analyzer):
    plan = SweepPlan((Segment(2e6, 6e6, 21),))
    bench(sim, command="fault", kind="power-cycle", at=40, seconds=0.05)
    with pytest.raises(InstrumentError):
        analyzer.measure(plan)
    bench(sim, command="power-cycle", seconds=0.0)
    assert len(analyzer.measure(plan)[0].frequency) == 21


def test_the_next_gluing_step_changes_the_sweep(sim, analyzer):
    plan = SweepPlan((Segment(2e6, 6e6, 201),))
    (disk,) = analyzer.measure(plan)
    bench(sim, command="next")
    (glued,) = analyzer.measure(plan)
    assert np.max(np.abs(np.log(glued.impedance / disk.impedance))) > 0.1


@pytest.fixture
def clips():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, jig="clips", noise=False)) as simulator:
        yield simulator


def standards_put_in(sim, asked):
    """A technician who connects the requested standards."""

    def prompt(sentence):
        asked.append(sentence)
        what = "open" if "open" in sentence else "short" if "Short" in sentence else "load"
        bench(sim, command="connect", what=what)

    return prompt


def test_compensation_removes_the_clips_and_can_be_restored(clips, tmp_path):
    plan = SweepPlan((Segment(1e6, 15e6, 201),))
    analyzer, asked = open_analyzer(clips.resource), []
    (raw,) = analyzer.measure(plan)

    taken = analyzer.compensate(("open", "short"), standards_put_in(clips, asked))
    compensation_file.save(tmp_path / "clips.json", taken, "4294A")

    assert len(asked) == 2
    bench(clips, command="connect", what="device")
    (compensated,) = analyzer.measure(plan)
    assert (raw.settings["compensation"], compensated.settings["compensation"]) == ([], ["open", "short"])
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, jig="ideal", noise=False)) as ideal:
        direct = open_analyzer(ideal.resource)
        (true,) = direct.measure(plan)
        direct.close()
    error = np.abs(np.log(compensated.impedance / true.impedance))
    assert np.max(np.abs(np.log(raw.impedance / true.impedance))) > 0.5
    assert np.max(error) < 0.02
    analyzer.close()

    bench(clips, command="power-cycle", seconds=0.0)
    again = open_analyzer(clips.resource)
    again.restore(compensation_file.load(tmp_path / "clips.json", CAPABILITIES))
    (restored,) = again.measure(plan)
    again.close()
    np.testing.assert_allclose(restored.impedance, compensated.impedance, rtol=1e-5)


KEPT = b'{"kind": "%s", "version": 1, "instrument": "", "adapter": "%s", "taken": "", "arrays": {"open": [[0, 1]]}}'


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read: No such file"),
        (b"not JSON", "not a compensation: JSON is malformed"),
        (b'{"kind": "something else"}', "not a compensation: Object missing required field"),
        (KEPT % (b"E4990A compensation", b"OFF"), "kind is 'E4990A compensation'; 4294A compensation is allowed"),
        (KEPT[:-1] % (b"4294A compensation", b"OFF") + b', "taken": "2020"}', "the field 'taken' is given twice"),
        (KEPT % (b"4294A compensation", b"N"), "adapter is 'N'; OFF, M1, M2, APC7, PROBE is allowed"),
    ],
)
def test_a_file_that_is_no_compensation(tmp_path, content, words):
    file = tmp_path / "clips.json"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InstrumentError, match=words):
        compensation_file.load(file, CAPABILITIES)


def test_a_standard_that_is_none_is_refused(clips):
    analyzer = open_analyzer(clips.resource)
    with pytest.raises(InstrumentError, match=r"short compensation: .* ohm was measured; at most 10 ohm can be"):
        analyzer.compensate(("short",), lambda _: bench(clips, command="connect", what="open"))
    assert ask(clips, "COMSTB?", "BWFACT?", "CONT?") == ["0", "1", "0"]
    analyzer.close()


def test_the_screen_and_the_instruments_own_export(sim, analyzer, tmp_path):
    ask(sim, "HOLD;STAR 1E6;STOP 6E6;POIN 801;SING;*OPC?")
    (text,) = ask(sim, "FORM4;OUTPDATA?")

    screen = analyzer.fetch("screen")
    export = tmp_path / "disk.txt"
    export.write_bytes(analyzer.fetch("ascii"))

    assert screen[:4] in (b"II*\0", b"MM\0*")  # TIFF, either way round
    assert len(analyzer.fetch("screen")) == len(screen)  # again under the same name; the screen shows a clock
    recording = read_recording(export)
    np.testing.assert_allclose(recording.frequency, np.linspace(1e6, 6e6, 801), rtol=0, atol=1e-3)
    pairs = np.array(text.split(","), float)
    np.testing.assert_allclose(recording.impedance, pairs[0::2] + 1j * pairs[1::2], rtol=2e-6)
    assert ask(sim, "FNUM?", "OUTPERRO?")[0] in ("0", "+0")
    with pytest.raises(InstrumentError, match="no file of kind 'jpeg'; there are screen, ascii"):
        analyzer.fetch("jpeg")


def test_gpib_through_a_prologix_adapter():
    plan = SweepPlan((Segment(1e6, 6e6, 801),), bias_V=1.0)
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, prologix_port=0, noise=False)) as sim:
        by_socket = open_analyzer(sim.resource)
        (straight,) = by_socket.measure(plan)
        by_socket.close()
        by_gpib = open_analyzer(f"PROLOGIX::127.0.0.1:{sim.prologix_port}::17")
        (bridged,) = by_gpib.measure(plan)
        by_gpib.close()
        assert ask(sim, "DCO?") == ["0"]
        with pytest.raises(InstrumentError, match=r"no answer to \*IDN\?"):
            open_analyzer(f"PROLOGIX::127.0.0.1:{sim.prologix_port}::5", timeout_seconds=0.3).identify()
    np.testing.assert_array_equal(bridged.impedance, straight.impedance)


def test_settings_of_other_sweep_parameters_and_modes_are_restored(sim):
    wire = open_analyzer(sim.resource)
    ask = wire._link.ask
    ask("SWPT LOG;STAR 50;STOP 60;POWE 0.2;POWMOD CURR;POWE 0.004;SWPP OLEV;STAR 0.001;STOP 0.01;POIN 9;*CLS;*OPC?")
    wire.measure(SweepPlan((Segment(1e6, 2e6, 11),)))
    found = {"SWPP?": "OLEV", "SWPT?": "LIN", "POWMOD?": "CURR", "POIN?": "9"}
    assert {q: ask(q) for q in found} == found
    assert [float(ask(q)) for q in ("STAR?", "STOP?", "POWE?")] == [0.001, 0.01, 0.004]
    assert ask("SWPP FREQ;SWPT?") == "LOG"
    assert [float(ask(q)) for q in ("STAR?", "STOP?", "POWMOD VOLT;POWE?")] == [50, 60, 0.2]
    assert ask("OUTPERRO?") == '0,"No error"'
    wire.close()


def test_a_compensation_at_the_points_of_a_sweep_is_not_lost_to_another_sweep(sim):
    wire = open_analyzer(sim.resource)
    ask = wire._link.ask
    ask("*RST;STAR 1E6;STOP 2E6;POIN 11;CALP USER;COMB;COMSTB?")
    plan = SweepPlan((Segment(3e6, 4e6, 11),))
    with pytest.raises(InstrumentError, match=r"short compensation holds for the points .*\(CALP USER\)"):
        wire.measure(plan)
    assert ask("COMSTB?") == "1"
    ask("CALP FIXED;*CLS;COMSTB?")
    (sweep,) = wire.measure(plan)
    assert sweep.settings["compensation"] == []
    wire.close()
