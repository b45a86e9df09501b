"""Limits and control charts on the command line, in the report and on the page: the verdict is the same everywhere."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from journal_fits import put_fit
from page_requests import ask
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.drivers.recordings import write_csv
from pzctl.models.base.errors import PzctlError
from pzctl.models.stack import HalfSpace, Piezo, Stack
from pzctl.models.sweep import Sweep


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording of the thesis's disk, which its build describes exactly."""
    monkeypatch.chdir(tmp_path)
    f = np.linspace(1e6, 6e6, 201)
    build = read_build(THESIS_BUILD)
    disk = {name: quantity.value for name, quantity in build.layers[0].values.items()}
    piezo = Piezo("disk", disk["thickness"].real, disk["density"].real, disk["c33D"], disk["h33"], disk["eps33S"])
    air = HalfSpace("air", 413.0)
    z = Stack((piezo,), air, air, build.area.re).impedance(f)
    noise = np.random.default_rng(0).standard_normal((2, f.size))
    write_csv(Sweep(f, z * (1 + 5e-4 * (noise[0] + 1j * noise[1])), id="disk"), tmp_path / "disk.csv")
    return tmp_path


@pytest.mark.parametrize(
    ("kt", "status", "verdict"),
    [("{ min = 0.3 }", 0, "pass"), ("{ max = 0.3 }", 3, "fail")],
)
def test_the_exit_status_of_a_fit_is_its_verdict(recorded: Path, kt: str, status: int, verdict: str) -> None:
    (recorded / "spec.toml").write_text(f"[limits.disk]\nkt = {kt}\n[limits.ml1]\nq = {{ min = 1 }}\n")
    words = ("fit", "--build", THESIS_BUILD, "--limits", "spec.toml", "disk=disk.csv")
    done = run(*words, "--json")
    assert done.exit_code == status
    told = json.loads(done.stdout)["verdict"]
    assert told["verdict"] == verdict
    assert [one["constant"] for one in told["limits"]] == ["disk.kt"], "ml1 is not glued yet"
    shown = run(*words)
    assert shown.exit_code == status
    assert f"verdict: {verdict}" in shown.stdout


@pytest.fixture
def measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))

    def put(*stiffness: float) -> None:
        journal = JournalWriter(tmp_path / "journal")
        for k, c33D in enumerate(stiffness):
            put_fit(journal, f"S{k}", c33D)
        journal.close()

    return put


def test_a_control_chart_names_the_outlier_and_the_page_shows_it(measured: Callable[..., None], tmp_path: Path) -> None:
    measured(*(1.5e11 + 1e9 * x for x in (0.2, -0.5, 0.4, -0.1, 0.6, -0.3, 0.1, 7.0)))
    done = run("chart", "disk.c33D", "--baseline", "7", "--json", "--picture", tmp_path / "chart.svg")
    assert done.exit_code == 3
    chart = json.loads(done.stdout)
    assert chart["left"] == ["S7"]
    assert chart["limit"] == {"low": 146e9, "high": 156e9}
    assert chart["capability"]["cp"] == pytest.approx(10e9 / (6 * chart["sigma"]))
    assert "<svg" in (tmp_path / "chart.svg").read_text(encoding="utf-8")
    table = run("chart", "disk.c33D", "--baseline", "7", "--picture", tmp_path / "chart.png").stdout
    assert "above the 3 sigma limit" in table
    assert "Cpk" in table
    status, _, body = ask("/chart/disk.c33D.json")
    assert status == 200
    assert len(json.loads(body)["points"]) == 8
    status, headers, body = ask("/chart/disk.c33D")
    assert (status, headers["content-type"]) == (200, "image/svg+xml")
    assert b"<svg" in body
    (sample, *_) = [one for one in json.loads(ask("/api/history")[2])["samples"] if one["name"] == "S7"]
    assert sample["steps"][0]["verdict"]["verdict"] == "undecided", "157 GPa is beyond 156 by one u only"


def test_the_report_has_the_verdict(measured: Callable[..., None], tmp_path: Path) -> None:
    measured(1.6e11)
    assert run("report", "S0", "--out", tmp_path / "S0.html").exit_code == 0
    html = (tmp_path / "S0.html").read_text(encoding="utf-8")
    assert "<p class='verdict'>fail</p>" in html
    assert "<tr class='fail'><td>disk.c33D</td>" in html
    assert run("report", "S0", "--out", tmp_path / "S0.pdf").exit_code == 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["chart", "disk.c33D"], "at least 3 are needed"),
        (["chart", "disk.c33"], "constant 'disk.c33': no sample's fit determined it; there are disk.c33D, disk.kt"),
        (["chart", "disk.c33D", "--picture", "c.gif"], "allowed are .png, .svg, .pdf"),
        (["report", "S0", "--limits", "none.toml"], "none.toml: cannot be read"),
    ],
)
def test_what_cannot_be_is_one_sentence(measured: Callable[..., None], words: list[str], sentence: str) -> None:
    measured(1.5e11, 1.51e11)
    done = run(*words)
    assert isinstance(done.exception, PzctlError)
    assert sentence in str(done.exception)
