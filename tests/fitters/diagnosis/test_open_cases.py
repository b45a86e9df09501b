"""The open cases of this repository: each has a readable build file, recordings of its steps and a truth."""

import json
from pathlib import Path

import pytest

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording

VERDICTS = {"no-mismatch", "explained", "partly-explained", "unexplained"}


@pytest.mark.parametrize(("folder", "count"), [("cases", 10), ("lab_cases", 9)])
def test_every_open_case_is_complete(folder: str, count: int, request: pytest.FixtureRequest) -> None:
    cases: Path = request.getfixturevalue(folder)
    truths = json.loads((cases / "truth.json").read_text())
    assert len(truths) == count
    assert set(truths) == {path.name for path in cases.iterdir() if path.is_dir()}
    for name, truth in truths.items():
        assert truth["verdict"] in VERDICTS
        build = read_build(cases / name / "build.toml")
        assert set(truth["files"]) == {step.name for step in build.steps}
        listed = {file for files in truth["files"].values() for file in files}
        assert listed == {path.name for path in (cases / name).glob("*.csv")}
        for file in listed:
            assert read_recording(cases / name / file).frequency.size >= 801
        assert {finding["step"] for finding in truth["findings"]} <= set(truth["files"])
