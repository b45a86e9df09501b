"""`pzctl measure --diagnose` on the simulated bench: further sweeps decide what one sweep leaves open."""

import json
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import run_here, run_pzctl
from rich.console import Console

import pzctl
from pzctl.daemon.cli.bench.deciding_sweep import Diagnoser
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.builds.build_file import read_build
from pzctl.daemon.report.document.html_report import report_html
from pzctl.daemon.report.json_output.experiment_json import plan_in
from pzctl.daemon.report.tables import diagnosis_output
from pzctl.daemon.samples.sample_record import sample_record
from pzctl.daemon.samples.sample_selection import open_journal
from pzctl.daemon.wire.events import DiagnosisEvent, SweepEvent
from pzctl.drivers.recordings import read_recording, write_csv
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"
FEW = ["stray-capacitance", "surface-layer"]
GUIDE = (Path(__file__).parents[3] / "docs" / "when-the-fit-is-wrong.md").read_text(encoding="utf-8")
BUILD = re.search(r"<!-- file: S1.toml -->\n```toml\n(.*?)```", GUIDE, re.DOTALL)[1]  # type: ignore[index]
WIDE = BUILD.replace("start_MHz = 3, stop_MHz = 5, points = 51", "start_MHz = 1.5, stop_MHz = 7.5, points = 41")


def measured(home: Path) -> "subprocess.CompletedProcess[str]":
    """Measure and diagnose a bare disk through the command line."""
    (home / "S1.toml").write_text(BUILD)
    return run_pzctl(home, "measure", "--build", "S1.toml", "--diagnose", "--json")


def the_diagnosis(done: "subprocess.CompletedProcess[str]") -> dict[str, Any]:
    (found,) = json.loads(done.stdout)["diagnoses"]
    return found


@pytest.mark.long
def test_a_wider_sweep_decides_what_one_sweep_leaves_open(start_daemon, tmp_path: Path) -> None:
    """The device of the guide, with two effects; tests/benchmarks/test_deciding_sweeps.py runs the guide's commands."""
    start_daemon(names=("mason",), simulator={"hidden": {"stray-capacitance": 5e-12}, "jig": "ideal"})
    (tmp_path / "S1.toml").write_text(BUILD)
    build = read_build(tmp_path / "S1.toml")
    with pzctl.connect() as lab:
        own = lab.measure(build, "disk").id
        undecided = lab.diagnose(own, FEW, propose=True)
        assert (undecided["verdict"], undecided["findings"]) == ("no-mismatch", [])
        (proposal,) = undecided["would_measure"]
        assert "wider" in proposal["kind"]
        aside = lab.measure(replace(build, plan=plan_in(proposal)), "disk", decides=own).id
        decided = lab.diagnose(own, FEW, also=[aside])
    (finding,) = decided["findings"]
    assert (decided["verdict"], finding["effect"]) == ("explained", "stray-capacitance")
    assert not [one for one in finding["alternatives"] if one["probability"] > 0.01]
    size = finding["parameters"]["capacitance"]
    assert abs(size["value"] - 5e-12) < max(5 * size["u"], 0.03 * 5e-12)


class AskedLab:
    """Proposes a sweep for each of these effects in one diagnosis after the other, as long as it is to propose."""

    def __init__(self, *proposed: tuple[str, ...]) -> None:
        self._proposed = list(proposed)
        self.diagnosed: list[tuple[list[str], bool]] = []

    def diagnose(self, _measurement: str, also: list[str], propose: bool) -> dict[str, Any]:
        self.diagnosed.append((list(also), propose))
        effects = self._proposed.pop(0) if propose and self._proposed else ()
        plan = {"segments": [{"start_Hz": 1e6, "stop_Hz": 2e6, "points": 11}]}
        rest = {"what": "a sweep", "why": "to decide", "seconds": 1.0, "plan": plan}
        return {"findings": [], "would_measure": [{"decides": [{"effect": one}], **rest} for one in effects]}


@pytest.mark.parametrize(
    ("proposed", "sweeps", "diagnosed"),
    [
        ([("leakage",), ("leakage",)], ["a0"], [([], True), (["a0"], True)]),
        ([("leakage",), ("leakage", "cable")], ["a0", "a1"], [([], True), (["a0"], True), (["a0", "a1"], False)]),
        ([()], [], [([], True)]),
    ],
)
def test_with_consent_each_effect_gets_one_sweep_and_all_sweeps_are_diagnosed_together(
    proposed: list[tuple[str, ...]],
    sweeps: list[str],
    diagnosed: list[tuple[list[str], bool]],
    build: Build,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(diagnosis_output, "print_diagnosis", lambda _console, _diagnosis: None)
    monkeypatch.setattr(Diagnoser, "_picture", lambda _self, _step, _measurement: "")
    lab, plans = AskedLab(*proposed), list[tuple[str, str]]()

    def sweep(_plan: object, step: str, decides: str) -> SimpleNamespace:
        plans.append((step, decides))
        return SimpleNamespace(id=f"a{len(plans) - 1}", sweeps=[])

    diagnoser = Diagnoser(lab, build, Console(quiet=True), sweep, yes=True)  # type: ignore[arg-type]
    found = diagnoser.step("disk", "m")
    assert [one["id"] for one in found["decided_by"]] == diagnoser.aside == sweeps
    assert plans == [("disk", "m")] * len(sweeps)
    assert lab.diagnosed == diagnosed


def test_constants_without_and_with_what_was_found_are_printed(build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis_output, "print_diagnosis", lambda _console, _diagnosis: None)
    monkeypatch.setattr(Diagnoser, "_picture", lambda _self, _step, _measurement: "")
    before, after = (
        {"constants": {"disk.eps33S": {"re": re, "im": 0.0, "u_re": 1e-12, "u_im": None, "unit": "F/m", "free": True}}}
        for re in (7.6e-9, 7.5e-9)
    )
    finding = {"effect": "stray-capacitance", "where": "terminals", "alternatives": []}
    told = {"says": ["A.", "B."], "findings": [finding], "baseline": before, "final": after}
    console = Console(record=True, width=100)
    lab = SimpleNamespace(diagnose=lambda _measurement, also, propose: told)
    Diagnoser(lab, build, console, lambda *_: None, yes=False).step("disk", "m")  # type: ignore[arg-type,return-value]
    (row,) = (line for line in console.export_text().splitlines() if "disk.eps33S" in line)
    assert [re.sub(r"\(.*", "", part) for part in re.findall(r"7\.\S+", row)] == ["7.6000", "7.5000"]


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


def test_a_deciding_sweep_is_exported_and_the_report_says_that_only_the_diagnosis_has_it(
    start_daemon, build: Build, tmp_path: Path
) -> None:
    start_daemon("Echo")
    before, after = ({"chi2_per_dof": 1.0, "constants": {"disk.h33": {"re": re, "free": True}}} for re in (3e9, 2e9))
    about = {"step": "disk", "probability": 0.9, "bands_Hz": [], "parameters": {}, "alternatives": []}
    finding = {"effect": "leakage", "where": "terminals", "says": "It leaks.", **about}
    told = {"says": ["They differ."], "findings": [finding], "baseline": before, "final": after}
    with pzctl.connect() as lab:
        own = lab.measure(build, "disk")
        assert build.plan
        wide = replace(build.plan, segments=build.plan.segments[:1])
        aside = lab.measure(build, "disk", wide, decides=own.id)
        sweeps = [sweep.id for sweep in (*own.sweeps, *aside.sweeps)]
        lab.wait_fit(ECHO, own.id)
        lab.submit_diagnosis(own.id, sweeps, "diagnosis", "1", told)
        journal = open_journal()
        page = report_html(sample_record(journal, own.id))
        journal.close()
    assert "Near 1, but only because the constants absorb what the diagnosis below has found." in page
    assert "those that were made to decide it: 1 - 6 MHz." in page
    assert "<td>disk.h33</td><td>3e9</td><td>2e9</td>" in page
    files = json.loads(run_here(tmp_path, "export", "S4.a", "--json").stdout)["files"]
    assert [Path(file).stem for file in files] == [
        *(f"S4.a-disk-{k + 1}" for k in range(len(own.sweeps))),
        "S4.a-disk-decides-1",
    ]
    exported = read_recording(tmp_path / files[-1])
    assert np.allclose(exported.impedance, aside.sweeps[0].impedance)


def test_a_fit_that_leaves_a_mismatch_is_diagnosed_in_the_background(
    start_daemon, tmp_path: Path, wait_until: Callable[[Callable[[], object]], None]
) -> None:
    start_daemon(names=("mason",), simulator={"hidden": {"lead-inductance": 1e-8}, "jig": "ideal"})
    (tmp_path / "S1.toml").write_text(WIDE)
    build = read_build(tmp_path / "S1.toml")
    with pzctl.connect() as lab:
        one = lab.measure(build, "disk").id
        assert lab.wait_fit("mason", one).chi2_per_dof > 1.4
        assert [finding["effect"] for finding in lab.wait_diagnosis(one)["findings"]] == ["lead-inductance"]
        (event,) = (heard.event for heard in lab.fits(one) if isinstance(heard.event, DiagnosisEvent))
        assert event.topic == b"diagnosis.S1.disk."
        lab.bench({"command": "hidden", "lead-inductance": 0.0})
        sound = lab.measure(build, "disk").id
        lab.wait_fit("mason", sound)
        wait_until(lambda: lab.metrics().errands == 0)
        assert not [heard for heard in lab.fits(sound) if isinstance(heard.event, DiagnosisEvent)]
    archive = open_journal()
    page = report_html(sample_record(archive, one))
    archive.close()
    assert "marked: terminals" in page, "the picture is there, with its place marked"
    assert "adds a series inductance that was not compensated" in page


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
