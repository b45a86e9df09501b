"""Notes on a measurement: from command, build file, page and reader to journal, report, export and queries."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest
from journal_fits import disk_build, put_fit
from page_requests import ask
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import BuildError, parse_build
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.samples import measurement_notes
from pzctl.daemon.samples.measurement_notes import ReaderError, noted_build, with_earlier_masses
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.population.trend import trend
from pzctl.models.base.errors import PzctlError
from pzctl.models.build import Build, Quantity
from pzctl.models.materials import find


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The simulated disk, measured with everything noted."""
    folder = tmp_path_factory.mktemp("noted")
    words = (
        "--operator",
        "Ana",
        "--temperature",
        "23,4",
        "--mass",
        "0,7894:0.0004",
        "--batch",
        "B7",
        "--barcode",
        "0012",
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(folder))
        done = run("measure", "--step", "disk", "--fit", "--time-scale", "0", *words, "--note", "jig=3", "--json")
        assert done.exit_code == 0, done.stderr
        yield folder


def test_notes_are_in_journal_report_export_table_and_page(measured: Path, tmp_path: Path) -> None:
    (sample,) = json.loads(run("samples", "--json").stdout)["samples"]
    notes = sample["measurements"][0]["metadata"]
    kept = {"operator": "Ana", "temperature_C": 23.4, "batch": "B7", "barcode": "0012", "jig": 3.0}
    assert {key: notes[key] for key in kept} == kept, "a barcode stays a text, a free key reads as a number"
    assert notes["mass_g"] == pytest.approx(0.7894)
    assert json.loads(run("show", "thesis", "--json").stdout)["steps"][0]["metadata"] == notes
    assert "operator Ana, temperature_C 23.4" in run("show", "thesis").stdout
    assert run("report", "thesis", "--out", tmp_path / "r.html").exit_code == 0
    assert "operator Ana, temperature_C 23.4, batch B7" in (tmp_path / "r.html").read_text(encoding="utf-8")
    for form in ("csv", "netcdf", "hdf5"):
        (path, _) = json.loads(run("export", "thesis", "--to", tmp_path, "--format", form, "--json").stdout)["files"]
        if form != "netcdf":
            settings = read_recording(Path(path)).settings
            assert (settings["operator"], settings["temperature_C"], settings["bandwidth"]) == ("Ana", 23.4, 5)
    run("samples", "--constants", "--csv", tmp_path / "t.csv")
    header, first, *_ = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    cells = dict(zip(header.split(","), first.split(","), strict=False))
    assert (cells["operator"], cells["temperature_C"], cells["batch"]) == ("Ana", "23.4", "B7")
    assert float(cells["mass_g"]) == pytest.approx(0.7894)
    page = json.loads(ask("/api/record/thesis")[2])
    assert page["steps"][0]["metadata"] == notes


def test_the_density_comes_from_the_balance(measured: Path) -> None:
    (step,) = json.loads(run("show", "thesis", "--json").stdout)["steps"]
    density = step["fits"][0]["constants"]["disk.density"]
    assert density["u_re"] / density["re"] < 5e-3, "the library's alone is 1 %"


def test_an_earlier_mass_is_kept_for_the_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    mass = Quantity(1e-3, u=1e-6, source="balance")
    put_noted(tmp_path, disk_build("S1").noted("disk", mass=mass))
    assert with_earlier_masses(disk_build("S1")).steps[0].mass == mass
    newer = Quantity(2e-3, u=1e-6, source="balance")
    assert with_earlier_masses(disk_build("S1").noted("disk", mass=newer)).steps[0].mass == newer
    assert with_earlier_masses(disk_build("S2")).steps[0].mass is None


def put_noted(home: Path, *builds: Build, c33D: Callable[[Build], float] = lambda _: 1.5e11) -> None:
    journal = JournalWriter(home / "journal")
    for build in builds:
        put_fit(journal, build.name, c33D(build), build=build)
    journal.close()


def test_a_reader_is_read_and_its_failure_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints(
        EntryPoint(name, f"{__name__}:{name}", measurement_notes.GROUP) for name in ("thermometer", "broken")
    )
    monkeypatch.setattr(measurement_notes, "entry_points", lambda group: points)
    monkeypatch.setattr(EntryPoint, "load", lambda point: globals()[point.name])
    build = noted_build(disk_build("S1"), "disk", {"operator": "Ana"}, None, ["thermometer"])
    assert build.metadata == {"temperature_C": 21.5, "operator": "Ana"}
    assert noted_build(build, "disk", {"temperature_C": 30.0}, None, ["thermometer"]).metadata["temperature_C"] == 30.0
    with pytest.raises(ReaderError, match="reader 'broken' cannot read: no sensor"):
        noted_build(build, "disk", {}, None, ["broken"])
    with pytest.raises(ReaderError, match=r"reader 'thermometr' is not installed; .* did you mean 'thermometer'"):
        noted_build(build, "disk", {}, None, ["thermometr"])


def thermometer() -> dict[str, float]:
    return {"temperature_C": 21.5}


def broken() -> dict[str, float]:
    raise OSError("no sensor")


def test_notes_of_a_build_file_and_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    text = 'name = "S1"\ndiameter_mm = 16.0\nlayers = [{ name = "disk", kind = "piezo", material = "Pz27", '
    text += (
        'thickness_mm = 0.5 }]\nload = { back = "air", front = "air" }\nsteps = [{ name = "disk", layers = ["disk"] }]'
    )
    text += "\n"
    build = parse_build(text + '[measurement]\noperator = "Ana"\nhumidity_percent = 41\n')
    assert build.metadata == {"operator": "Ana", "humidity_percent": 41}
    with pytest.raises(BuildError, match=r"measurement\.temperature_C is 'warm'; a number is needed"):
        parse_build(text + '[measurement]\ntemperature_C = "warm"\n')
    body = json.dumps({"step": "disk", "metadata": {"operator": "a\nb"}}).encode()
    status, _, answer = ask("/api/measure", method="POST", body=body, origin="http://127.0.0.1:8294")
    assert (status, b"metadata.operator" in answer) == (400, True)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--mass", "0.7"], "--mass needs --step"),
        (["--step", "disk", "--mass", "0.7"], "is not GRAMS:UNCERTAINTY, for example 0.7891:0.0005"),
        (["--note", "humidity"], "--note 'humidity' is not KEY=VALUE"),
        (["--note", "time=3"], "'time' has a meaning of its own in files"),
        (["--note", "temperature_C=warm"], "--note.temperature_C is 'warm'; a number is needed"),
        (["--operator", " "], "metadata.operator is ' '; blanks before or behind a name are not allowed"),
    ],
)
def test_wrong_notes_are_one_sentence_before_anything_starts(words: list[str], sentence: str) -> None:
    done = run("measure", *words)
    assert isinstance(done.exception, PzctlError)
    assert sentence in str(done.exception)


def test_constants_against_temperature(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    temperatures = [15.0, 20.0, 25.0, 30.0, 40.0, 50.0]
    plain = disk_build("S1")
    niobate = replace(plain, layers=tuple(replace(layer, material="LiNbO3 Z") for layer in plain.layers))
    builds = [niobate.noted("disk", {"temperature_C": t}) for t in temperatures]
    wobble = np.random.default_rng(2).normal(0, 2e6, 6).tolist()

    def c33D(build: Build) -> float:
        t = float(build.metadata["temperature_C"])
        return 1.5e11 * (1 - 120e-6 * (t - 25)) + wobble[temperatures.index(t)]

    put_noted(tmp_path, *builds, c33D=c33D)
    done = run("trend", "S1", "disk.c33D", "--picture", tmp_path / "t.png", "--json")
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)["constants"]["disk.c33D"]
    (slope,) = found["relative"]
    assert abs(slope["value"] + 120e-6) < 3 * slope["u"]
    assert slope["u"] < 1e-6
    assert abs(found["value"]["value"] - 1.5e11) < 3 * found["value"]["u"]
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    assert found["library"]["value"] == find("LiNbO3 Z").temperature["c33D"].re
    assert "Smith and Welsh" in found["library"]["source"]
    table = run("trend", "S1").stdout
    assert "disk.c33D" in table
    assert "library's a1" in table
    assert "1e-6/K" in table
    assert "disk.kt" not in table, "it is the same at all temperatures"
    for words, sentence in (
        (["disk.c33"], "no fit has constant 'disk.c33' with temperature_C noted"),
        (["disk.c33D", "--against", "jig"], "no fit has constant 'disk.c33D' with jig noted"),
    ):
        assert sentence in str(run("trend", "S1", *words).exception)
    put_noted(tmp_path, disk_build("S2").noted("disk", {"temperature_C": 22.5}))
    once = str(run("trend", "S2").exception)
    assert "only at 22.5; a trend of degree 1 needs at least 3 measurements, at 2 or more different values" in once
    assert str(run("trend", "nosuch").exception) == str(run("show", "nosuch").exception)


def test_a_trend_recovers_both_coefficients_and_states_its_uncertainty() -> None:
    rng, x = np.random.default_rng(4), np.linspace(10, 60, 11)
    pulls: list[float] = []
    for _ in range(200):
        y = 8e-9 * (1 + 4e-3 * (x - 25) + 2e-5 * (x - 25) ** 2) + rng.normal(0, 2e-11, x.size)
        found = trend(x.tolist(), y.tolist(), 2, 25.0)
        pulls += [
            (found.relative[0].value - 4e-3) / found.relative[0].u,
            (found.relative[1].value - 2e-5) / found.relative[1].u,
        ]
    assert abs(float(np.mean(pulls))) < 0.2
    assert 0.9 < float(np.std(pulls)) < 1.35, "Student's t with 8 degrees of freedom: 1.15"
    with pytest.raises(PzctlError, match="3 measurement\\(s\\); a trend of degree 2 needs at least 4"):
        trend([1, 2, 3], [1, 2, 3], 2, 25.0)
