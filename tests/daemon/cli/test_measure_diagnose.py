"""`pzctl measure --diagnose` on the simulated bench: further sweeps decide what one sweep leaves open."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run_here

import pzctl
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.builds.build_file import read_build
from pzctl.daemon.report.document.html_report import report_html
from pzctl.daemon.samples.sample_record import sample_record
from pzctl.daemon.samples.sample_selection import open_journal
from pzctl.daemon.wire.events import DiagnosisEvent, SweepEvent
from pzctl.drivers.recordings import write_csv
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"
RESOURCE = "--resource 127.0.0.1:5835"
FEW = "diagnose --effects stray-capacitance,surface-layer --build"
"""Of a recording that was diagnosed before, among the whole catalogue."""
PZCTL = Path(sys.executable).with_name("pzctl")
GUIDE = (Path(__file__).parents[3] / "docs" / "when-the-fit-is-wrong.md").read_text(encoding="utf-8")
BUILD = re.search(r"<!-- file: S1.toml -->\n```toml\n(.*?)```", GUIDE, re.DOTALL)[1]  # type: ignore[index]
BLOCKS = re.findall(rf"<!-- tested: \S+{Path(__file__).name} -->\n```bash\n(.*?)```", GUIDE, re.DOTALL)


def measured(home: Path) -> "subprocess.CompletedProcess[str]":
    """Measure and diagnose a bare disk through the command line."""
    (home / "S1.toml").write_text(BUILD)
    return run(home, "measure", "--build", "S1.toml", "--diagnose", "--json")


def run(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "PZCTL_HOME": str(home), "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": ""}
    done = subprocess.run(
        [PZCTL, *words],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        cwd=home,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done


def the_diagnosis(done: "subprocess.CompletedProcess[str]") -> dict[str, Any]:
    (found,) = json.loads(done.stdout)["diagnoses"]
    return found


def test_a_wider_sweep_decides_what_one_sweep_leaves_open(start_daemon, tmp_path: Path) -> None:
    """As in the guide, command by command; only the simulator is that of the daemon."""
    start_daemon(names=("mason",), simulator={"hidden": {"stray-capacitance": 5e-12}, "jig": "ideal"})
    (tmp_path / "S1.toml").write_text(BUILD)
    sim, *commands = re.findall("^pzctl (.*)$", "".join(BLOCKS), re.MULTILINE)
    assert sim.endswith("--jig ideal --hidden stray-capacitance=5e-12 &")
    (measure,) = (command for command in commands if command.startswith("measure"))
    outputs = {
        command: run(tmp_path, *command.replace(RESOURCE, "--json").replace("diagnose --build", FEW).split())
        for command in commands
    }
    assert {"S1.html", "S1-disk-1.csv", "S1-diagnosis.png"} <= {path.name for path in tmp_path.iterdir()}
    found = the_diagnosis(outputs[measure])
    (finding,) = found["findings"]
    assert (found["verdict"], finding["effect"]) == ("explained", "stray-capacitance")
    (sweep,) = found["decided_by"]
    assert "wider" in sweep["kind"], "none is made for the same effects again"
    assert not [one for one in finding["alternatives"] if one["probability"] > 0.01]
    size = finding["parameters"]["capacitance"]
    assert abs(size["value"] - 5e-12) < max(5 * size["u"], 0.03 * 5e-12)


def test_a_proposed_sweep_is_not_measured_without_consent(start_daemon, tmp_path: Path) -> None:
    start_daemon(simulator={"hidden": {"stray-capacitance": 5e-12}, "jig": "ideal"})
    done = measured(tmp_path)
    found = the_diagnosis(done)
    assert found["verdict"] == "no-mismatch"
    assert found["decided_by"] == []
    (proposal,) = found["would_measure"]
    assert {"effect": "stray-capacitance", "where": "terminals"} in proposal["decides"]
    assert 10 < proposal["seconds"] < 100
    assert "proposal for disk: sweep from 1.5 to 16.5 MHz" in done.stderr
    assert "this is no terminal to ask in" in done.stderr
    with pzctl.connect() as lab:
        assert [one.state for one in lab.samples()[0].measurements] == ["measured"]


def test_a_deciding_measurement_is_kept_and_is_no_record_of_its_step(start_daemon, build: Build) -> None:
    start_daemon("Echo")
    with pzctl.connect() as lab:
        own = lab.measure(build, "disk").id
        aside = lab.measure(build, "disk", decides=own).id
        later = lab.measure(build, "ml1").id
        events = [one.event for one in lab.sweeps(aside) if isinstance(one.event, SweepEvent)]
        assert {(event.measurement, event.decides) for event in events} == {(aside, own)}
        earlier = {one.event.measurement for one in lab.sweeps(later) if isinstance(one.event, SweepEvent)}
        assert earlier == {own, later}, "a later step is fitted with the step's own record"
        lab.wait_fit(ECHO, later)
        assert not lab.fits(aside)
        assert aside not in lab.unanswered(ECHO)
        with pytest.raises(DaemonError, match=r"is of 'S4\.a' at step 'disk'; one of 'S4.a' at step 'ml1'"):
            lab.begin(build, "ml1", decides=own)


def test_a_fit_that_leaves_a_mismatch_is_diagnosed_in_the_background(
    start_daemon, tmp_path: Path, wait_until: Callable[[Callable[[], object]], None]
) -> None:
    start_daemon(names=("mason",), simulator={"hidden": {"drive-nonlinearity": 200.0}, "jig": "ideal"})
    (tmp_path / "S1.toml").write_text(BUILD)
    build = read_build(tmp_path / "S1.toml")
    with pzctl.connect() as lab:
        one = lab.measure(build, "disk").id
        assert lab.wait_fit("mason", one).chi2_per_dof > 1.4
        assert [finding["effect"] for finding in lab.wait_diagnosis(one)["findings"]] == ["drive-nonlinearity"]
        (event,) = (heard.event for heard in lab.fits(one) if isinstance(heard.event, DiagnosisEvent))
        assert event.topic == b"diagnosis.S1.disk."
        lab.bench({"command": "hidden", "drive-nonlinearity": 0.0})
        sound = lab.measure(build, "disk").id
        lab.wait_fit("mason", sound)
        wait_until(lambda: lab.metrics().errands == 0)
        assert not [heard for heard in lab.fits(sound) if isinstance(heard.event, DiagnosisEvent)]
    archive = open_journal()
    page = report_html(sample_record(archive, one))
    archive.close()
    assert "marked: layer:disk" in page, "the picture is there, with its place marked"
    assert "bends with the oscillator level" in page


def test_the_constants_are_shown_also_where_model_and_recording_agree(tmp_path: Path) -> None:
    (tmp_path / "S1.toml").write_text(BUILD)
    f = np.linspace(1e6, 8e6, 501)
    rng = np.random.default_rng(3)
    Z = pzctl.model(tmp_path / "S1.toml", "disk").impedance(f)
    Z = Z * np.exp(1e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)))
    write_csv(pzctl.Sweep(f, Z), tmp_path / "disk.csv")
    done = run_here(tmp_path, "diagnose", "--build", "S1.toml", "--effects", "polarity", "--jobs", "1", "disk=disk.csv")
    assert "agree" in done.stdout.splitlines()[0]
    assert re.search(r"disk\.c33D +│ \d", done.stdout)
