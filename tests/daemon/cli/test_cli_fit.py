"""`pzctl fit` as a user calls it: real recordings, JSON, and one clear sentence for every mistake."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.drivers.recordings import read_memory_trace, read_recording, write_csv
from pzctl.models.base.errors import PzctlError
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.sweep import Sweep

DISK_20X2 = """
name = "disk-20x2"
diameter_mm = 20.0
[[layers]]
name = "disk"
kind = "piezo"
material = "PZT-5A"
thickness_mm = { value = 2.013, u = 0.002 }
density_kg_m3 = 7956                          # 5.0315 g
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
"""


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["fit", *map(str, words)])


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "disk-20x2.toml").write_text(DISK_20X2)
    return tmp_path


def test_a_disk_that_one_dimensional_models_do_not_describe(here: Path, recordings: Path) -> None:
    done = run("--json", "--build", "disk-20x2.toml", f"disk={recordings / 'disk-20x2' / 'thickness-mode.csv'}")
    answer = json.loads(done.stdout)
    assert done.exit_code == 0
    assert answer["rms_log_error"] == pytest.approx(0.66, abs=0.03)
    assert any("1-D model does not describe" in sentence for sentence in answer["says"])
    (hint,) = (sentence for sentence in answer["says"] if "Diameter/thickness is 9.9" in sentence)
    assert "`--fitter disk2d`" in hint


def test_the_picture_and_the_table(here: Path, cases: Path) -> None:
    done = run("--build", cases / "null" / "build.toml", f"disk={cases / 'null' / 'disk.csv'}", "--picture", "fit.svg")
    assert done.exit_code == 0
    assert "disk.c33D" in done.stdout
    assert "picture: fit.svg" in done.stdout
    assert "<svg" in (here / "fit.svg").read_text()


def test_the_analyzers_own_equivalent_circuit_is_recovered(here: Path, recordings: Path) -> None:
    export = recordings / "hp4294a-exports" / "RB5100.txt"
    memory = read_memory_trace(export)
    assert memory is not None
    done = run("--json", "--fitter", "bvd", f"device={export}@memory")
    constants = {name: value["re"] for name, value in json.loads(done.stdout)["constants"].items()}
    branch = Branch(constants["branch1.R"], constants["branch1.L"], constants["branch1.C"])
    model = Lumped(constants["C0"], (branch,), tan_delta=constants["C0.tan_delta"])
    assert np.max(np.abs(np.log(model.impedance(memory.frequency) / memory.impedance))) < 0.01


def test_pictures_of_a_device_without_a_build_have_the_name_of_its_recording(here: Path) -> None:
    f = np.linspace(1e6, 3e6, 101)
    circuit = Lumped(1e-9, (Branch(20.0, 1e-4, 6.3e-11),))
    noise = 1e-3 * np.random.default_rng(0).normal(size=(2, f.size))
    write_csv(Sweep(f, circuit.impedance(f) * np.exp(noise[0] + 1j * noise[1])), here / "probe-7.csv")
    for command, picture in (("fit", "probe-7-sensor-bvd.png"), ("diagnose", "probe-7-diagnosis.png")):
        done = CliRunner().invoke(app, [command, "--fitter", "bvd", "sensor=probe-7.csv"])
        assert f"picture: {picture}" in done.output
        assert (here / picture).exists()


def test_the_fitted_circuit_is_near_the_analyzers(here: Path, recordings: Path) -> None:
    """The analyzer's values: C0 1.554 nF, C1 0.6368 nF, L1 1.668 mH; its R1 of 21.7 ohm comes from the peak of G."""
    done = run("--json", "--fitter", "bvd", f"device={recordings / 'hp4294a-exports' / 'RB5100.txt'}")
    constants = {name: value["re"] for name, value in json.loads(done.stdout)["constants"].items()}
    assert constants["C0"] == pytest.approx(1.554e-9, rel=0.01)
    assert constants["branch1.C"] == pytest.approx(0.6368e-9, rel=0.01)
    assert constants["branch1.L"] == pytest.approx(1.668e-3, rel=0.01)


@pytest.mark.parametrize("name", ["MD1", "sampleadmittance"])
def test_an_inverted_export_is_turned_round_as_in_a_diagnosis(here: Path, recordings: Path, name: str) -> None:
    sweep = read_recording(recordings / "hp4294a-exports" / f"{name}.txt")
    write_csv(replace(sweep, frequency=sweep.frequency[::4], impedance=sweep.impedance[::4]), here / "inverted.csv")
    done = run("--json", "--fitter", "bvd", "device=inverted.csv")
    assert "inverted by 180 degrees" in done.stderr
    answer = json.loads(done.stdout)
    assert answer["says"][0].startswith("The recording of device is inverted: fits take it turned round")
    assert answer["constants"]["C0"]["re"] > 0


@pytest.mark.parametrize(("how", "turn"), [("inverted", np.negative), ("conjugated", np.conj)])
def test_a_turned_recording_has_the_constants_of_the_right_one(
    here: Path, cases: Path, how: str, turn: Callable[..., Any]
) -> None:
    sweep = read_recording(cases / "null" / "disk.csv")
    write_csv(replace(sweep, impedance=turn(sweep.impedance)), here / "turned.csv")
    build = cases / "null" / "build.toml"
    right = json.loads(run("--json", "--build", build, f"disk={cases / 'null' / 'disk.csv'}").stdout)
    turned = json.loads(run("--json", "--build", build, "disk=turned.csv").stdout)
    assert turned["says"][0].startswith(f"The recording of disk is {how}: fits take it turned round")
    assert turned["constants"]["disk.c33D"]["re"] == pytest.approx(right["constants"]["disk.c33D"]["re"], rel=1e-6)
    assert turned["chi2_per_dof"] == pytest.approx(right["chi2_per_dof"], rel=1e-3)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["disk"], "'disk' is not STEP=FILE"),
        (["good.csv"], "'good.csv' is not STEP=FILE; say of which step it is the recording, for example disk=good.csv"),
        (["disk=nothing.csv"], "nothing.csv"),
        (["--fitter", "masn", "disk=good.csv"], "did you mean 'mason'"),
        (["--build", "nothing.toml", "disk=good.csv"], "nothing.toml"),
        (["--free", "disk.c44", "--build", "disk-20x2.toml", "disk=good.csv"], "cannot free 'disk.c44'"),
        (["--build", "disk-20x2.toml", "ml1=good.csv"], "step 'ml1' is not in build 'disk-20x2', which has disk"),
        (["disk=good.csv"], "can only be fitted with a build file: give --build (`pzctl new` writes one), or"),
        (["--build", "disk-20x2.toml", "disk=nan.csv"], "nan"),
        (["--build", "disk-20x2.toml", "disk=one.csv"], "one.csv"),
        (["--build", "disk-20x2.toml", "disk=twice.csv"], "twice.csv"),
        (["--build", "disk-20x2.toml", "disk=unsorted.csv"], "unsorted.csv"),
    ],
)
def test_wrong_input_is_one_sentence(here: Path, words: list[str], sentence: str) -> None:
    header = "frequency_Hz,R_ohm,X_ohm\n"
    rows = [f"{1e6 + 1e4 * k},{1.0},{-100.0 + k}\n" for k in range(30)]
    (here / "good.csv").write_text(header + "".join(rows))
    (here / "one.csv").write_text(header + rows[0])
    (here / "nan.csv").write_text(header + "".join(rows) + "2e6,nan,-70\n")
    (here / "twice.csv").write_text(header + "".join([*rows, rows[-1]]))
    (here / "unsorted.csv").write_text(header + "".join([*rows, rows[0]]))
    done = run(*words)
    assert done.stdout == ""
    assert isinstance(done.exception, PzctlError)
    assert sentence.casefold() in str(done.exception).casefold()
    assert "\n" not in str(done.exception)
    assert not list(here.glob("*.png"))
