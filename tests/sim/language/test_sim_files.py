"""The file system, and the files that the instrument writes."""

import numpy as np
import pytest


def read(wire, name):
    wire.say(f'ROPEN "{name}"')
    size, content = int(wire.ask(f'FSIZE? "{name}"')), b""
    while len(content) < size:
        wire.say("READ?")
        count = int(wire.stream.read(8)[2:])
        assert count == min(16_384, size - len(content))
        content += wire.stream.read(count)
        assert wire.stream.read(1) == b"\n"
    wire.say("CLOSE")
    return content


@pytest.fixture
def swept(wire):
    wire.say("STAR 1 MHZ;STOP 6 MHZ;BWFACT 5;POIN 601;SING;*OPC?")
    wire.line()
    return wire


def test_the_ascii_export_has_the_lines_of_a_real_one(swept, recordings):
    real = (recordings / "hp4294a-exports" / "sampleadmittance.txt").read_text().splitlines()
    swept.say('SAVDASC "one"')
    lines = read(swept, "one.TXT").decode().split("\r\n")
    keys = [line.split(":")[0] for line in real[:21]]
    assert [line.split(":")[0] for line in lines[:21]] == keys
    assert lines[4] == '"MEASURE PARAMETER: IMPEDANCE MAG PHASE (DEG)"'
    assert lines[10] == '"OSC LEVEL:  500 mVolt"'
    assert [line.split(":")[0] for line in lines[21 + 601 : 27 + 601]] == [
        line.split(":")[0] for line in real[21 + 801 : 27 + 801]
    ]
    frequency, magnitude, zero = lines[21].split("\t")
    assert (frequency, zero) == ("1.00000000000e+06", "0.000000e+00")
    assert float(magnitude) == pytest.approx(abs(swept.impedance()[0]), rel=1e-6)


def test_a_memory_trace_adds_columns_and_a_dead_clock_spoils_the_date(lab, swept):
    lab.bench("fault", kind="dead-clock")
    swept.say('DATMEM;SAVDASC "two.txt"')
    lines = read(swept, "two.txt").decode().split("\r\n")
    assert lines[1] == '"DATE:     52 -100"'
    assert lines[20].count("\t") == lines[21].count("\t") == 4


def test_touchstone_is_read_by_scikit_rf(swept, tmp_path):
    swept.say('SAVDS1P "three"')
    path = tmp_path / "three.s1p"
    path.write_bytes(read(swept, "three.S1P"))
    import skrf  # imported late: it takes half a second, in each process of a test run

    network = skrf.Network(str(path))
    np.testing.assert_allclose(network.z[:, 0, 0], swept.impedance(), rtol=1e-5)


def test_a_binary_file_has_its_preamble_and_both_traces(swept):
    swept.say('SAVDDAT "four"')
    content = read(swept, "four.DAT")
    assert len(content) == 29 + 601 * 16 + 10 + 601 * 16
    first = np.frombuffer(content, ">f8", 2 * 601, 29)[0::2]
    np.testing.assert_allclose(first, abs(swept.impedance()), rtol=1e-6)


def test_a_memory_trace_is_discarded_with_its_axis(wire):
    wire.say("EDITLIST;SADD;STAR 1 MHZ;STOP 2 MHZ;POIN 5;SDON;EDITDONE;SWPT LIST;SING;DATMEM;SAVDSTA 's'")
    wire.say("EDITLIST;SADD;STAR 3 MHZ;STOP 4 MHZ;POIN 3;SDON;EDITDONE;SAVDASC 'longer'")
    assert wire.errors() == []
    lines = read(wire, "longer.TXT").decode().split("\r\n")
    assert lines[7] == '"NUMBER of POINTS: 8"'
    assert lines[21].count("\t") == 2
    wire.say("SING;DATMEM;RECD 's.STA';SAVDASC 'shorter'")
    assert wire.errors() == []
    assert read(wire, "shorter.TXT").decode().split("\r\n")[7] == '"NUMBER of POINTS: 5"'


def test_names_are_listed_and_an_existing_one_is_not_overwritten(swept):
    swept.say('SAVDASC "b";SAVDASC "a";SAVDASC "a"')
    assert swept.errors()[0].startswith("-257")
    assert swept.ask("FNUM?") == "2"
    assert [swept.ask(f"FNAME? {k}") for k in (1, 2)] == ["a.TXT", "b.TXT"]
    swept.say('RESAVD "a.TXT";PURG "b.TXT";PURG "c.TXT"')
    assert swept.errors()[0].startswith("-256")
    assert swept.ask("FNUM?") == "1"
    swept.say("STOD FLASH")
    assert swept.ask("FNUM?") == "0"


def test_a_saved_state_is_restored_without_its_bias(wire):
    wire.say("EDITLIST;SADD;STAR 1 MHZ;STOP 2 MHZ;POIN 11;SDON;EDITDONE;SWPT LIST;POWE 0.2;MEAS CPD")
    wire.say('DCV 1;DCO ON;TRAC B;TITL "x;y";SAVDSTA "lab";*RST;RECD "lab.STA"')
    expected = {"SWPT?": "LIST", "POIN?": "11", "MEAS?": "CPD", "TRAC?": "B", "TITL?": '"x;y"', "DCO?": "0"}
    assert {q: wire.ask(q) for q in expected} == expected
    assert float(wire.ask("POWE?")) == 0.2
    assert wire.errors() == []


def test_a_file_written_by_the_computer_is_not_a_state(wire):
    wire.say('WOPEN "up.STA"')
    wire.say(b"WRITE #16DCO 1\n\n")
    wire.say('CLOSE;RECD "up.STA"')
    assert read(wire, "up.STA") == b"DCO 1\n"
    assert wire.errors()[0].startswith("111,")
    assert wire.ask("DCO?") == "0"


def test_directories_and_names_follow_the_manual(wire):
    assert (wire.ask("STOD?"), wire.ask("CWD?")) == ("DISK", "\\")
    wire.say('STOD MEMO;CRED "TEST";SAVDSTA "LONGNAME12";SAVDTIF "\\TEST\\agt4294a.tiff"')
    assert [wire.ask(f"FNAME? {k}") for k in (1, 2)] == ["LONGNAME.STA", "TEST\\"]
    assert [int(wire.ask(f'FSIZE? "{n}"')) for n in ("TEST\\", "none.txt")] == [-1, -1]
    assert wire.ask('CHAD "TEST";CWD?') == "\\TEST"
    assert [wire.ask(f"FNAME? {k}") for k in (1, 2)] == ["..\\", "agt4294a.tif"]
    wire.say('CHAD "..";RECD "LONGNAME";PURG "nothing.txt";ROPEN "LONGNAME.STA";CLOSE')
    assert [int(e.split(",")[0]) for e in wire.errors()] == [112, -256, -250]
    wire.say('FILC "LONGNAME.STA","MEMO","COPY.STA","FLASH";STOD FLASH')
    assert wire.ask("FNAME? 1") == "COPY.STA"
    assert wire.errors() == []
