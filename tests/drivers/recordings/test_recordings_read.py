"""Recordings by others and by instruments: how they are read, and the notes about them."""

import cmath
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl.drivers.recordings import (
    RecordingError,
    read_data_trace,
    read_memory_trace,
    read_recording,
    write_touchstone,
)
from pzctl.models.sweep import Sweep


def test_all_three_4294a_exports(recordings: Path) -> None:
    folder = recordings / "hp4294a-exports"
    rb = read_recording(folder / "RB5100.txt")
    assert rb.frequency.size == 601
    assert rb.impedance[0] == pytest.approx(cmath.rect(9.100274e2, math.radians(-8.883962e1)), rel=1e-3)
    assert rb.time == "2002-06-11T00:00:00.000Z"
    assert rb.notes == ()
    assert rb.settings["bandwidth"] == 1
    assert rb.settings["adapter"] == "PROBE"
    for name, first, size in (("MD1", 1.088817e3, 25.5e3), ("sampleadmittance", 1 / 1.103217e-3, 100e3)):
        sweep = read_recording(folder / f"{name}.txt")
        assert abs(sweep.impedance[0]) == pytest.approx(first)
        assert sweep.frequency[0] == size
        assert np.all(sweep.impedance.real < 0), "the numbers stay as recorded"
        assert any("inverted by 180 degrees" in note for note in sweep.notes)
        assert any("date in the file is corrupt" in note for note in sweep.notes)
        assert {k: sweep.settings[k] for k in ("oscillator_V", "bandwidth", "sweep_average", "point_average")} == {
            "oscillator_V": 0.5, "bandwidth": 5, "sweep_average": 16, "point_average": 4,
        }  # fmt: skip


def test_a_memory_trace_is_a_separate_recording(recordings: Path) -> None:
    file = recordings / "hp4294a-exports" / "RB5100.txt"
    memory = read_memory_trace(file)
    assert memory is not None
    assert abs(memory.impedance[0]) == pytest.approx(9.034574e2)
    assert memory.notes == ("This is the memory trace of the recording, not its data trace.",)
    assert read_memory_trace(file.with_name("MD1.txt")) is None


def test_e4990a_and_tables_of_others(recordings: Path) -> None:
    disk = read_recording(recordings / "disk-20x2" / "thickness-mode.csv")
    assert disk.settings["instrument"] == "Keysight Technologies,E4990A,MY54403861,A.04.00"
    assert disk.time == "2025-03-26T11:24:29.000Z"
    assert disk.frequency.size == 1601
    assert disk.impedance[0] == pytest.approx(cmath.rect(60.8781245395, math.radians(-80.8687569187)))
    assert read_recording(recordings / "disk-35x2" / "radial-mode-2.csv").frequency[-1] == 155e3
    bar = read_recording(recordings / "bar-k31" / "k31-mode.txt")
    assert bar.admittance[0] == pytest.approx(1.47e-5 + 3.57e-4j)
    foil = read_recording(recordings / "pvdf-on-kapton" / "T61.csv")
    assert foil.impedance[0] == 5.7 - 36.8j, "Rs and Xs, not the return loss and its phase"
    assert "no unit" in foil.notes[0]


def test_open_cases_are_read(cases: Path) -> None:
    files = sorted(cases.glob("*/*.csv"))
    assert len(files) == 14
    assert all(read_recording(file).settings["bandwidth"] == 5 for file in files)
    assert read_recording(cases / "drift" / "disk-2.csv").settings["direction"] == "down"


def export_4294a(f: list[float], a: list[str], b: list[str], parameter: str) -> str:
    """An ASCII export of the 4294A."""
    head = [
        "4294A REV1.11",
        '"DATE: Jan 25 2018"',
        '"S4 disk"',
        "",
        f'"MEASURE PARAMETER: {parameter}"',
        '"ADAPTER: NONE"',
    ]
    head += ['"SWEEP TYPE: LIN FREQ"', f'"NUMBER of POINTS: {len(f)}"', '"POINT DELAY TIME:  0 Sec"']
    head += ['"OSC LEVEL:  500 mVolt"', '"DC BIAS: 1.5 Volt"', '"BW: 3"', '"SWEEP AVERAGING: OFF"']
    for name, trace in (("A", a), ("B", b)):
        head += [
            "",
            "",
            f'"TRACE: {name}"',
            '"FORMAT: LINEAR"',
            "",
            '"Frequency"\t"Data Trace Real"\t"Data Trace Imag"',
        ]
        head += [f"{x:.11e}\t{y}" for x, y in zip(f, trace, strict=True)]
    return "\r\n".join(head) + "\r\n"


FORWARD: dict[str, Callable[[float, complex], tuple[float, float]]] = {
    "IMPH": lambda w, z: (abs(z), math.degrees(cmath.phase(z))),
    "AMPH": lambda w, z: (abs(1 / z), math.degrees(cmath.phase(1 / z))),
    "IRIM": lambda w, z: (z.real, z.imag),
    "ARIM": lambda w, z: ((1 / z).real, (1 / z).imag),
    "LSR": lambda w, z: (z.imag / w, z.real),
    "LSQ": lambda w, z: (z.imag / w, abs(z.imag) / z.real),
    "CSR": lambda w, z: (-1 / (w * z.imag), z.real),
    "CSQ": lambda w, z: (-1 / (w * z.imag), abs(z.imag) / z.real),
    "CSD": lambda w, z: (-1 / (w * z.imag), z.real / abs(z.imag)),
    "LPG": lambda w, z: (-1 / (w * (1 / z).imag), (1 / z).real),
    "LPQ": lambda w, z: (-1 / (w * (1 / z).imag), abs(z.imag) / z.real),
    "LPR": lambda w, z: (-1 / (w * (1 / z).imag), 1 / (1 / z).real),
    "CPG": lambda w, z: ((1 / z).imag / w, (1 / z).real),
    "CPQ": lambda w, z: ((1 / z).imag / w, abs(z.imag) / z.real),
    "CPD": lambda w, z: ((1 / z).imag / w, z.real / abs(z.imag)),
    "CPR": lambda w, z: ((1 / z).imag / w, 1 / (1 / z).real),
    "IMLS": lambda w, z: (abs(z), z.imag / w),
    "IMCS": lambda w, z: (abs(z), -1 / (w * z.imag)),
    "IMLP": lambda w, z: (abs(z), -1 / (w * (1 / z).imag)),
    "IMCP": lambda w, z: (abs(z), (1 / z).imag / w),
}
IMPEDANCES = st.builds(
    lambda size, degrees: cmath.rect(size, math.radians(degrees)),
    st.floats(1e-2, 1e7),
    st.one_of(st.floats(-85, -5), st.floats(5, 85)),
)


@pytest.mark.parametrize("parameter", FORWARD)
@settings(max_examples=15, deadline=None)
@given(z=st.lists(IMPEDANCES, min_size=2, max_size=5))
def test_every_pair_that_determines_z_is_converted(
    tmp_path_factory: pytest.TempPathFactory, parameter: str, z: list[complex]
) -> None:
    file = tmp_path_factory.getbasetemp() / f"{parameter}.txt"
    f = [1e6 * (1 + k) for k in range(len(z))]
    pairs = [FORWARD[parameter](2 * math.pi * x, v) for x, v in zip(f, z, strict=True)]
    a, b = ([f"{pair[k]:.14e}\t{0:.6e}" for pair in pairs] for k in (0, 1))
    file.write_text(export_4294a(f, a, b, parameter), newline="")
    sweep = read_recording(file)
    # |Z| with X gives R as a small difference; 14 digits keep six of it at 5 to 85 degrees
    np.testing.assert_allclose(sweep.impedance, z, rtol=1e-6 if parameter.startswith("IM") else 1e-11)
    assert sweep.settings["bias_V"] == 1.5
    assert sweep.settings["title"] == "S4 disk"


def test_complex_traces_and_the_saved_data_array(tmp_path: Path) -> None:
    file = tmp_path / "comp.txt"
    text = export_4294a([1e6, 2e6], ["5\t-40", "6\t-30"], ["1\t2", "3\t4"], "COMPLEX Z-Y")
    file.write_text(text)
    assert read_recording(file).impedance.tolist() == [5 - 40j, 6 - 30j]
    text = text.replace("COMPLEX Z-Y", "IMPEDANCE MAG PHASE (DEG)").replace("Data Trace", "Data")
    file.write_text(text)
    assert read_recording(file).impedance.tolist() == [5 - 40j, 6 - 30j], "the data array is R, X whatever is displayed"


@pytest.mark.parametrize("parameter", ["IMRS", "IMQ", "IMD"])
def test_pairs_that_lose_the_sign_of_x_are_refused(tmp_path: Path, parameter: str) -> None:
    file = tmp_path / "a.txt"
    file.write_text(export_4294a([1e6, 2e6], ["5\t0", "6\t0"], ["1\t0", "3\t0"], parameter))
    with pytest.raises(RecordingError, match="whether the device is inductive or capacitive"):
        read_recording(file)


@pytest.mark.parametrize(
    ("header", "row", "z"),
    [
        ("frequency_Hz,R_ohm,X_ohm", "1e6,3,-4", 3 - 4j),
        ("frequency_MHz;|Z|_kohm;theta_deg", "1;2;-90", -2000j),
        ("Freq [kHz]\tG (mS)\tB (mS)", "1e3\t1\t1", 500 - 500j),
        ("f/kHz\tR/Ohm\tX/Ohm", "1e3\t500\t-500", 500 - 500j),
        ('"f (Hz)","R (MΩ)","X (MΩ)"', "1e6, 1, -1", 1e6 - 1e6j),
        ("frequency_Hz,Cp_pF,D", "1e6,159.15494309189535,0", -1000j),
        ("frequency_Hz,theta_rad,|Z|_ohm,remark", "1e6,0,5,none", 5 + 0j),
        ("Frequency(Hz),|Z|(Ohm)-data,|Z|(Ohm)-mem,theta-z(deg)-data,theta-z(deg)-mem", "1e6,5,7,0,90", 5 + 0j),
        ("frequency_Hz,|Y|(S),theta-y(deg)", "1e6,0.5,90", -2j),
        ("f / Hz,Ls (µH),Rs (Ω)", "1e6,0.15915494309189535,1", 1 + 1j),
        ("frequency_Hz;R_ohm;X_ohm", "1000000;1,5;-2,25", 1.5 - 2.25j),
        ("Frequenz / MHz;Impedanz (kOhm);Phasenwinkel / °", "1,0e+00;2,0;-90,0", -2000j),
        ("Frequenz [Hz];Wirkwiderstand [Ohm];Blindwiderstand [Ohm]", "1e6;3,0;-4,0", 3 - 4j),
        ("Frequenz (Hz);Parallelkapazität (pF);Verlustfaktor", "1e6;159,15494309189535;0", -1000j),
        ("Fréquence (kHz)\tImpédance (Ω)\tPhase (degrés)", "1e3\t5,0\t0", 5 + 0j),
        ("Fréquence (Hz);Résistance (Ohm);Réactance (Ohm)", "1e6;3,0;-4,0", 3 - 4j),
        ("Frequenz [Hz];Realteil [Ohm];Imaginärteil [Ohm]", "1e6;3,0;-4,0", 3 - 4j),
        ("Frequenz [Hz];Realteil(Z) [Ohm];Imaginaerteil(Z) [Ohm]", "1e6;3,0;-4,0", 3 - 4j),
        ("Fréquence (Hz);Partie réelle (Ohm);Partie imaginaire (Ohm)", "1e6;3,0;-4,0", 3 - 4j),
        ("Frequency (Hz),Z (Ohm),Theta (deg)", "1e6,5,90", 5j),
        ("Frequency (Hz)  R (Ohm) X (Ohm)", "1e6 3   -4", 3 - 4j),
        ("Frequency (Hz);Trace |Z| (dBOhm);Trace th (deg)", "1e6;40;-90", -100j),
        ("Frequency (Hz),Trace 1: Impedance: Magnitude (dBΩ),Trace 1: Impedance: Phase (°)", "1e6,40,-90", -100j),
    ],
)
def test_columns_by_name_and_unit(tmp_path: Path, header: str, row: str, z: complex) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"# bandwidth: 5\n{header}\n{row}\n{row.replace('1', '2', 1)}\n", encoding="utf-8")
    sweep = read_recording(file)
    assert sweep.frequency[0] == pytest.approx(1e6)
    assert sweep.impedance[0] == pytest.approx(z, abs=1e-9)
    memory = read_memory_trace(file)
    assert (memory is not None) == ("-mem" in header)
    assert memory is None or memory.impedance[0] == pytest.approx(7j)


@pytest.mark.parametrize(
    ("header", "row", "sentence"),
    [
        ("frequency_Hz,|Z|_ohm", "1e6,5", "a frequency and two quantities are needed, such as |Z| and its phase"),
        ("frequency_Hz,|Z|_ohm,remark", "1e6,5,none", "the phase is needed beside |Z|"),
        ("frequency_Hz,|Z|_dB,theta_deg", "1e6,5,0", "column '|Z|_dB' has the unit 'dB'; a unit such as ohm is needed"),
    ],
)
def test_a_table_that_gives_no_impedance_is_refused(tmp_path: Path, header: str, row: str, sentence: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"{header}\n{row}\n{row.replace('1', '2', 1)}\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        read_recording(file)


@pytest.mark.parametrize("rows", ["1e6,3,-4\n2e6,3,-4", "1e6 3 -4\n2e6 3 -4", "f;R;X\n1e6;3,0;-4,0\n2e6;3,0;-4,0"])
def test_a_table_without_known_header_has_the_named_columns(tmp_path: Path, rows: str) -> None:
    file = tmp_path / "a.txt"
    file.write_text(f"# bandwidth: 3\n{rows}\n")
    sweep = read_recording(file, "frequency_Hz,R_ohm,X_ohm")
    assert sweep.frequency.tolist() == [1e6, 2e6]
    assert sweep.impedance.tolist() == [3 - 4j, 3 - 4j]
    assert sweep.settings["bandwidth"] == 3
    with pytest.raises(RecordingError, match="3 values found under 4 columns"):
        read_recording(file, "frequency_Hz,R_ohm,X_ohm,note")
    with pytest.raises(RecordingError, match="do not determine an impedance"):
        read_recording(file, "frequency_Hz,-,R_ohm")


@pytest.mark.parametrize("signed", [True, False])
def test_d_with_the_sign_of_the_susceptance_makes_no_negative_resistance(tmp_path: Path, signed: bool) -> None:
    """Between resonance and antiresonance a device is inductive: Cp < 0, and some meters write D = G/B."""
    rows = ((1e6, 1e-9, 0.02), (1.1e6, 2e-9, 0.03), (1.2e6, -1e-9, 0.05), (1.3e6, -5e-10, 0.04), (1.4e6, 5e-10, 0.02))
    file = tmp_path / "cpd.csv"
    lines = (f"{f},{cp},{-d if signed and cp < 0 else d}" for f, cp, d in rows)
    file.write_text("frequency_Hz,Cp_F,D\n" + "\n".join(lines) + "\n")
    sweep = read_recording(file)
    want = [1 / (2 * math.pi * f * (abs(cp) * d + 1j * cp)) for f, cp, d in rows]
    np.testing.assert_allclose(sweep.impedance, want)
    assert ("D is written with the sign of the reactance beside it; its size is used." in sweep.notes) == signed


def test_e4990a_with_title_bias_and_memory(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(
        "!Agilent Technologies,E4990A,MY521012345,A.02.10\n!Date: once upon a time\nBEGIN CH1_DATA\nTitle, disk\n"
        "Frequency(Hz), Cp(F)-data, Cp(F)-mem, D-data, D-mem\n"
        "+1.0e+006, +1.0e-009, +2.0e-009, +0.0e+000, +0.0e+000\n"
        "+2.0e+006, +1.0e-009, +2.0e-009, +0.0e+000, +0.0e+000\nEND\n"
    )
    sweep, memory = read_recording(file), read_memory_trace(file)
    assert memory is not None
    assert sweep.admittance[0] == pytest.approx(2j * math.pi * 1e6 * 1e-9)
    assert memory.admittance[0] == pytest.approx(2j * math.pi * 1e6 * 2e-9)
    assert "date in the file is corrupt" in sweep.notes[0]


def test_a_downward_sweep_is_reversed(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("# noise_relative: [3e-3, 2e-3, 1e-3]\nfrequency_Hz,R_ohm,X_ohm\n3000,3,0\n2000,2,0\n1000,1,0\n")
    sweep = read_recording(file)
    assert sweep.settings["noise_relative"] == [1e-3, 2e-3, 3e-3]
    assert sweep.frequency.tolist() == [1000, 2000, 3000]
    assert sweep.impedance.tolist() == [1, 2, 3]
    assert sweep.settings["direction"] == "down"


@pytest.mark.parametrize("form", ["RI", "MA", "DB"])
@pytest.mark.parametrize("kind", ["S", "Z", "Y"])
def test_touchstone_is_read_as_scikit_rf_reads_it(tmp_path: Path, kind: str, form: str) -> None:
    file = tmp_path / f"a.{kind.lower()}1p"
    r = 1 if kind == "Y" else 75  # scikit-rf 2.2 multiplies y by R where the definition, y = Y R, divides
    file.write_text(f"! by another program: 5\n# kHz {kind} {form} R {r}\n1000\t.3\t-20 ! inline\n2000\t.4\t30\n")
    import skrf  # imported late: it takes half a second, in each process of a test run

    network = skrf.Network(str(file))
    sweep = read_recording(file)
    np.testing.assert_allclose(sweep.frequency, network.f)
    np.testing.assert_allclose(sweep.impedance, network.z[:, 0, 0], rtol=1e-9)
    assert any(f"normalised to {r} ohm" in note for note in sweep.notes) == (kind != "S")


def test_touchstone_admittance_is_normalised_to_the_reference(tmp_path: Path) -> None:
    file = tmp_path / "a.y1p"
    file.write_text("# Hz Y RI R 50\n1000 2 0\n2000 0 4\n")
    assert read_recording(file).impedance.tolist() == [25, -12.5j]


def test_the_analyzers_own_touchstone(tmp_path: Path) -> None:
    file = tmp_path / "A.S1P"
    file.write_text("# KHZ S MA R 50\r\n4.00009600000e+03\t3.33353237003e-01\t9.86914411187e-02\r\n5e3\t0\t0\r\n")
    sweep = read_recording(file)
    assert sweep.frequency[0] == pytest.approx(4000096)
    assert sweep.impedance[0] == pytest.approx(100, rel=2e-3)


def test_binary_data_trace_takes_its_frequencies_from_the_caller(tmp_path: Path) -> None:
    file = tmp_path / "data_dt.dat"
    size, phase = np.array([5, 6], ">c16"), np.array([90, 0], ">c16")
    file.write_bytes(b"\0" * 29 + size.tobytes() + b"\0" * 10 + phase.tobytes())
    sweep = read_data_trace(file, np.array([1e6, 2e6]), "IMPH")
    np.testing.assert_allclose(sweep.impedance, [5j, 6], atol=1e-12)
    with pytest.raises(RecordingError, match="2 points found for 3 frequencies"):
        read_data_trace(file, np.array([1e6, 2e6, 3e6]), "IMPH")
    with pytest.raises(RecordingError, match="holds no frequencies"):
        read_recording(file)
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(RecordingError, match="102 bytes cannot be two complete traces"):
        read_data_trace(file, np.array([1e6, 2e6]), "IMPH")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.s1p", "# Hz S RI R 50\n1e6 0 0\n2e6 .5 0\n"),
        ("a.csv", "Frequency(Hz),Return Loss(dB),Rs,Xs\n1e6,-60,50,0\n2e6,-6,150,0\n"),
    ],
)
def test_a_network_analyzer_is_as_accurate_as_its_reflection(tmp_path: Path, name: str, text: str) -> None:
    """d ln Z = 2 d Gamma / (1 - Gamma^2)."""
    file = tmp_path / name
    file.write_text(text)
    sweep = read_recording(file)
    assert sweep.settings["accuracy_relative"] == pytest.approx([0.02, 0.02 / 0.75])
    assert any("network analyzer" in note for note in sweep.notes)


def test_an_impedance_analyzers_sweep_in_a_touchstone_file_is_none_of_a_network_analyzer(tmp_path: Path) -> None:
    file = tmp_path / "a.s1p"
    write_touchstone(Sweep(np.array([1e6, 2e6]), np.array([50 + 1j, 40 + 2j]), settings={"bandwidth": 5}), file)
    assert "accuracy_relative" not in read_recording(file).settings


def test_several_values_of_a_key_for_people_are_noted(tmp_path):
    head = "# operator: Ana\n# operator: Ana\n# batch: 7\n# operator: Ben\n# note: a\n# note: b\n# batch: 7\n"
    (tmp_path / "disk.csv").write_text(head + "frequency_Hz,R_ohm,X_ohm\n1e6,1,-2\n2e6,1,-1\n")
    sweep = read_recording(tmp_path / "disk.csv")
    told = "operator is given 3 times, first as Ana (line 1); the last one counts: Ben (line 4)."
    assert sweep.notes == ("a", "b", told)
    assert sweep.settings["operator"] == "Ben"
