"""All ten open cases with all their points and every effect of the catalogue; what further samples say of one."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from open_cases import check, given, recorded

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.interface import FitTask

CASES = Path(__file__).resolve().parents[1] / "support" / "cases"
NAMES = sorted(path.name for path in CASES.iterdir() if path.is_dir())


@pytest.mark.parametrize("name", NAMES)
def test_an_open_case(name: str) -> None:
    task, truth = given(CASES, name)
    start = time.process_time()
    diagnosis = diagnose(task)
    found = ", ".join(f"{one.effect} at {one.where}" for one in diagnosis.findings)
    print(f"{name}: {diagnosis.verdict}, {found or 'nothing'}; {time.process_time() - start:.1f} s of processor time")
    check(diagnosis, truth)


def test_another_sample_confirms_or_contradicts_a_finding() -> None:
    task, truth = given(CASES, "lead", 2)
    (injected,) = truth["findings"]
    build = read_build(CASES / "null" / "build.toml")
    sweep = recorded(CASES / "null" / "disk.csv", 4)
    f, admittance = sweep.frequency, 1 / sweep.impedance
    found = diagnose(task, ("lead-inductance", "series-resistance"))
    sizes = {name: size.value for name, size in found.findings[0].parameters.items()}
    # the jig of both measurements, and a better one
    leads = {"as long": 1.0, "ten times as long": 10.0, "none": 0.0}
    impedances = {
        name: 1 / admittance + times * (sizes["resistance"] + 2j * np.pi * f * sizes["inductance"])
        for name, times in leads.items()
    }
    others = {name: FitTask(build, {"disk": (replace(sweep, impedance=Z),)}) for name, Z in impedances.items()}
    diagnosis = diagnose(task, (injected["effect"],), others=others)
    said = {other.sample: other for other in diagnosis.others}
    assert "confirms this" in said["as long"].says
    assert said["as long"].chi2_per_dof_after < 1.2 < said["as long"].chi2_per_dof_before
    assert "confirms part of this" in said["ten times as long"].says
    assert "contradicts lead-inductance at terminals" in said["none"].says
    nothing = diagnose(others["none"], (injected["effect"],), others={"next": others["as long"]})
    assert [other.says for other in nothing.others] == ["None of the effects found can be tested on sample next."]
