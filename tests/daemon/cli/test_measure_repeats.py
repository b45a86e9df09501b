"""`pzctl measure --sample --repeat --every`: one build for many samples, and series that run by themselves."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import run_here

from pzctl.daemon.files.builds.build_file import THESIS_BUILD

PZCTL = Path(sys.executable).with_name("pzctl")


def pzctl(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words)


def test_a_series_under_the_name_of_a_sample(tmp_path: Path) -> None:
    words = ("--step", "disk", "--sample", "X7", "--repeat", "3", "--every", "0.5s", "--time-scale", "0", "--json")
    done = pzctl(tmp_path, "measure", *words)
    assert done.returncode == 0, done.stderr
    ids = [one["id"] for one in json.loads(done.stdout)["measurements"]]
    assert len(set(ids)) == 3
    (sample,) = json.loads(pzctl(tmp_path, "samples", "--json").stdout)["samples"]
    assert sample["name"] == "X7"
    assert [one["id"] for one in sample["measurements"]] == ids


def test_a_plan_beyond_the_analyzer_is_refused_before_anything_is_glued(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    glued: list[object] = []
    monkeypatch.setattr("pzctl.daemon.cli.bench.preparation.bring_to_step", lambda *of: glued.append(of))
    build = THESIS_BUILD.read_text(encoding="utf-8").split("[sweep]", maxsplit=1)[0]
    plan = "[sweep]\nsegments = [ { start_MHz = 1, stop_MHz = 200, points = 11 } ]\n"
    (tmp_path / "far.toml").write_text(build + plan, encoding="utf-8")
    done = pzctl(tmp_path, "measure", "--build", "far.toml", "--time-scale", "0")
    assert "stop is 200000000 Hz; the 4294A can do 40 to 110000000 Hz" in done.stderr
    assert (done.returncode, glued) == (2, [])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--repeat", "3"], "--repeat 3 needs --step; build 'thesis' has the steps disk, ml1, ml2"),
        (["--step", "disk", "--every", "soon"], "--every 'soon': a number with s, min or h is needed"),
        (["--sample", "../x"], "--sample is '../x'; allowed are letters"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path: Path, words: list[str], says: str) -> None:
    done = pzctl(tmp_path, "measure", *words)
    assert (done.returncode, says in done.stderr, len(done.stderr.splitlines())) == (2, True, 1)
