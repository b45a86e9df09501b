"""The bytes between driver and 4294A compared with the manual; the peer only stores settings and messages."""

import time

import numpy as np
import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.base.analyzer import Cancelled, InstrumentError
from pzctl.drivers.visa import connection
from pzctl.models.sweep_plan import Segment, SweepPlan

PLAN = SweepPlan((Segment(1e6, 1.5e6, 3),), oscillator_V=0.25, bandwidth=3)


def block(values):
    data = np.asarray(values, dtype=">f8").tobytes()
    return b"#6%06d" % len(data) + data + b"\n"


AXIS = block([1e6, 1.25e6, 1.5e6])
# 0x0A0A... is the double 1.1e-259: a newline in every byte of the block
DATA = block([np.frombuffer(b"\x0a" * 8, ">f8")[0], -50.0, 3.0, -40.0, 5.0, -30.0])
READINGS = {"OUTPSWPRM?": [AXIS], "OUTPDATA?": [DATA]}


def measure(peer, plan=PLAN, timeout_seconds=0.6, **keywords):
    analyzer = open_analyzer(peer.resource, timeout_seconds)
    try:
        return analyzer.measure(plan, **keywords)
    finally:
        analyzer.close()


def test_a_sweep_is_set_up_and_read_and_the_settings_restored(play):
    peer = play(READINGS)

    (sweep,) = measure(peer)

    assert list(sweep.frequency) == [1e6, 1.25e6, 1.5e6]
    assert list(sweep.impedance[1:]) == [3 - 40j, 5 - 30j]
    assert sweep.settings["instrument"] == "HEWLETT-PACKARD,4294A,MY43202956,REV1.11"
    assert sweep.settings["oscillator_V"] == 0.25
    assert sweep.settings["compensation"] == ["open", "short"]
    assert len(sweep.settings["noise_relative"]) == 3
    assert [message for message in peer.log if ";" in message] == [
        "HOLD;CONT?",
        "DCO OFF;DCO?",
        "TRGS INT;TRGS?",
        "SWPP FREQ;SWPP?",
        "SWPT LIN;SWPT?",
        "STAR 1000000;STOP 1500000;STAR?",
        "STAR 1000000;STAR?",
        "STOP 1500000;STOP?",
        "POIN 3;POIN?",
        "SWED UP;SWED?",
        "SDELT 0;SDELT?",
        "PDELT 0;PDELT?",
        "BWFACT 3;BWFACT?",
        "PAVERFACT 1;PAVERFACT?",
        "PAVER OFF;PAVER?",
        "AVERFACT 1;AVERFACT?",
        "AVER OFF;AVER?",
        "POWMOD VOLT;POWMOD?",
        "POWE 0.25;POWE?",
        "ESNB 1;*SRE 4;*CLS;SING;*ESR?",
        "FORM3;OUTPSWPRM?",
        "FORM3;OUTPDATA?",
        "HOLD;DCO OFF;DCO?",
        "FORM4;ESNB 0;*SRE 0;*ESE 0;*STB?",
        "STAR 40;STOP 110000000;STAR?",
        "STAR 40;STAR?",
        "POIN 201;POIN?",
        "BWFACT 1;BWFACT?",
        "PAVERFACT 4;PAVERFACT?",
        "AVERFACT 16;AVERFACT?",
        "POWE 0.5;POWE?",
        "CONT;CONT?",
    ]


def test_averaged_sweeps_are_restarted_and_counted(play):
    peer = play(READINGS)

    (sweep,) = measure(peer, SweepPlan((Segment(1e6, 1.5e6, 3),), sweep_average=4, point_average=2))

    assert "ESNB 1;*SRE 4;*CLS;AVERREST;NUMG 4;*ESR?" in peer.log
    assert {"AVERFACT 4;AVERFACT?", "AVER ON;AVER?", "PAVERFACT 2;PAVERFACT?", "PAVER ON;PAVER?"} <= set(peer.log)
    assert (sweep.settings["sweep_average"], sweep.settings["point_average"]) == (4, 2)


def test_a_plan_with_a_current_sets_current_mode(play):
    peer = play(READINGS)

    plan = SweepPlan((Segment(1e6, 1.5e6, 3),), oscillator_A=0.002, point_delay_s=0.01, sweep_delay_s=0.5)
    (sweep,) = measure(peer, plan)

    assert {"POWMOD CURR;POWMOD?", "POWE 0.002;POWE?", "PDELT 0.01;PDELT?", "SDELT 0.5;SDELT?"} <= set(peer.log)
    assert (sweep.settings["oscillator_A"], sweep.settings["oscillator_V"]) == (0.002, None)
    assert (peer.memory["POWMOD"], float(peer.memory["POWE"])) == ("VOLT", 0.5)


def test_a_reactance_that_is_never_capacitive_is_noted(play):
    (sweep,) = measure(play(READINGS | {"OUTPDATA?": [block([1, 50, 3, 40, 5, 30])]}))
    assert "inductive at every point" in sweep.notes[0]


def test_a_downward_sweep_is_returned_rising(play):
    down = {"OUTPSWPRM?": [block([1.5e6, 1.25e6, 1e6])], "OUTPDATA?": [block([5.0, -30.0, 3.0, -40.0, 1.0, -50.0])]}

    (sweep,) = measure(play(down), SweepPlan((Segment(1e6, 1.5e6, 3),), direction="down"))

    assert list(sweep.frequency) == [1e6, 1.25e6, 1.5e6]
    assert list(sweep.impedance) == [1 - 50j, 3 - 40j, 5 - 30j]


def test_bias_uses_the_next_range_on_error_137_and_is_off_at_the_end(play):
    peer = play(READINGS | {"OUTPERRO?": [b'137,"DC BIAS OVERLOAD"\n', b'0,"NO ERROR"\n']})

    (sweep,) = measure(peer, SweepPlan((Segment(1e6, 1.5e6, 3),), bias_V=12.5))

    bias = [message for message in peer.log if message.startswith(("DC", "HOLD;DCO")) and " " in message]
    assert bias == [
        "DCO OFF;DCO?",
        "DCMOD CVOLT;DCMOD?",
        "DCRNG M1;DCRNG?",
        "DCV 12.5;DCV?",
        "DCO ON;DCO?",
        "DCO OFF;DCO?",
        "DCRNG M10;DCRNG?",
        "DCV 12.5;DCV?",
        "DCO ON;DCO?",
        "HOLD;DCO OFF;DCO?",
        "DCMOD VOLT;DCMOD?",
        "DCRNG M1;DCRNG?",
        "DCV 0;DCV?",
    ]
    assert (sweep.settings["bias_V"], sweep.settings["bias_range"]) == (12.5, "M10")
    assert peer.memory["DCO"] == "0"


def test_list_mode_is_restored(play):
    peer = play(READINGS, SWPT="LIST", CONT="0")

    measure(peer)

    assert peer.memory["SWPT"] == "LIST"
    assert "CONT;CONT?" not in peer.log


class TestWrongDataNeverGetThrough:
    def refused(self, peer, words, **keywords):
        with pytest.raises(InstrumentError, match=words):
            measure(peer, **keywords)
        assert peer.memory["DCO"] == "0"
        assert peer.memory["CONT"] == "0"

    def test_a_setting_that_was_silently_clamped(self, play):
        peer = play(READINGS)
        peer.answers["POWE 0.25"] = [b""]
        self.refused(peer, r"oscillator level \(POWE\) was set to 0.25 but reads back 0.5")

    def test_an_error_after_the_set_up(self, play):
        errors = [b'-113,"UNDEFINED HEADER"\n', b'0,"NO ERROR"\n']
        self.refused(play(READINGS | {"OUTPERRO?": errors}), r"after the set-up.*-113 \(UNDEFINED HEADER\)")

    def test_a_key_pressed_during_the_sweep(self, play):
        def meddle(peer):
            peer.memory["BWFACT"] = "1"
            return b"4\n"

        peer = play(READINGS | {"*STB?": [meddle]})
        self.refused(peer, r"bandwidth \(BWFACT\) was 3, is 1: changed while the sweep ran")

    def test_the_axis_of_another_sweep(self, play):
        stale = {"OUTPSWPRM?": [block([1e6, 1.25e6, 1.6e6])]}
        self.refused(play(READINGS | stale), r"point 3 is at 1600000 Hz; the plan has it at 1500000 Hz")

    @pytest.mark.parametrize(
        ("answer", "words"),
        [
            (b"#6000040" + DATA[8:-9] + b"\n", "40 bytes came; 48 bytes"),
            (b"#6999999" + DATA[8:], "999999 bytes are announced; at most 48"),
            (DATA[:30], "no answer to FORM3;OUTPDATA. within 0.6 s after 22 bytes"),
            (tuple(bytes([byte]) for byte in DATA), "no answer to FORM3;OUTPDATA. within 0.6 s"),  # byte by byte, late
            (b"1.0,2.0\n", "begins with '1.0,2.0"),
            (DATA + DATA, r"sweep parameter .SWPP\?.: the answer is '#6000048"),
            (DATA[:-1] + b"7", "a newline is expected"),
            (block([1, 2, np.nan, 4, 5, 6]), "number 3 is nan"),
            (block([0] * 6), "nothing was measured"),
        ],
    )
    def test_a_damaged_block(self, play, answer, words):
        self.refused(play(READINGS | {"OUTPDATA?": [answer]}), words)

    def test_answers_one_out_of_step(self, play):
        late = [*2 * [b"HEWLETT-PACKARD,4294A,MY43202956,REV1.11\n"], b"1\n"]
        self.refused(play(READINGS | {"*IDN?": late}), "out of step")

    def test_power_lost_during_the_sweep(self, play):
        self.refused(play(READINGS | {"*ESR?": [b"0\n", b"128\n"]}), "switched off and on")

    def test_a_connection_lost_at_any_exchange_is_noticed_at_once(self, play, monkeypatch):
        monkeypatch.setattr(connection, "SLICE_SECONDS", 60.0)
        begun = time.monotonic()
        for message in ("CONT?", "POIN 3", "SING", "*STB?", "*OPC?", "OUTPDATA?"):
            peer = play(READINGS)
            peer.hang_up_on = message
            with pytest.raises(InstrumentError, match=r"lost|failed|reset"):
                measure(peer, timeout_seconds=60.0)
            assert peer.connections == 2
            assert peer.log.count("HOLD;DCO OFF;DCO?") == 1
        assert time.monotonic() - begun < 60, "it does not wait for an answer that cannot come"


def test_a_cancelled_sweep_ends_in_hold_with_the_bias_off_and_settings_restored(play):
    peer = play(READINGS | {"*STB?": [b"0\n"]})
    said = []

    def progress(p):
        said.append(p.what)

    with pytest.raises(Cancelled, match="sweep 1 of 1 was cancelled"):
        measure(peer, progress=progress, cancelled=lambda: len(said) > 2)

    assert peer.memory["CONT"] == "0"
    assert peer.memory["BWFACT"] == "1"
    assert peer.connections == 1
    assert "FORM3;OUTPDATA?" not in peer.log


def test_ctrl_c_during_the_wait_leaves_bias_off(play):
    def stop(_):
        raise KeyboardInterrupt

    peer = play(READINGS)
    with pytest.raises(KeyboardInterrupt):
        measure(peer, SweepPlan((Segment(1e6, 1.5e6, 3),), bias_V=5), progress=stop)
    assert peer.memory["DCO"] == "0"


def test_answers_in_pieces_are_joined(play):
    pieces = {
        "OUTPDATA?": [(DATA[:5], DATA[5:20], DATA[20:])],
        "*IDN?": [(b"HEWLETT-PACKARD,4294A,MY432", b"02956,REV1.11\n")],
    }

    (sweep,) = measure(play(READINGS | pieces), timeout_seconds=5.0)

    assert sweep.impedance[2] == 5 - 30j


def test_who_answers_must_be_an_analyzer_that_is_installed(play):
    peer = play({"*IDN?": [b"HEWLETT-PACKARD,4395A,MY41101925,REV1.12\n"]})
    with pytest.raises(InstrumentError, match=r"4395A.*; known are HP, Agilent or Keysight 4294A, .*a recording"):
        measure(peer)
    assert peer.log == ["*IDN?"]
