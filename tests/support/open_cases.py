"""The ten open cases: recordings of an independent simulation with hidden effects, and their truths."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.diagnosis.findings import Diagnosis
from pzctl.fitters.interface import FitTask
from pzctl.models.sweep import Sweep


def recorded(file: Path, every: int = 1) -> Sweep:
    """Return a recording, or every so many of its 801 points."""
    sweep = read_recording(file)
    return replace(sweep, frequency=sweep.frequency[::every], impedance=sweep.impedance[::every])


def given(cases: Path, name: str, every: int = 1) -> tuple[FitTask, dict[str, Any]]:
    """Return the task of a case, with every so many of its points, and its truth."""
    truth = json.loads((cases / "truth.json").read_text(encoding="utf-8"))[name]
    sweeps = {
        step: tuple(recorded(cases / name / file, every) for file in files) for step, files in truth["files"].items()
    }
    return FitTask(read_build(cases / name / "build.toml"), sweeps), truth


def check(diagnosis: Diagnosis, truth: dict[str, Any]) -> None:
    """Assert that verdict, effects, places and the list of undecidable effects are right."""
    assert diagnosis.verdict == truth["verdict"]
    named = {(finding.effect, finding.step): finding.where for finding in diagnosis.findings}
    assert set(named) == {(injected["effect"], injected["step"]) for injected in truth["findings"]}
    for injected in truth["findings"]:
        assert named[injected["effect"], injected["step"]] in injected["where"]
    listed = {entry.effect for entry in diagnosis.not_decidable}
    assert set(truth["not_decidable"]) <= listed
    assert not listed & {injected["effect"] for injected in truth["findings"]}, "named and said to be undecidable"
    for entry in diagnosis.not_decidable:
        assert entry.shifts, f"{entry.effect} is listed, but no constant would change"
        assert any(size.value > 0 for size in entry.upper_limit.values())
