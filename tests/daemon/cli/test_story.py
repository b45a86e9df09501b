"""The main job as a user does it: `pzctl measure --fit` with the real command, sockets and processes."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD

PZCTL = Path(sys.executable).with_name("pzctl")


def pzctl(*words: str, home: Path) -> "subprocess.CompletedProcess[str]":
    """Run the command line on its own data folder."""
    environment = {**os.environ, "PZCTL_HOME": str(home)}
    environment.pop("PZCTL_FITTERS")  # a daemon's own choice
    return subprocess.run(
        [PZCTL, *words], env=environment, capture_output=True, text=True, timeout=280, check=False, cwd=home
    )


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """All steps on the simulated bench, with fewer points than usual, fitted by both fitters."""
    home = tmp_path_factory.mktemp("home")
    (home / "S4.toml").write_text(THESIS_BUILD.read_text(encoding="utf-8").replace("points = 801", "points = 201"))
    words = ("measure", "--build", "S4.toml", "--fit", "--json", "--time-scale", "0")
    done = pzctl(*words, "--fitter", "mason", "--fitter", "mason-nelder-mead", home=home)
    assert done.returncode == 0, done.stderr
    assert "no daemon runs: starting one" in done.stderr
    assert not (home / "daemon.json").exists(), "the daemon of the story is still there"
    return json.loads(done.stdout)


def fit_of(story: dict[str, Any], fitter: str, steps: list[str]) -> dict[str, Any]:
    return next(fit for fit in story["fits"] if fit["fitter"] == fitter and fit["steps"] == steps)


@pytest.mark.parametrize("steps", [["disk"], ["disk", "ml1"], ["disk", "ml1", "ml2"]])
def test_every_constant_comes_back_within_its_uncertainty(story: dict[str, Any], steps: list[str]) -> None:
    fit = fit_of(story, "mason", steps)
    assert fit["converged"]
    assert 0.8 < fit["chi2_per_dof"] < 1.25
    for name, constant in fit["constants"].items():
        for part in ("re", "im"):
            if constant[f"u_{part}"]:
                error = abs(constant[part] - story["truth"][name][part]) / constant[f"u_{part}"]
                assert error < 4, f"{name}.{part} is {error:.1f} uncertainties from the truth"


def test_a_later_step_keeps_the_earlier_constants_uncertain(story: dict[str, Any]) -> None:
    alone, stacked = (fit_of(story, "mason", steps)["constants"] for steps in (["disk"], ["disk", "ml1", "ml2"]))
    assert 0 < stacked["disk.c33D"]["u_re"] <= alone["disk.c33D"]["u_re"]
    assert stacked["disk.c33D"]["re"] != alone["disk.c33D"]["re"]


def test_held_constants_are_listed_as_held(story: dict[str, Any]) -> None:
    glue = fit_of(story, "mason", ["disk", "ml1"])["constants"]["glue1.c"]
    assert not glue["free"]
    assert glue["u_re"] == 0


def test_the_baseline_answers_without_uncertainties_and_fits_worse(story: dict[str, Any]) -> None:
    steps = ["disk", "ml1", "ml2"]
    baseline, mason = (fit_of(story, name, steps) for name in ("mason-nelder-mead", "mason"))
    assert baseline["constants"]["disk.c33D"]["u_re"] is None
    assert baseline["rms_log_error"] > mason["rms_log_error"]


def test_pictures_are_drawn(story: dict[str, Any]) -> None:
    for fit in story["fits"]:
        assert Path(fit["picture"]).read_bytes().startswith(b"\x89PNG")
