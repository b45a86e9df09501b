"""The instrument's commands over its own socket: the checklist of section 9 of the reference."""

import time

import numpy as np
import pytest


def test_identifies_itself_and_comes_up_sweeping(lab):
    wire = lab.wire()
    assert wire.ask("*IDN?") == "HEWLETT-PACKARD,4294A,MY43202956,REV1.11"
    assert wire.ask("CONT?") == "1"
    assert int(wire.ask("*ESR?")) & 128


def test_defaults_after_reset(wire):
    wire.say("MEAS COMP;POIN 33;STAR 1 MHZ;BWFACT 5;POWE 0.1;FORM3;SWPT LOG;DCV 3;TRAC B;*RST")
    expected = {
        "MEAS?": "IMPH", "SWPP?": "FREQ", "SWPT?": "LIN", "POIN?": "201", "BWFACT?": "1", "PAVER?": "0",
        "PAVERFACT?": "4", "AVER?": "0", "AVERFACT?": "16", "POWMOD?": "VOLT", "DCO?": "0", "TRGS?": "INT",
        "TRAC?": "A", "CONT?": "0", "COMSTA?": "0", "E4TP?": "OFF",
    }  # fmt: skip
    assert {query: wire.ask(query) for query in expected} == expected
    assert [float(wire.ask(q)) for q in ("STAR?", "STOP?", "POWE?", "DCV?")] == [40, 110e6, 0.5, 0]
    assert wire.numbers("OUTPSWPRM?").size == 201, "FORM4 is back"


def test_preset_continues_sweeping(wire):
    wire.say("PRES")
    assert wire.ask("CONT?") == "1"
    assert wire.ask("*OPC?") == "1", "CONT has no end to wait for"
    wire.say("HOLD")
    assert wire.ask("CONT?") == "0"


def test_tolerates_common_spellings(wire):
    wire.say(b"star 1mhz; STOP 2000000 hz ;poin 11\r\n")
    assert [float(x) for x in (wire.ask("STAR?"), wire.ask("stop?"))] == [1e6, 2e6]
    assert wire.ask("TRAC B;TRAC?") == "B"
    assert wire.ask("TITL 'one; two';TITL?") == '"one; two"'
    assert wire.errors() == []


@pytest.mark.parametrize(
    ("command", "query", "value"),
    [
        ("POIN 1001", "POIN?", 801),
        ("POIN 1", "POIN?", 2),
        ("STOP 140000000 HZ", "STOP?", 110e6),
        ("STAR 1", "STAR?", 40),
        ("SWPT LOG;STAR 110E6", "STAR?", 109.9998e6),
        ("SWPT LOG;STAR 40;STOP 50", "STOP?", 60),
        ("POWE 2", "POWE?", 1),
        ("POWMOD CURR;POWE 1", "POWE?", 20e-3),
        ("BWFACT 9", "BWFACT?", 5),
        ("DCV -50", "DCV?", -40),
        ("AVERFACT 999", "AVERFACT?", 256),
        ("STAR 1000000.0004", "STAR?", 1000000.0),
    ],
)
def test_values_out_of_range_are_clamped_silently(wire, command, query, value):
    wire.say(command)
    assert float(wire.ask(query)) == pytest.approx(value, abs=1e-9)
    assert wire.errors() == []


@pytest.mark.parametrize(
    ("message", "number", "event_bit"),
    [
        ("MEAS ZTD", -141, 5),
        ("MEAS&IRIM", -101, 5),
        ("*SRE4", -111, 5),
        ("EXTRAORDINARY 1", -112, 5),
        ("POIN 101 TRAC B", -103, 5),
        ("TITL bare", -148, 5),
        ("MAN", -113, 5),
        ("POIN101", -113, 5),
        ("POWMOD", -109, 5),
        ("POIN ON", -104, 5),
        ("POWE 1 HZ", -131, 5),
        ("SYST:ERR?", -113, 5),
        ("*RST 1", -108, 5),
        ("COMSTA ON", 11, 3),
        ("OUTPDATAP? 202", -222, 4),
        ('TITL "open', -151, 5),
    ],
)
def test_a_refused_command_queues_an_error_and_changes_nothing(wire, message, number, event_bit):
    wire.say(message)
    assert wire.ask("MEAS?") == "IMPH"
    assert int(wire.ask("*ESR?")) & ~1 == 1 << event_bit
    (error,) = wire.errors()
    assert int(error.split(",")[0]) == number


def test_the_queue_holds_ten_errors_oldest_first(wire):
    wire.say("MEAS FOO")
    for _ in range(11):
        wire.say("FOO")
    numbers = [int(e.split(",")[0]) for e in wire.errors()]
    assert numbers == [-141, *[-113] * 8, -350]
    wire.say("FOO;*CLS")
    assert wire.ask("OUTPERRO?") == '0,"No error"'


def test_start_moves_stop_along_and_center_moves_both(wire):
    wire.say("STAR 5 MHZ;STOP 1 MHZ")
    assert float(wire.ask("STAR?")) == float(wire.ask("STOP?")) == 1e6
    wire.say("CENT 3 MHZ;SPAN 2 MHZ")
    assert [float(wire.ask(q)) for q in ("STAR?", "STOP?", "CENT?", "SPAN?")] == [2e6, 4e6, 3e6, 2e6]


def test_the_log_grid_is_that_of_a_real_export(wire, recordings):
    real = [
        line.split("\t")[0] for line in (recordings / "hp4294a-exports" / "MD1.txt").read_text().splitlines()[21:822]
    ]
    wire.say("SWPT LOG;POIN 801;STAR 25.5E3;STOP 32.5E3;FORM3")
    mine = wire.block("OUTPSWPRM?", ">f8")
    np.testing.assert_allclose(mine, [float(f) for f in real], atol=1.01e-3, rtol=0)
    np.testing.assert_array_equal(mine, np.round(mine * 1000) / 1000)


def test_the_formats_carry_the_same_numbers(wire):
    wire.say("STAR 1 MHZ;STOP 6 MHZ;POIN 801;SING")
    assert wire.ask("*OPC?") == "1"
    wire.say("FORM3")
    exact = wire.block("OUTPDATA?", ">f8")
    assert exact.nbytes == 12_816
    np.testing.assert_array_equal(wire.numbers("FORM4;OUTPDATA?"), exact)
    for form, dtype in ((2, ">f4"), (5, "<f4")):
        np.testing.assert_array_equal(wire.block(f"FORM{form};OUTPDATA?", dtype), exact.astype("f4"))
    np.testing.assert_array_equal(wire.numbers("FORM4;OUTPDATAP? 3"), exact[4:6])
    assert [f"{x:.6e}" for x in exact[:9]] == [f"{float(f'{x:.6e}'):.6e}" for x in exact[:9]], "seven digits"


def test_traces_are_derived_from_the_stored_impedance(wire):
    wire.say("MEAS IRIM;STAR 1 MHZ;STOP 6 MHZ;SING")
    wire.ask("*OPC?")
    z = wire.impedance()
    w = 2 * np.pi * wire.block("OUTPSWPRM?", ">f8")

    def traces(measurement):
        wire.say(f"MEAS {measurement}")
        return [wire.block(f"TRAC {t};OUTPDTRC?", ">f8") for t in "AB"]

    for measurement, first, second in (
        ("IMPH", abs(z), np.angle(z, deg=True)),
        ("ARIM", (1 / z).real, (1 / z).imag),
        ("CPD", (1 / z).imag / w, z.real / abs(z.imag)),
        ("LSR", z.imag / w, z.real),
    ):
        a, b = traces(measurement)
        np.testing.assert_allclose(a[0::2], first, rtol=2e-6)
        np.testing.assert_allclose(b[0::2], second, rtol=2e-6)
        assert not a[1::2].any(), "a scalar's subsidiary is 0"
        assert not b[1::2].any()
    a, b = traces("COMP")
    np.testing.assert_allclose(a[0::2] + 1j * a[1::2], z, rtol=1e-6)
    np.testing.assert_allclose(b[0::2] + 1j * b[1::2], 1 / z, rtol=1e-6)


def test_a_sweep_is_overlapped_and_its_data_appear_at_the_end(lab_with):
    lab = lab_with(time_scale=0.1)
    wire, other = lab.wire(), lab.wire()
    wire.say("*RST;*CLS;ESNB 1;*SRE 4;STAR 1 MHZ;STOP 6 MHZ;SING;*OPC?")
    assert other.ask("BWFACT?") == "1", "*OPC? blocks no other client"
    assert not np.any(other.impedance()), "nothing yet"
    assert int(other.ask("*STB?")) & 4 == 0
    assert wire.line() == "1\n"
    assert np.all(other.impedance() != 0)
    assert int(other.ask("*STB?")) == 4 | 64
    assert int(other.ask("ESB?")) & 1
    assert int(other.ask("ESB?")) == 0, "reading clears"


def test_a_sweep_takes_its_time(lab_with):
    lab = lab_with(time_scale=0.05)
    wire = lab.wire()
    wire.say("*RST;STAR 1 MHZ;STOP 3 MHZ;BWFACT 3;NUMG 2")
    began = time.monotonic()
    wire.ask("*OPC?")
    model = 0.05 * 2 * 201 * 14.4e-3
    assert time.monotonic() - began >= 0.9 * model
    assert lab.bench("status")["bench_seconds"] == pytest.approx(model / 0.05, rel=1e-2)


def test_hold_ends_a_waiting_sweep_and_its_opc(lab):
    wire, other = lab.wire(), lab.wire()
    wire.say("*RST;*CLS;TRGS BUS;SING;*OPC?")
    assert int(other.ask("ESB?")) & 2, "waits for its trigger"
    other.say("HOLD")
    assert wire.line() == "1\n"


def test_a_bus_trigger_starts_each_sweep(wire):
    wire.say("*TRG")
    assert wire.errors()[0].startswith("-211")
    wire.say("TRGS BUS;*OPC;NUMG 2;*OPC;*TRG")
    assert int(wire.ask("ESB?")) & 1 == 0, "one more to come"
    wire.say("*TRG")
    assert int(wire.ask("ESB?")) & 1
    assert int(wire.ask("*ESR?")) & 1


def test_an_external_trigger_comes_from_the_bench(lab, wire):
    assert wire.ask("TRGS EXT;SING;TRGS?") == "EXT", "the sweep waits before the bench, another connection, triggers it"
    lab.bench("trigger")
    assert wire.ask("*OPC?") == "1"
    assert np.all(wire.impedance() != 0)


def test_averaging_needs_groups(lab_with):
    lab = lab_with(noise=True)
    clean = lab_with(noise=False).wire()
    wire = lab.wire()
    setup = "*RST;STAR 1 MHZ;STOP 3 MHZ;POIN 801;AVER ON;AVERFACT 16;AVERREST"
    clean.say(setup + ";SING;*OPC?")
    clean.line()
    truth = clean.impedance()

    def noise(command):
        wire.say(f"{setup};{command};*OPC?")
        wire.line()
        return np.std(wire.impedance() / truth - 1)

    assert noise("SING") / noise("NUMG 16") == pytest.approx(4, rel=0.15)


def test_a_new_axis_discards_old_data(wire):
    wire.say("SING")
    assert np.all(wire.impedance() != 0)
    wire.say("POIN 51")
    assert wire.impedance().tolist() == [0] * 51


def test_bias_beyond_its_range_is_error_137(wire):
    wire.say("DCMOD VOLT;DCV 5;DCRNG M1;DCO ON")
    assert wire.errors() == ['137,"DCBIAS OVERLOAD"']
    assert wire.ask("DCO?") == "0"
    wire.say("DCRNG M10;DCO ON")
    assert wire.errors() == []
    assert wire.ask("DCO?") == "1"


def test_a_list_sweep_has_its_segments_own_settings(wire):
    wire.say("EDITLIST;CLEL;SADD;STAR 1 MHZ;STOP 2 MHZ;POIN 11;BWFACT 5;SDON")
    wire.say("SADD;STAR 4 MHZ;STOP 5 MHZ;POIN 201;POWE 0.1;SDON;EDITDONE;SWPT LIST;FORM3;SING")
    assert wire.ask("*OPC?") == "1"
    assert wire.errors() == []
    assert wire.ask("POIN?") == "212"
    assert wire.ask("BWFACT?") == "1"
    axis = wire.block("OUTPSWPRM?", ">f8")
    assert (axis[0], axis[10], axis[11], axis[-1]) == (1e6, 2e6, 4e6, 5e6)
    assert wire.impedance().size == 212


def test_a_list_has_at_most_801_points_and_18_segments(wire):
    wire.say("CLEL" + "".join(f";SADD;STAR {k} MHZ;STOP {k + 1} MHZ;POIN 201;SDON" for k in range(1, 5)))
    assert wire.ask("SEDI 4;POIN?") == "198", "what is left of 801"
    wire.say("SDON;SADD")
    assert wire.errors() == ['77,"TOO MANY SEGMENTS OR POINTS"']
    assert float(wire.ask("STAR?")) == 4e6, "the target is open instead"
    wire.say("SDON;CLEL" + ";SADD;POIN 2;SDON" * 18 + ";SADD")
    assert wire.errors() == ['77,"TOO MANY SEGMENTS OR POINTS"']


def test_a_segment_starts_with_the_settings_of_the_previous_one(wire):
    wire.say("STAR 1 MHZ;POWE 0.2;BWFACT 3;PAVER ON;PAVERFACT 9;SWPT LIST")
    assert wire.errors() == ['124,"LIST TABLE EMPTY OR INSUFFICIENT TABLE"']
    first = wire.ask("SADD;STOP 2 MHZ;PAVERFACT?"), wire.ask("POIN?"), wire.ask("BWFACT?"), float(wire.ask("STAR?"))
    assert first == ("1", "201", "3", 1e6)
    wire.say("PAVERFACT 2;DCV 5;SDON;SADD")
    assert [float(wire.ask(q)) for q in ("STAR?", "STOP?", "DCV?", "POWE?", "PAVERFACT?")] == [2e6, 2e6, 5, 0.2, 2]
    wire.say("SDON;SDEL 1;SADD 1;STOP 3 MHZ;SDON;EDITDONE")
    assert wire.ask("SWPT LIST;POIN?") == "402"
    assert wire.ask("SEGM?") == "0", "nobody edits it"


def test_an_unrelated_command_discards_an_open_segment(wire):
    wire.say("SADD;STOP 1 MHZ;CLEL;SADD;SDEL;EDITLIST;SEGM 1")
    assert wire.errors() == ['75,"COMMAND IGNORED -SEGMENT NOT DONE YET"'] * 5
    assert wire.ask("SWED DOWN;SWED?") == "DOWN"
    assert wire.errors() == ['74,"CURRENT EDITING SEGMENT SCRATCHED"']
    wire.say("SADD;STOP 1 MHZ;MEAS COMP;SDON;EDITDONE")
    assert wire.errors() == [], "the manual's own example 13-6 sends MEAS there"


def test_a_level_sweep_stays_at_its_frequency(wire):
    wire.say("SWPP OLEV;CWFREQ 1 MHZ;STAR 0.1 V;STOP 0.5;POIN 5;SING")
    np.testing.assert_allclose(wire.numbers("OUTPSWPRM?"), [0.1, 0.2, 0.3, 0.4, 0.5])
    np.testing.assert_allclose(wire.impedance(), wire.impedance()[0], rtol=0.01)
    wire.say("SWPT LOG")
    assert wire.errors()[0].startswith("131,")
    wire.say("SWPP FREQ;SWPT LOG;SWPP DCB")
    assert wire.ask("SWPT?") == "LIN", "each sweep parameter has a sweep type of its own"
    assert wire.ask("SWPP FREQ;SWPT?") == "LOG"
    assert wire.errors() == []


def test_the_equivalent_circuit_of_a_resonator(lab_with):
    lab = lab_with(noise=False, jig="ideal")
    wire = lab.wire()
    wire.say("*RST;STAR 3.6 MHZ;STOP 4.6 MHZ;POIN 801;EQUC CIRE;FORM3;CALECPARA")
    assert wire.errors()[0].startswith("35,")
    wire.say("SING;*OPC?")
    assert wire.line() == "1\n"
    wire.say("CALECPARA")
    assert wire.errors() == []
    assert wire.ask("EQUC?")[3] == "E"
    r, inductance, c1, c0 = (float(wire.ask(f"DEFEC{name}?")) for name in ("R1", "L1", "C1", "C0"))
    z, f = wire.impedance(), wire.block("FORM3;OUTPSWPRM?", ">f8")
    series = 1 / (2 * np.pi * np.sqrt(inductance * c1))
    assert series == pytest.approx(f[np.argmax((1 / z).real)], rel=2e-3)
    assert series * np.sqrt(1 + c1 / c0) == pytest.approx(f[np.argmax(z.real)], rel=2e-3)
    assert r == pytest.approx(1 / (1 / z).real.max(), rel=0.1)
    wire.say("SIMFCHAR")
    memory = wire.block("FORM3;OUTPMEMO?", ">f8")
    assert np.abs((memory[0::2] + 1j * memory[1::2]) / z - 1).max() < 0.3
    wire.say("SWPP OLEV;CALECPARA")
    assert wire.errors() == ['131,"FREQUENCY SWEEP ONLY"']


@pytest.mark.parametrize("circuit", ["CIRA", "CIRB", "CIRC", "CIRD", "CIRE"])
def test_each_equivalent_circuit_finds_the_values_that_were_simulated(wire, circuit):
    wire.say("STAR 1 MHZ;STOP 10 MHZ;POIN 401;MEAS COMP;FORM3")
    wire.say(f"EQUC {circuit};DEFECR1 20;DEFECL1 1E-5;DEFECC1 1E-10;DEFECC0 1E-9;SIMFCHAR")
    memory = wire.block("OUTPMEMO?", ">f8")
    wire.say(b"INPUDATA #6%06d" % memory.nbytes + memory.astype(">f8").tobytes() + b"\n")
    wire.say("CALECPARA")
    assert wire.errors() == []
    for name, value in {"R1": 20, "L1": 1e-5, "C1": 1e-10, "C0": 1e-9}.items():
        assert float(wire.ask(f"DEFEC{name}?")) == pytest.approx(value, rel=1e-3), name


def test_an_adapter_is_set_up_in_steps_that_say_when_they_are_done(wire):
    wire.say("ECALP")
    assert wire.errors() == ['12,"CALIBRATION NOT USABLE"']
    wire.say("E4TP M1;ESNB 256;*CLS;ECALP;ECALDON")
    assert wire.errors() == ['10,"ADDITIONAL STANDARDS NEEDED"']
    wire.say("ECALA")
    assert wire.errors() == ['12,"CALIBRATION NOT USABLE"'], "a 1 m cable needs phase and load alone"
    assert wire.ask("*CLS;ECALC;ESB?") == "256"
    wire.say("ECALDON")
    assert wire.errors() == []


def test_a_user_calibration_takes_effect_with_its_last_standard(lab, wire):
    wire.say("CALA")
    assert wire.errors() == ['12,"CALIBRATION NOT USABLE"']
    wire.say("E4TP APC7;CALP USER;ESNB 256")
    for standard, content in (("CALA", "open"), ("CALB", "short"), ("CALC", "load")):
        assert wire.ask("CALST?") == "0"
        wire.say("CALDON")
        assert wire.errors() == ['10,"ADDITIONAL STANDARDS NEEDED"']
        lab.bench("connect", what=content)
        assert wire.ask(f"*CLS;{standard};ESB?") == "256"
    wire.say("CALDON")
    assert wire.ask("CALST?") == "1"
    wire.say("SING")
    np.testing.assert_allclose(wire.impedance(), 50, rtol=0.01)
    wire.say("POIN 51")
    assert wire.errors() == ['13,"CALIBRATION ABORTED"'], "its points are no longer those of the sweep"
    assert wire.ask("CALST ON;CALST?") == "0"
    assert wire.errors() == ['11,"CALIBRATION REQUIRED"']


def test_there_are_a_hundred_fixed_points_and_the_open_is_in_femtofarad(lab, wire):
    lab.bench("effects", noise=False)
    lab.bench("jig", name="ideal", capacitance=1e-12)
    lab.bench("connect", what="open")
    wire.say("DCOMOPENC 1000;COMA;FORM3;STAR 1 MHZ;STOP 2 MHZ")
    assert wire.block("OUTPCOMC1?", ">f8").size == 200
    wire.say("MEAS CPG;SING;TRAC A")
    np.testing.assert_allclose(wire.block("OUTPDTRC?", ">f8")[0::2], 1e-12, rtol=1e-3)
    wire.say("INPUCOMC1 1,2,3")
    assert wire.errors() == ['55,"NOT ENOUGH DATA"']


def test_a_manual_trigger_comes_from_the_front_panel(lab, wire):
    wire.say("TRGS MAN;ESNB 1;*CLS;SING")
    assert wire.ask("*STB?") == "0"
    lab.bench("trigger")
    assert wire.ask("*OPC?") == "1"
    assert wire.ask("*STB?") == "4"
    assert wire.errors() == []


def test_a_point_trigger_measures_one_point(wire):
    wire.say("POIN 3;TRGS BUS;TRGEVE POIN;ESNB 129;*SRE 4;SING;*CLS;*TRG")
    assert wire.ask("ESB?") == "128"
    wire.say("*TRG;*TRG")
    assert wire.ask("ESB?") == "129"
    assert np.all(wire.impedance() != 0)


def test_a_manual_sweep_measures_one_point_or_a_range(wire):
    wire.say("POIN 11;MANS ON;MANP 3;SING")
    assert np.flatnonzero(wire.impedance()).tolist() == [2]
    wire.say("MANR 5,7;SING")
    assert np.flatnonzero(wire.impedance()).tolist() == [2, 4, 5, 6]
    assert [wire.ask(q) for q in ("MANR?", "MANP 4;MANR?", "MANP?")] == ["5,7", "0,0", "4"]
    assert wire.ask("MANR 9,2;MANR?") == "2,2"


def test_a_table_counts_from_the_end_of_its_editing(wire):
    wire.say("EDITLIST;SADD;STAR 1 MHZ;STOP 2 MHZ;POIN 11;SDON;EDITDONE;SWPT LIST;SING;*OPC?")
    assert wire.line() == "1\n"
    wire.say("EDITLIST;SEDI 1;POIN 21;SDON")
    assert wire.ask("POIN?") == "11"
    assert wire.impedance().size == 11
    wire.say("FORM4;EDITDONE")
    assert wire.ask("POIN?") == "21"
    wire.say("SWPT LIN;EDITLIST;CLEL;SWPT LIST;EDITDONE")
    assert wire.errors()[0].startswith("124,")
    assert wire.ask("POIN?") == "21"
