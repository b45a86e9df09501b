"""A mistake in a recording is one sentence that names file and line; damaged files never cause a traceback."""

import os
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl.drivers.recordings import RecordingError, read_memory_trace, read_recording
from pzctl.drivers.recordings.text_file import LARGEST

HEAD = "# bandwidth: 5\nfrequency_Hz,R_ohm,X_ohm\n"
EXPORT = "\n".join((
    "4294A REV1.11", '"DATE: Jan 25 2018"', "", '"MEASURE PARAMETER: IMPEDANCE MAG PHASE (DEG)"', '"ADAPTER: NONE"',
    '"SWEEP TYPE: LOG FREQ"', '"NUMBER of POINTS: 3"', '"OSC LEVEL:  500 mVolt"', '"DC BIAS: OFF"', '"BW: 5"',
    '"TRACE: A"', '"FORMAT: LOG"', "",
    '"Frequency"\t"Data Trace Real"\t"Data Trace Imag"\t"Memory Trace Real"\t"Memory Trace Imag"',
    "1.0e+03\t1.3e+00\t0.0e+00\t2.3e+00\t0.0e+00", "2.0e+03\t1.4e+00\t0.0e+00\t2.4e+00\t0.0e+00",
    "3.0e+03\t1.5e+00\t0.0e+00\t2.5e+00\t0.0e+00", "", '"TRACE: B"', '"FORMAT: LINEAR"', "",
    '"Frequency"\t"Data Trace Real"\t"Data Trace Imag"\t"Memory Trace Real"\t"Memory Trace Imag"',
    "1.0e+03\t8.9e+01\t0.0e+00\t8.9e+01\t0.0e+00", "2.0e+03\t8.8e+01\t0.0e+00\t8.8e+01\t0.0e+00",
    "3.0e+03\t8.7e+01\t0.0e+00\t8.7e+01\t0.0e+00", "",
))  # fmt: skip
KEYSIGHT = (
    "!Keysight Technologies,E4990A,MY54403861,A.04.00\n!Date: Wed Mar 26 11:24:29 2025\n\nBEGIN CH1_DATA\n"
    "Frequency(Hz), |Z|(Ohm)-data, theta-z(deg)-data\n+1.0e+003, +6.0e+001, -8.0e+001\n"
    "+2.0e+003, +6.1e+001, -8.1e+001\nEND\n"
)
OWN = "# format: pzctl recording 1\n# rows: 2\n# time: 2026-01-01T00:00:00Z\n" + HEAD + "1000.0,1.0,-2.0\n2000.0,1,-1\n"
TOUCHSTONE = "! remark\n# kHz S MA R 50\n1.0\t0.9\t-20\n2.0\t0.8\t-30\n"
SEEDS = {"a.txt": EXPORT, "b.csv": KEYSIGHT, "c.csv": OWN, "d.s1p": TOUCHSTONE}


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.csv", "", ": the file is empty"),
        ("a.csv", " \n\n", ": the file is empty"),
        ("a.csv", "# only: this\n", ": no table found, only comments"),
        ("a.csv", HEAD, ": no points found; at least 2 are needed"),
        ("a.csv", HEAD + "1000,1,2\n", ": one point found; at least 2 are needed"),
        ("a.csv", HEAD + "1000,1,2\n2000,nan,2\n", ", line 4: R_ohm is nan; only finite numbers are allowed"),
        ("a.csv", HEAD + "1000,1,2\n2000,,2\n", ", line 4: R_ohm is missing"),
        ("a.csv", HEAD + "1000,1,2\n2000,1e999,2\n", ", line 4: R_ohm is 1e999, too large for a number"),
        ("a.csv", HEAD + "1000,1,2\n2000,one,2\n", ", line 4: R_ohm is 'one'; a number is needed"),
        ("a.csv", HEAD + "1000,1,2\n3000,1,2\n2000,1,2\n", ", line 5: the frequency 2000 Hz is below that of line 4"),
        ("a.csv", HEAD + "1000,1,2\n1000,1,2\n", ", line 4: the frequency 1000 Hz repeats that of line 3"),
        ("a.csv", HEAD + "1000,1,2\n2000,1\n", ", line 4: 2 values found under 3 columns"),
        ("a.csv", HEAD + "1000,1,2\n2000,1", ", line 4: 2 values found under 3 columns; the file seems to be cut off"),
        ("a.csv", HEAD + "1000,5,1,5,2,5\n", ", line 3: 6 values found under 3 columns; if these are decimal commas"),
        ("a.csv", HEAD + "0,1,2\n1000,1,2\n", ", line 3: the frequency is 0 Hz; a positive one is needed"),
        ("a.csv", HEAD + "1000,1,2\n2000,0,0\n", ", line 4: these numbers give an impedance of 0 ohm"),
        (
            "a.csv",
            HEAD + "1000,1,2\n2000,1e200,2\n",
            ", line 4: these numbers give |Z| = 1e+200 ohm, which no device has",
        ),
        (
            "a.csv",
            "# bandwidth: 3\n" + HEAD + "1000,1,2\n",
            ", line 2: bandwidth is 5, and 3 in line 1; keep the right",
        ),
        ("c.csv", "# rows: 2\n" + OWN.replace("rows: 2", "rows: 3"), ", line 3: rows is 3, and 2 in line 1; keep"),
        (
            "a.txt",
            EXPORT.replace('"BW: 5"', '"BW: 5"\n"BW: 1"'),
            ", line 11: BW is '1' here, '5' above; keep one",
        ),
        ("a.csv", HEAD + "1000,1,2\n2000,0,1e-200\n", ", line 4: these numbers give |Z| = 1e-200 ohm, which no device"),
        ("a.csv", HEAD + "0.5,1,2\n15,1,2\n", ", line 3: frequencies end at 15 Hz, but analyzers measure from 40 Hz"),
        ("a.csv", "frequency_MHz,R_ohm,X_ohm\n1e6,1,2\n2e6,1,2\n", ", line 3: the frequency is 2e+12 Hz, beyond any"),
        (
            "a.csv",
            "frequency,R_ohm,X_ohm\n1000,1,2\n2000,1,2\n",
            "line 1: column 'frequency' has no unit; Hz, kHz",
        ),
        ("a.csv", "frequency_mHz,R_ohm,X_ohm\n1,1,2\n2,1,2\n", "line 1: column 'frequency_mHz' has the unit 'mHz'"),
        (
            "a.csv",
            "frequency_Hz,|Z|_ohm,theta\n1e3,1,2\n2e3,1,2\n",
            "'theta' has no unit; a unit such as deg",
        ),
        ("a.csv", "frequency_Hz,R_furlong,X_ohm\n1e3,1,2\n2e3,1,2\n", "'R_furlong' has the unit 'furlong'"),
        (
            "a.csv",
            "frequency_Hz,|Z|_ohm,n\n1e3,1,2\n2e3,1,2\n",
            "the columns frequency_Hz, |Z|_ohm, n do not determine an",
        ),
        ("a.csv", "frequency_Hz,|Z|_ohm,Rs_ohm\n1e3,1,2\n", "|Z| and Rs (IMRS) do not say whether"),
        ("a.csv", "frequency_Hz,R_ohm,Rs_ohm,X_ohm\n1e3,1,2,3\n", "two columns give R; one is needed"),
        ("a.csv", "Freq(Hz),SWR,Return Loss(dB),Phase(deg),|Z|(ohm)\n1e3,1,2,3,4\n", "do not determine an impedance"),
        ("a.csv", "1000,1,2\n2000,1,2\n", "line 1: no frequency column among 1000, 1, 2; name it in the header row"),
        ("a.csv", "frequency_Hz;R_ohm;X_ohm\n1000.0;1,5;2\n", "line 2: R_ohm is '1,5', with a decimal comma"),
        ("a.csv", "frequency_Hz;R_ohm;X_ohm\n1000;1,500;2\n", "R_ohm is '1,500': a decimal comma, or thousands?"),
        ("a.csv", "frequency_Hz;R_ohm;X_ohm\n1.000,5;1,5;2\n", "frequency_Hz is '1.000,5', with point and comma"),
        ("a.csv", "1000;1,5;2\n2000;1,5;2\n", "or name the columns with --columns frequency_Hz,R_ohm,X_ohm"),
        ("a.csv", "# bandwidth: high\n" + HEAD, "line 1: bandwidth is high; a number that is not negative is needed"),
        ("a.csv", "# bandwidth: -1\n" + HEAD, "line 1: bandwidth is -1; a number that is not negative is needed"),
        ("a.csv", "# bias_V: [5]\n" + HEAD, "line 1: bias_V is [5]; a number is needed"),
        ("a.csv", "# sweep_seconds: 1e999\n" + HEAD, "line 1: sweep_seconds is "),
        (
            "a.csv",
            "# accuracy: good\n" + HEAD,
            "line 1: accuracy is good; a number from 1e-06 to 0.1 (0.001 for 0.1 %)",
        ),
        ("a.csv", "# accuracy: 0.1 %\n" + HEAD, "line 1: accuracy is 0.1 %; a number from 1e-06 to 0.1"),
        ("a.csv", "# accuracy: 0\n" + HEAD, "line 1: accuracy is 0; a number from 1e-06 to 0.1"),
        ("a.csv", "# estimated_seconds: long\n" + HEAD, "line 1: estimated_seconds is long; a number that is not neg"),
        ("a.csv", "# direction: sideways\n" + HEAD, "line 1: direction is sideways; up or down is needed"),
        (
            "a.csv",
            "# accuracy_relative: 0.001\n" + HEAD,
            "line 1: accuracy_relative is 0.001; a list of positive numbers, one for each point, is needed",
        ),
        ("a.csv", "# noise_relative: [0, 1e-4]\n" + OWN, "line 1: noise_relative is [0, 0.0001]; a list of positive"),
        (
            "a.csv",
            "# gain_accuracy_relative: [1e-3]\n" + OWN,
            ": gain_accuracy_relative has 1 value(s), the recording 2 points; one for each point is needed",
        ),
        ("a.csv", OWN.replace("rows: 2", "rows: 3"), ": the file is cut off: 3 points announced, 2 found"),
        ("a.txt", "A letter to a friend.\n", "line 1: no recording: 1 column(s) found"),
        ("a.csv", "\x00\x01\x02", ": this is binary data"),
        ("a.csv", "PK\x03\x04", ": this is binary data"),
        ("a.xlsx", "x", ": .xlsx is not known; known are .csv, .txt, .tsv, .s1p, .z1p, .y1p, .nc, .h5"),
        ("a", "x", ": no extension is not known"),
        ("a.txt", EXPORT.replace("POINTS: 3", "POINTS: 4"), ": trace A is cut off: 4 points announced, 3 found"),
        ("a.txt", EXPORT[:-60], "line 24: 3 values found under 5 columns; the file seems to be cut off"),
        ("a.txt", EXPORT[: EXPORT.index('"TRACE: B')], ": trace B is missing"),
        ("a.txt", EXPORT.replace("LOG FREQ", "DC BIAS"), ": SWEEP TYPE is 'DC BIAS'; a frequency sweep is needed"),
        ("a.txt", EXPORT.replace("MAG PHASE", "OF LIFE"), "'IMPEDANCE OF LIFE (DEG)' is not known; known are IMPH,"),
        ("a.txt", EXPORT.replace("2.0e+03\t8", "2.1e+03\t8"), "line 24: trace B has 2100 Hz where trace A has 2000 Hz"),
        ("b.csv", KEYSIGHT.replace("END\n", ""), "no END found; the file is cut off"),
        ("b.csv", KEYSIGHT + KEYSIGHT, "line 12: 2 channels found; save one channel to a file"),
        ("d.s1p", "1 2 3\n", "line 1: numbers before the option line"),
        ("d.s1p", "! nothing\n", "no option line found"),
        ("d.s1p", "# Hz H RI\n1e3 1 0\n", "line 1: 'H' in the option line is not known"),
        ("d.s1p", "# Hz S RI R 50\n1e3 1 0\n2e3 1 0\n", "line 2: these numbers give no finite impedance"),
        ("d.s1p", "[Version] 2.0\n", "line 1: '[Version] 2.0' belongs to Touchstone 2"),
    ],
)
def test_one_sentence_names_file_and_line(tmp_path: Path, name: str, content: str, says: str) -> None:
    file = tmp_path / name
    file.write_text(content)
    with pytest.raises(RecordingError) as caught:
        read_recording(file)
    sentence = str(caught.value)
    assert sentence.startswith(str(file))
    assert "\n" not in sentence
    assert says in sentence


def test_what_is_no_file_to_read(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No such file"):
        read_recording(tmp_path / "absent.csv")
    with pytest.raises(RecordingError, match="this is a folder"):
        read_recording(tmp_path)
    (tmp_path / "wide.csv").write_bytes("frequency".encode("utf-16"))
    with pytest.raises(RecordingError, match="UTF-16"):
        read_recording(tmp_path / "wide.csv")
    with (tmp_path / "huge.csv").open("wb") as file:
        os.truncate(file.fileno(), LARGEST + 1)
    with pytest.raises(RecordingError, match="bytes are too many; at most"):
        read_recording(tmp_path / "huge.csv")


@pytest.mark.timeout(20)
def test_a_file_of_very_many_short_lines(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    path.write_text("frequency_Hz,R_ohm,X_ohm\n" + "".join(f"{k},1,1\n" for k in range(1, 1_500_000)))
    with pytest.raises(RecordingError, match=r"long\.csv: 1500000 lines are too many; at most 1100000 are allowed"):
        read_recording(path)


def damaged(text: bytes, seed: int) -> bytes:
    """The same file with one to four defects: bytes changed, lost, doubled, swapped, cut, or inserted."""
    rng = random.Random(seed)  # noqa: S311 (no secret)
    for _ in range(rng.randint(1, 4)):
        i, j = sorted((rng.randrange(len(text) + 1), rng.randrange(len(text) + 1)))
        j = min(j, i + 40)
        scraps = (b"nan", b"1e999", b",", b"\t", b"-", b"#", b'"', b"\x00", b"\xff", b"\n", b"END", b"e", b"9" * 400)
        text = rng.choice((
            text[:i] + bytes([rng.randrange(256)]) + text[i + 1 :], text[:i] + text[j:], text[:j] + text[i:],
            text[:i] + rng.choice(scraps) + text[i:], text[:i], text[i:],
        ))  # fmt: skip
    return text


@pytest.mark.parametrize("name", SEEDS)
@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_damaged_file_gives_a_sweep_or_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, name: str, seed: int
) -> None:
    file = tmp_path_factory.getbasetemp() / name
    file.write_bytes(damaged(SEEDS[name].encode(), seed))
    try:
        sweep = read_recording(file)
        read_memory_trace(file)
    except RecordingError as error:
        says = str(error)
        assert says.isprintable(), says
        assert says.startswith(str(file))
    else:
        assert sweep.frequency.size >= 2
