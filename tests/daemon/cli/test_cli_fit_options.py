"""The options of `pzctl fit` for free constants and fit methods: they take effect, and each mistake is one sentence."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.models.base.errors import PzctlError


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["fit", *map(str, words)])


@pytest.fixture
def disk(cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.chdir(tmp_path)
    return ["--build", str(cases / "null" / "build.toml"), f"disk={cases / 'null' / 'disk.csv'}"]


def test_intervals_and_budget_are_in_the_json(disk: list[str]) -> None:
    done = run("--json", "--uncertainty", "profile", "--hold", "disk.density", *disk)
    answer = json.loads(done.stdout)
    c33D = answer["constants"]["disk.c33D"]
    low, high = c33D["interval_re"]["p95"]
    assert low < c33D["re"] < high
    assert c33D["interval_im"]["p68"][0] < c33D["im"]
    assert answer["constants"]["disk.density"]["free"] is False
    share = answer["budget"]["re"]["disk.c33D"]
    assert set(share) == {"noise", "instrument", "model", "dimensions", "knowledge", "assumptions", "largest"}
    assert answer["budget"]["tolerances"]["disk.density"] == pytest.approx(77.0)


def test_the_budget_is_a_table(disk: list[str]) -> None:
    done = run("--budget", *disk)
    assert done.exit_code == 0
    assert "uncertainty budget" in done.stdout
    assert "assumptions" in done.stdout


@pytest.mark.parametrize("way", ["--sequential", "--freeze"])
def test_joint_sequential_and_frozen_fits_of_the_steps(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = cases / "glue-null"
    words = ["--build", folder / "build.toml", f"disk={folder / 'disk.csv'}", f"ml1={folder / 'ml1.csv'}"]
    answer = json.loads(run("--json", way, *words).stdout)
    assert answer["converged"]
    assert any("frozen" in sentence for sentence in answer["says"]) == (way == "--freeze")


def test_overrides_apply_to_all_samples(cases: Path, tmp_path: Path) -> None:
    for name in ("S1", "S2"):
        (tmp_path / name).mkdir()
        for file in ("build.toml", "disk.csv"):
            (tmp_path / name / file).write_bytes((cases / "null" / file).read_bytes())
    fits = json.loads(run("--all", tmp_path, "--json", "--hold", "disk.density").stdout)["fits"]
    assert {fit["constants"]["disk.density"]["free"] for fit in fits.values()} == {False}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--objective", "chi"], "--objective is 'chi'; log, thesis or kt2 is needed"),
        (["--uncertainty", "gut"], "--uncertainty is 'gut'; covariance, profile or bootstrap is needed"),
        (["--uncertainty", "profile", "--objective", "thesis"], "needs the noise-weighted objective log"),
        (["--sequential", "--freeze"], "give one of the two"),
        (["--free", "disk.h33", "--hold", "disk.h33"], "disk.h33 is given to both --free and --hold"),
        (["--hold", "disk.h33,"], "give names with commas between them"),
        (["--hold", "disk.h34"], "cannot hold 'disk.h34': this build has area"),
        (["--tie", "disk.h33"], "is not NAME=NAME"),
        (["--prior", "area=2"], "is not NAME=VALUE:UNCERTAINTY in SI units"),
        (["--bound", "area=1:x"], "is not NAME=LOWEST:HIGHEST in SI units"),
        (["--bound", "area=1:nan"], "is not NAME=LOWEST:HIGHEST in SI units"),
        (
            ["--fitter", "bvd", "--sequential"],
            "bvd does not know --objective, --uncertainty, --sequential and --freeze",
        ),
    ],
)
def test_each_mistake_is_one_sentence(disk: list[str], words: list[str], sentence: str) -> None:
    done = run(*words, *disk)
    assert done.stdout == ""
    assert isinstance(done.exception, PzctlError)
    assert sentence in str(done.exception)
    assert "\n" not in str(done.exception)
