"""A fitter's answer is untrusted text: it is shown as text in terminal, report and page, and never interpreted."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pzctl.daemon.cli import main
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.report.tables.watch_view import Watched
from pzctl.daemon.report.terminal import console
from pzctl.daemon.server.requests.request_errors import RequestError
from pzctl.daemon.server.requests.submissions import checked
from pzctl.daemon.wire.events import (
    DiagnosisEvent,
    FitEvent,
    InstrumentInfo,
    SampleStep,
    StateEvent,
    SweepEvent,
    decode,
    sweep_columns,
)
from pzctl.daemon.wire.requests import SubmitRequest
from pzctl.daemon.wire.result_messages import FitReport, NoiseReport
from pzctl.fitters.interface import Constant
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

ESCAPE = "\x1b[2J"
EVIL = f"[/red]{ESCAPE}<script>alert(1)</script>\rfree\u202e"
"""Two kinds of markup, a terminal escape sequence, a carriage return, and right-to-left text."""


def _report(build: Build, fitter: str) -> FitReport:
    constants = {"disk.c33D": Constant(1e11, 1e9, 1e9, 1e8, EVIL), EVIL: Constant(1.0, 0.0, 0.1, None, EVIL)}
    correlation = (("disk.c33D", EVIL, -0.97),)
    noise = NoiseReport(1e-3, EVIL)
    words = (build.name, fitter, EVIL, ("disk",), noise, 1.0, constants, {EVIL: Constant(1.0, 0.0, 0.1, None, EVIL)})
    return FitReport(*words, correlation, 0.1, True, 1, 0.1, says=(EVIL,), chosen={"by": EVIL, "free": [EVIL]})


DIAGNOSIS: dict[str, Any] = {
    "verdict": EVIL,
    "baseline": {"chi2_per_dof": 3.0, "held_out": 3.0, "constants": {}},
    "final": {
        "chi2_per_dof": 1.0,
        "held_out": 1.0,
        "constants": {EVIL: {"re": 1.0, "unit": EVIL, "free": True}, "a": {"free": True}, "b": {}},
    },
    "findings": [
        {
            "effect": EVIL,
            "where": EVIL,
            "step": "disk",
            "probability": 0.9,
            "share": 0.5,
            "bands_Hz": [[1e6, 2e6]],
            "parameters": {EVIL: {"value": 1.0, "u": 0.1, "unit": EVIL}},
            "chi2_per_dof_before": 3.0,
            "chi2_per_dof_after": 1.0,
            "held_out_before": 3.0,
            "held_out_after": 1.0,
            "alternatives": [],
            "same_as": [],
            "says": EVIL,
        }
    ],
    "not_decidable": [],
    "remarks": [],
    "leftover": {"bands_Hz": [], "chi2_per_dof": 1.0},
    "remaining": {"total": 0.001, "instrument": 0.001},
}


@pytest.fixture
def measurement(tmp_path: Path, build: Build, monkeypatch: pytest.MonkeyPatch) -> str:
    """A measurement with a fit, a refusal and a diagnosis that a hostile fitter handed in."""
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    sample = SampleStep(build.name, "disk")
    build = replace(build, steps=build.steps[:1])
    with closing(JournalWriter(journal_folder(tmp_path))) as journal:
        name, _ = journal.begin_measurement("1", build, "disk")
        columns, payload = sweep_columns(Sweep(np.linspace(1e6, 2e6, 51), np.linspace(5, 60, 51) - 10j))
        info = InstrumentInfo(EVIL, EVIL, "4294A", "1", "1", simulated=True)
        said = {"instrument": info, "build": build, "segment": 1, "segments": 1, "started": "", "settings": {"a": EVIL}}
        event = SweepEvent(measurement=name, sample=sample, columns=columns, notes=(EVIL,), **said)
        sweeps = (journal.append(event, payload)[0].id,)
        journal.append(StateEvent(state="measured", says=EVIL, measurement=name, sample=sample, by=EVIL, client="ana"))
        about = {"measurement": name, "sample": sample, "version": EVIL, "sweeps": sweeps}
        journal.append(FitEvent(fitter="good", report=_report(build, "good"), **about))
        journal.append(FitEvent(fitter="bad", error=EVIL, **about))
        journal.append(DiagnosisEvent(fitter="diagnosis", diagnosis=DIAGNOSIS, **about))
        return name


@pytest.mark.filterwarnings("ignore:constrained_layout not applied")
@pytest.mark.parametrize(
    "words",
    [
        ["samples"],
        ["samples", "--constants", "--fitter", "good"],
        ["show", "MEASUREMENT"],
        ["show", "S4.a"],
        ["journal", "audit"],
        ["export", "MEASUREMENT", "--to", "OUT"],
        ["report", "S4.a", "--out", "OUT.html"],
    ],
    ids=" ".join,
)
def test_what_a_fitter_answers_is_shown_as_text(
    measurement: str,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    place = {"MEASUREMENT": measurement, "OUT": str(tmp_path / "out"), "OUT.html": str(tmp_path / "out.html")}
    monkeypatch.setattr("sys.argv", ["pzctl", *(place.get(word, word) for word in words)])
    with pytest.raises(SystemExit) as ended:
        main()
    printed = "".join(capsys.readouterr())
    assert ended.value.code in (0, None), printed
    assert [part for part in (ESCAPE, "\r", "\u202e") if part in printed] == []
    if (page := tmp_path / "out.html").exists():
        assert "<script>alert" not in page.read_text(encoding="utf-8")


def test_the_live_view_shows_a_fitters_answer_as_text(
    measurement: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    with closing(JournalReader(journal_folder(tmp_path))) as journal:
        events = [decode(frames) for frames in journal.replay(1, None, 100)]
    watched = Watched()
    for event in events:
        watched.hear(event)
        console().print(watched.screen())
    printed = capsys.readouterr().out
    assert "[/red]" in printed
    assert ESCAPE not in printed
    assert "\u202e" not in printed


GOOD = DIAGNOSIS["findings"][0]
ODD = [
    {"says": 5},
    {"says": []},
    {"verdict": 1},
    {"findings": 5, "says": ["x"]},
    {"findings": [5], "says": ["x"]},
    {"findings": [{"says": {}}], "says": ["x"]},
    {"findings": [GOOD]},
    {"findings": [GOOD | {"parameters": {"a": 5}}], "says": ["x"]},
    {"findings": [GOOD | {"bands_Hz": [[1]]}], "says": ["x"]},
    {"findings": [GOOD | {"alternatives": [{"probability": None}]}], "says": ["x"]},
    {"final": []},
    {"not_decidable": [{"effect": "a", "where": "b", "shifts": {"c": "d"}}]},
    {"would_measure": [{"what": "a", "why": "b", "seconds": "c"}]},
    {"compared": 5},
]


@pytest.mark.parametrize("odd", ODD, ids=" ".join)
def test_a_diagnosis_of_another_form_is_refused(measurement: str, odd: dict[str, Any], tmp_path: Path) -> None:
    """Readers rely on its form: a malformed one would end `pzctl watch` and every report of the sample."""
    with closing(JournalWriter(journal_folder(tmp_path))) as journal:
        known = journal.measurement(measurement)
        assert known is not None
        about = {"id": "1", "measurement": measurement, "sweeps": journal.sweep_ids(measurement), "version": "9"}
        with pytest.raises(RequestError, match=r"answer of 'evil': diagnosis: ") as refused:
            checked(journal, known, SubmitRequest(fitter="evil", diagnosis=odd, **about), ())
        assert refused.value.problem.code == "bad-answer"
        allowed = DIAGNOSIS | {"says": [EVIL]}
        assert checked(journal, known, SubmitRequest(fitter="evil", diagnosis=allowed, **about), ())


def test_the_answers_to_one_measurement_have_a_limited_size(
    measurement: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are read all at once: otherwise a fitter could make every `fits` request exhaust the memory."""
    monkeypatch.setattr("pzctl.daemon.server.requests.submissions.MOST_ANSWERED", 20_000)
    with closing(JournalWriter(journal_folder(tmp_path))) as journal:
        known = journal.measurement(measurement)
        assert known is not None
        about = {"measurement": measurement, "sweeps": journal.sweep_ids(measurement), "error": "x" * 6000}
        for version in range(9):
            request = SubmitRequest(id="1", fitter="evil", version=str(version), **about)
            if version == 3:
                with pytest.raises(RequestError, match="the answers to this measurement have"):
                    checked(journal, known, request, ())
                return
            event = checked(journal, known, request, ())
            assert event is not None
            journal.append(event)
