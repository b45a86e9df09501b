"""A third party's fitter is built and installed from its own folder, found by its entry point, run by the daemon."""

import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pzctl.daemon.client.client import connect
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

PACKAGE = Path(__file__).parents[2] / "example_fitter"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which pip installed the example."""
    source, target = tmp_path_factory.mktemp("source") / "package", tmp_path_factory.mktemp("installed")
    shutil.copytree(PACKAGE, source)  # building leaves files in the folder
    words = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", target, source]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, timeout=100)
    return target


def test_the_daemon_runs_it_and_any_client_may_request_it(start_daemon, build: Build, installed, monkeypatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(installed), prepend=os.pathsep)
    start_daemon(names=("capacitance",))
    with connect() as lab:
        measured = lab.measure(build, "disk")
        result = lab.wait_fit("capacitance", measured.id)
        f, Z = measured.sweeps[-1].frequency[-1], measured.sweeps[-1].impedance[-1]
        assert result.constants["terminals.C"].re == pytest.approx((1 / (2j * math.pi * f * Z)).real, rel=0.2)
        assert lab.fit(measured.id, "capacitance").constants == result.constants
        short = lab.measure(build, "disk", SweepPlan((Segment(1e6, 2e6, 11),)))
        with pytest.raises(FitError, match="11 points; at least 30 are needed"):
            lab.wait_fit("capacitance", short.id)
        assert {(one.name, one.version) for one in lab.hello().fitters} == {("capacitance", "1.0")}


def test_the_command_line_lists_it(installed: Path) -> None:
    done = subprocess.run(
        [Path(sys.executable).with_name("pzctl"), "fitters"],
        env={**os.environ, "PYTHONPATH": str(installed), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "capacitance and loss tangent at the top of the sweep" in done.stdout


def test_the_example_is_as_short_as_the_guide_says() -> None:
    lines = (PACKAGE / "example_fitter.py").read_text(encoding="utf-8").splitlines()
    assert len([line for line in lines if line.strip()]) < 50
