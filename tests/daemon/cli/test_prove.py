"""The scoring of diagnoses, and that a truth cannot be changed once its hash was published."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pzctl.daemon.cli.proof.oracle_run import tell_all
from pzctl.daemon.cli.proof.run_case import diagnose_case
from pzctl.fitters.proof.judge import Judged, ProofError, is_right, read_judged
from pzctl.fitters.proof.proof_metrics import bins, figures, rates, said
from pzctl.fitters.proof.proof_page import write_page


def planted(effect: str, *where: str, gain: float = 1e4) -> dict[str, Any]:
    return {"effect": effect, "accept": [], "where": where, "gain": gain, "step": "disk", "base": {}, "scale": 1.0}


def truth(kind: str, *findings: dict[str, Any], absorbed: tuple[str, ...] = ()) -> dict[str, Any]:
    constants = {"disk.c33D": [1e11, 1e9]}
    return {"kind": kind, "findings": findings, "hidden": [], "not_decidable": absorbed, "constants": constants}


def found(effect: str, where: str, p: float = 0.97, *others: tuple[str, str]) -> dict[str, Any]:
    rivals = [{"effect": name, "where": place, "probability": 0.02} for name, place in others]
    return {"effect": effect, "where": where, "probability": p, "alternatives": rivals}


def answer(*findings: dict[str, Any], listed: tuple[str, ...] = ()) -> dict[str, Any]:
    def side(c: float, chi2: float) -> dict[str, Any]:
        constants = {"disk.c33D": {"re": c, "im": 1e9, "u_re": 1e8, "u_im": None}}
        return {"chi2_per_dof": chi2, "held_out": chi2, "constants": constants}

    return {
        "verdict": "explained",
        "findings": findings,
        "baseline": side(1.1e11, 50.0),
        "final": side(1.001e11, 1.0),
        "not_decidable": [{"effect": name} for name in listed],
        "seconds": 2.0,
    }


LEAD, TAPER = planted("lead-inductance", "terminals"), planted("thickness-variation", "layer:disk")
CASES = {
    "a": (truth("none"), answer()),
    "b": (truth("none"), answer(found("cable", "terminals"))),
    "c": (truth("one", LEAD), answer(found("lead-inductance", "terminals"))),
    "d": (truth("one", LEAD), answer(found("cable", "terminals", 0.5, ("lead-inductance", "terminals")))),
    "e": (truth("one", TAPER), answer(found("thickness-variation", "layer:ml1"))),
    "f": (truth("two", LEAD, TAPER), answer(found("thickness-variation", "layer:disk"))),
    "g": (truth("outside", planted("unknown", "any")), answer(found("unknown", "sweep"))),
    "h": (truth("absorbed", absorbed=("electrode-mass",)), answer(listed=("electrode-mass",))),
    "i": (truth("one", planted("cable", "terminals", gain=30)), answer()),
}
JUDGED = [Judged(name, *case) for name, case in CASES.items()]


def test_correct_findings() -> None:
    assert [case.name for case in JUDGED if case.right] == ["a", "c", "g", "h", "i"]
    assert [case.name for case in JUDGED if case.kind == "one" and case.right_in_group] == ["c", "d"]
    assert JUDGED[-1].kind == "faint"
    assert is_right(found("bond-void", "interface:glue1|ml1"), planted("bond-void", "interface:glue1|"))


def test_metrics_count_every_kind_once() -> None:
    by_name = {figure.what: figure for figure in figures(JUDGED)}
    assert by_name["nothing left out: no finding"].value == 0.5
    assert by_name["one effect, detectable: right effect and place first"].value == pytest.approx(1 / 3)
    assert by_name["two effects: both"].value == 0
    assert by_name["error of the constants after / before, median"].value == pytest.approx(0.01, rel=0.01)
    assert by_name["error of the constants before, in uncertainties, median"].value == pytest.approx(100)
    assert by_name["the same after"].value == pytest.approx(1)
    pairs = said(JUDGED)
    assert sum(n for n, _, _ in bins(pairs)) == len(pairs) == 6


def test_rates_are_by_effect_and_by_kind_of_flaw() -> None:
    hum = {**planted("unknown", "any"), "base": {"mains hum": 1e-3}}
    cases = [*JUDGED, Judged("j", truth("outside", hum), answer(found("cable", "terminals")))]
    by_name = {rate.planted: rate for rate in rates(cases)}
    lead, flaw = by_name["lead-inductance"], by_name["unknown: mains hum"]
    assert (lead.cases, lead.found, lead.first, lead.misnamed, lead.said) == (3, 1, 1, 1, 0)
    assert (flaw.cases, flaw.found, flaw.misnamed) == (1, 0, 1)


def _proof(folder: Path) -> str:
    data = json.dumps({name: case[0] for name, case in CASES.items()}).encode()
    (folder / "truth.json").write_bytes(data)
    (folder / "answers.json").write_text(json.dumps({name: case[1] for name, case in CASES.items()}))
    return hashlib.sha256(data).hexdigest()


def test_page_names_what_failed_and_refuses_a_changed_truth(tmp_path: Path) -> None:
    published = _proof(tmp_path)
    text = write_page(tmp_path, published, "Nine cases by hand.").read_text()
    assert published in text
    failed = text.split("not right")[1]
    assert [name for name in CASES if f"| {name} |" in failed] == ["b", "d", "e", "f"]
    (tmp_path / "truth.json").write_text("{}")
    with pytest.raises(ProofError, match="it was changed"):
        read_judged(tmp_path, published)


def test_a_case_is_diagnosed_from_its_files_alone(cases: Path, tmp_path: Path) -> None:
    shutil.copytree(cases / "null", tmp_path / "case")
    given = diagnose_case(tmp_path / "case", ("lead-inductance", "electrode-mass"))
    assert given["verdict"] == "no-mismatch"
    assert given["seconds"] > 0


@pytest.mark.long
def test_an_oracle_run_is_an_upper_bound_on_performance(cases: Path, tmp_path: Path) -> None:
    shutil.copytree(cases / "lead", tmp_path / "cases" / "a")
    data = json.dumps({"a": truth("one", LEAD), "b": truth("none")}).encode()
    (tmp_path / "truth.json").write_bytes(data)
    (tmp_path / "answers.json").write_text(json.dumps({"a": answer(), "b": answer()}))
    published = hashlib.sha256(data).hexdigest()
    tell_all(tmp_path, published, jobs=1)
    judged, nothing = read_judged(tmp_path, published)
    assert [one["effect"] for one in judged.told["findings"]] == ["lead-inductance"]
    assert not nothing.told
    by_name = {figure.what: figure for figure in figures([judged, nothing])}
    told = by_name["the same of a diagnosis that is told which effects are there: held-out misfit"]
    assert told.cases == 1
    assert told.value < 0.5


def test_a_proof_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "truth.json").write_text("{}")
    words = ["-c", "from pzctl.daemon.cli import main; main()", "prove", "--count", "1", "--out", str(tmp_path)]
    run = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "this folder holds a proof already" in run.stderr
    assert "Traceback" not in run.stderr


@pytest.mark.parametrize(
    ("folder", "says"), [("real", "real: no recording with a build.toml beside it"), ("rael", "rael: no such folder")]
)
def test_a_folder_without_real_recordings_is_one_sentence(tmp_path: Path, folder: str, says: str) -> None:
    (tmp_path / "real").mkdir()
    words = ["-c", "from pzctl.daemon.cli import main; main()", "prove", "--real", folder]
    run = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    (line,) = run.stderr.splitlines()
    assert line.startswith(f"pzctl: {says}")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are counted in /proc")
def test_ctrl_c_ends_every_process_of_a_proof(
    tmp_path: Path, start_program: "Callable[..., subprocess.Popen[str]]"
) -> None:
    run = [sys.executable, "-c", "from pzctl.daemon.cli import main; main()", "prove", "--count", "9", "--out", "p"]
    terminal = start_program(run, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    deadline = time.monotonic() + 60
    while (
        members(terminal.pid) < 4 and time.monotonic() < deadline
    ):  # the command, the process that makes cases, and two workers
        time.sleep(0.1)
    os.killpg(terminal.pid, signal.SIGINT)
    printed, _ = terminal.communicate(timeout=60)
    assert terminal.returncode == 130
    assert "Traceback" not in printed
    assert members(terminal.pid) == 0


def members(group: int) -> int:
    """Return how many processes a process group has."""
    count = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            after_name = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        count += int(after_name[2]) == group and after_name[0] != "Z"
    return count
