"""`pzctl new` as a person answers it; what it writes is what `pzctl measure` reads."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from pzctl.daemon.cli import app
from pzctl.daemon.files.builds.build_file import read_build
from pzctl.models.base.errors import PzctlError
from pzctl.models.materials import MATERIALS


def answer(out: Path, *answers: str) -> Result:
    return CliRunner().invoke(app, ["new", str(out)], input="\n".join(answers) + "\n")


def test_a_disk_with_two_layers(tmp_path: Path) -> None:
    layer = ["y", "epoxy", "0.01", "0.005", "epoxy", "0.14", "0.002"]
    done = answer(tmp_path / "S4.toml", "S4", "16", "Pz27", "0.512", "0.001", *layer, *layer, "n", "air", "water")
    assert done.exit_code == 0, done.stderr
    build = read_build(tmp_path / "S4.toml")
    assert [(step.name, step.layers) for step in build.steps] == [
        ("disk", ("disk",)),
        ("ml1", ("disk", "glue1", "ml1")),
        ("ml2", ("disk", "glue1", "ml1", "glue2", "ml2")),
    ]
    assert build.layer("disk").values["thickness"].re == pytest.approx(0.512e-3)
    assert (build.back.name, build.front.name) == ("air", "water")
    near = build.plan.segments[0]
    assert near.start_Hz < 4.2e6 < near.stop_Hz, "the half-wave resonance lies within"
    text = (tmp_path / "S4.toml").read_text()
    assert "#   c33D = 1.44(8)e11" in text
    assert "Ferroperm data sheet" in text


def test_wrong_answers_are_asked_again(tmp_path: Path) -> None:
    done = answer(
        tmp_path / "b.toml", "S1", "-3", "16", "water", "pz28x", "?", "Pz27", "0.5", "0.001", "n", "air", "air"
    )
    assert done.exit_code == 0, done.stderr
    assert "-3 is not possible" in done.stderr
    assert "possible: " in done.stderr
    assert [layer.material for layer in read_build(tmp_path / "b.toml").layers] == ["Pz27"]


def test_as_json_nothing_else_is_on_standard_output(tmp_path: Path) -> None:
    answers = "\n".join(("S1", "16", "Pz27", "0.5", "0.001", "n", "air", "air"))
    words = [Path(sys.executable).with_name("pzctl"), "new", tmp_path / "b.toml", "--json"]
    done = subprocess.run(words, input=answers, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == {"file": str(tmp_path / "b.toml"), "build": "S1", "steps": ["disk"]}


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / "b.toml").write_text("mine")
    done = answer(tmp_path / "b.toml")
    assert isinstance(done.exception, PzctlError)
    assert (tmp_path / "b.toml").read_text() == "mine"


@pytest.mark.parametrize("material", [one.name for one in MATERIALS if "c33D" in one.values])
def test_every_piezo_material_makes_a_build(tmp_path: Path, material: str) -> None:
    done = answer(tmp_path / "b.toml", "S1", "10", material, "1", "0.001", "n", "air", "air")
    assert done.exit_code == 0, done.exception
    assert read_build(tmp_path / "b.toml").layer("disk").material == material
