"""All ten open cases with all their points and every effect of the catalogue."""

import time
from pathlib import Path

import pytest
from open_cases import check, given

from pzctl.fitters.diagnosis.diagnose import diagnose

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
