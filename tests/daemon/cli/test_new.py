"""`pzctl new` with a person's answers; `pzctl measure` can read the file that it writes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import read_build
from pzctl.fitters.interface import FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.base.errors import PzctlError
from pzctl.models.materials import MATERIALS
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.sample import sample


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


def test_a_decimal_comma_gets_the_hint_of_the_build_file(tmp_path: Path) -> None:
    done = answer(tmp_path / "S4.toml", "S4", "16,0", "wide", *[""] * 20)
    assert done.exit_code == 0
    assert "'16,0' is not possible; write numbers with a point, not as '16,0'" in done.stderr
    assert "'wide' is not possible; a positive number is needed" in done.stderr


@pytest.mark.parametrize("more", [(), (*[""] * 12, "y")], ids=["Enter everywhere", "a second layer"])
def test_the_proposed_answers_are_a_build_of_the_simulated_bench(tmp_path: Path, more: tuple[str, ...]) -> None:
    done = answer(tmp_path / "S4.toml", *more, *[""] * 20)
    assert done.exit_code == 0, done.stderr
    build, on_the_bench, rng = read_build(tmp_path / "S4.toml"), sample(0), np.random.default_rng(1)
    f = np.linspace(1e6, 12e6, 400)
    noise = 1 + 3e-5 * (rng.standard_normal((3, 400)) + 1j * rng.standard_normal((3, 400)))
    names = [step.name for step in build.steps]
    sweeps = {
        name: (Sweep(f, on_the_bench.stack(name).impedance(f) * noisy),)
        for name, noisy in zip(names, noise, strict=False)
    }
    result = Mason().fit(FitTask(build, sweeps))
    assert names == ["disk", "ml1", "ml2"][: len(names)]
    assert len(names) == (3 if more else 2)
    assert result.chi2_per_dof < 1.3
    assert result.constants["ml1.z"].re == pytest.approx(on_the_bench.truth()["ml1.z"]["re"], rel=0.1)


def test_wrong_answers_are_asked_again(tmp_path: Path) -> None:
    done = answer(
        tmp_path / "b.toml", "S1", "-3", "16", "water", "pz28x", "?", "Pz27", "0.5", "0.001", "n", "air", "air"
    )
    assert done.exit_code == 0, done.stderr
    assert "-3 is not possible" in done.stderr
    assert "possible: " in done.stderr
    assert [layer.material for layer in read_build(tmp_path / "b.toml").layers] == ["Pz27"]


def test_with_json_standard_output_has_nothing_else(tmp_path: Path) -> None:
    answers = "\n".join(("S1", "16", "Pz27", "0.5", "0.001", "n", "air", "air"))
    words = [Path(sys.executable).with_name("pzctl"), "new", tmp_path / "b.toml", "--json"]
    done = subprocess.run(words, input=answers, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == {"file": str(tmp_path / "b.toml"), "build": "S1", "steps": ["disk"]}


def test_an_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "b.toml").write_text("mine")
    done = answer(tmp_path / "b.toml")
    assert isinstance(done.exception, PzctlError)
    assert (tmp_path / "b.toml").read_text() == "mine"


@pytest.mark.parametrize("material", [one.name for one in MATERIALS if "c33D" in one.values])
def test_every_piezo_material_makes_a_build(tmp_path: Path, material: str) -> None:
    done = answer(tmp_path / "b.toml", "S1", "10", material, "1", "0.001", "n", "air", "air")
    assert done.exit_code == 0, done.exception
    assert read_build(tmp_path / "b.toml").layer("disk").material == material
