"""The scoring of diagnoses in the lab world, and how runs are counted, pooled and sealed."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import pytest

from pzctl.fitters.proof.calibration import calibration, reliability
from pzctl.fitters.proof.judge import ProofError
from pzctl.fitters.proof.lab_judge import LabCase, matches
from pzctl.fitters.proof.lab_metrics import by_effect, lab_figures, said_and_right
from pzctl.fitters.proof.lab_page import main
from pzctl.fitters.proof.planted_judge import PlantedCase, planted_figures
from pzctl.fitters.proof.run_list import SealedRun, complete, enter, pooled, read_runs
from pzctl.fitters.proof.wilson import HitShare


def planted(effect: str, *where: str, role: str = "dominating", accept: tuple[str, ...] = ()) -> dict[str, Any]:
    return {"effect": effect, "accept": accept, "where": where, "role": role, "step": "disk", "moves": 0.1, "gain": 1e5}


def truth(kind: str, *findings: dict[str, Any], also: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
    constants = {"disk.c33D": [1e11, 1e9], "ml1.z": [1e7, 0.0]}
    return {"kind": kind, "findings": findings, "faint": [], "also": also, "constants": constants}


def found(effect: str, where: str, p: float = 0.97, *same: Any, **sizes: float) -> dict[str, Any]:
    parameters = {name: {"value": value, "u": value / 10} for name, value in sizes.items()}
    return {"effect": effect, "where": where, "probability": p, "same_as": same, "parameters": parameters}


def answer(*findings: dict[str, Any], verdict: str = "explained", c: complex = 1.001e11 + 1.3e9j) -> dict[str, Any]:
    constants = {
        "disk.c33D": {"re": c.real, "im": c.imag, "u_re": 1e8, "u_im": 1e8},
        "ml1.z": {"re": 1e7, "im": None, "u_re": 1e5, "u_im": None},
    }
    return {"verdict": verdict, "findings": findings, "final": {"constants": constants}, "seconds": 2.0}


LEAD, VOID = planted("lead-inductance", "terminals"), planted("bond-void", "interface:glue1|", role="findable")
WEDGE = planted("thickness-variation", "layer:disk", role="imperfection")
CASES = {
    "first": (truth("one", LEAD), answer(found("lead-inductance", "terminals"))),
    "extra": (truth("one", LEAD), answer(found("lead-inductance", "terminals"), found("leakage", "terminals"))),
    "second": (
        truth("two", LEAD, VOID),
        answer(found("bond-void", "interface:glue1|ml1"), found("lead-inductance", "terminals", 0.6)),
    ),
    "place": (truth("one", VOID), answer(found("bond-void", "interface:disk|glue1"))),
    "alike": (
        truth("one", LEAD),
        answer(found("cable", "terminals", 0.8, {"effect": "lead-inductance", "where": "terminals"})),
    ),
    "doubtful": (truth("one", LEAD), answer(found("leakage", "terminals", 0.4))),
    "null": (truth("instrument"), answer(found("analyzer-error", "sweep"), verdict="no-mismatch")),
    "mute": (truth("imperfect", also=(WEDGE,)), answer(verdict="unexplained")),
    "minor": (truth("imperfect", also=(WEDGE,)), answer(found("thickness-variation", "layer:disk"))),
    "outside": (truth("outside", planted("unknown", "any")), answer(found("unknown", "sweep"), verdict="unexplained")),
    "error": (truth("one", LEAD), {"error": "a defect"}),
}
CASES["null"][0]["also"] = ({"effect": "analyzer-error", "where": ["sweep"], "step": "disk"},)
JUDGED = {name: LabCase(name, *case) for name, case in CASES.items()}


@pytest.mark.parametrize(("moves", "first"), [(0.2, True), (0.05, False)])
def test_an_imperfection_may_stand_before_the_dominating_effect_if_it_moves_more(moves: float, first: bool) -> None:
    said = answer(found("thickness-variation", "layer:disk"), found("lead-inductance", "terminals"))
    case = LabCase("uneven", truth("one", LEAD, also=(WEDGE | {"moves": moves},)), said)
    assert case.first_is_dominating(alike=False) is first


def test_every_named_effect_has_one_class() -> None:
    classes = {name: [one for _, one in case.classes] for name, case in JUDGED.items()}
    assert classes == {
        "first": ["right"],
        "extra": ["right", "wrong"],
        "second": ["right", "right"],
        "place": ["wrong"],
        "alike": ["alike"],
        "doubtful": [],
        "null": ["allowed"],
        "mute": [],
        "minor": ["allowed"],
        "outside": ["right"],
        "error": [],
    }


def test_an_equivalent_name_counts_and_the_face_may_be_open() -> None:
    cable = planted("cable", "terminals", accept=("lead-inductance",))
    assert matches(found("lead-inductance", "terminals"), cable)
    assert matches(found("bond-void", "interface:glue1|ml1"), VOID)
    assert not matches(found("bond-void", "interface:ml1|glue2"), VOID)


def test_metrics_count_each_case_in_its_category() -> None:
    shares = lab_figures(list(JUDGED.values())).shares
    counts = {name: (one.hits, one.of) for name, one in shares.items()}
    # cases with a dominating effect: first extra second alike doubtful error; `place` has none
    assert counts["dominating effect first"] == (2, 6)
    assert counts["dominating effect first, or in the class said first"] == (3, 6)
    assert counts["every name said right, of cases with a name"] == (3, 5)
    assert counts["names said that are right"] == (6, 8)
    assert counts["a wrong name said for sure"] == (2, 11)
    assert counts["instrument and imperfections only: nothing wrong, not unexplained"] == (2, 3)
    assert counts["instrument only: no name, not unexplained"] == (1, 1)
    assert counts["outside the catalogue: no wrong name"] == (1, 1)
    assert counts["findable effects named"] == (4, 8)
    assert counts["95 % intervals of constants, real parts"] == (20, 20)
    assert counts["95 % intervals of constants, imaginary parts"] == (0, 10)
    assert counts["answered without an error"] == (10, 11)
    assert len(said_and_right(list(JUDGED.values()))) == 8
    lead = next(row for row in by_effect(list(JUDGED.values())) if row.effect == "lead-inductance")
    assert (lead.planted, lead.dominating, lead.first, lead.found) == (6, 6, 2, 3)


def test_wilson_intervals_are_the_published_ones() -> None:
    # R. G. Newcombe, Stat. Med. 17 (1998) 857, table I, method 3
    for hits, of, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert HitShare(hits, of).interval == pytest.approx((low, high), abs=1e-4)
    assert HitShare(0, 0).interval == (0.0, 1.0)
    assert HitShare(1, 2) + HitShare(3, 4) == HitShare(4, 6)


def test_a_constant_forecast_has_no_skill_and_a_perfect_one_has_all() -> None:
    flags = [True] * 9 + [False]
    constant = calibration([(0.9, flag) for flag in flags])
    assert constant.log_skill == pytest.approx(0, abs=1e-9)
    assert constant.brier_skill == pytest.approx(0, abs=1e-9)
    assert calibration([(float(flag), flag) for flag in flags]).brier_skill == pytest.approx(1, abs=1e-6)
    assert calibration([(0.99, False), (0.99, True)]).log_skill < 0
    assert math.isnan(calibration([]).log_score)
    assert reliability([(0.97, True), (0.96, False)]) == [(pytest.approx(0.965), HitShare(1, 2))]


def seal(folder: Path) -> str:
    data = json.dumps({name: case[0] for name, case in CASES.items()}).encode()
    (folder / "truth.json").write_bytes(data)
    (folder / "answers.json").write_text(json.dumps({name: case[1] for name, case in CASES.items() if name != "error"}))
    return hashlib.sha256(data).hexdigest()


def test_every_sealed_run_is_listed_and_pooled(tmp_path: Path) -> None:
    published, listed = seal(tmp_path), tmp_path / "docs" / "runs.json"
    broken_off = SealedRun("lab", 1001, 5, "v1", "0" * 64, "2026-01-01T00:00")
    enter(listed, broken_off)
    for seed in (1002, 1003):
        enter(listed, SealedRun("lab", seed, 11, "v1", published, "2026-01-02T00:00"))
        told = main(tmp_path, published, "Sealed.", listed)
    runs = read_runs(listed)
    assert runs[0] == broken_off
    assert pooled(runs, "lab")["dominating effect first"] == HitShare(4, 12)
    assert pooled(runs, "ideal") == {}
    page = Path(told["page"]).read_text()
    assert "not finished" in page
    assert "33.3 % (14 to 61)" in page
    assert (tmp_path / "proof-lab-reliability.svg").exists()
    with pytest.raises(ValueError, match="max"):
        complete(listed, "another", {}, 1.0)


def test_a_changed_truth_is_rejected(tmp_path: Path) -> None:
    published = seal(tmp_path)
    (tmp_path / "truth.json").write_text("{}")
    with pytest.raises(ProofError, match="it was changed"):
        main(tmp_path, published, "", None)


def test_a_planted_effect_is_judged_against_the_unchanged_recording() -> None:
    part = {"effect": "cable", "where": "terminals", "parameter": "inductance", "size": 1e-8, "source": "x"}
    part |= {"alike": {"lead-inductance": "inductance"}, "moves": 0.1}
    own = answer(found("lead-inductance", "terminals", 0.9, inductance=5e-9), found("leakage", "terminals"))
    for said, named, right, new in (
        (found("lead-inductance", "terminals", 0.9, inductance=1.55e-8), True, True, []),
        (found("lead-inductance", "terminals", 0.9, inductance=1.0e-8), True, False, []),
        (found("cable", "terminals", 0.9, inductance=1.1e-8), True, True, []),
        (found("stray-capacitance", "terminals", 0.9), False, False, ["stray-capacitance"]),
        (found("cable", "terminals", 0.3, inductance=1.0e-8), False, False, []),
    ):
        case = PlantedCase("x", part, answer(said), own)
        assert (case.named, case.right, case.new_names) == (named, right, new)
    shares = planted_figures([PlantedCase("x", part, answer(found("sweep-lag", "sweep", 0.9, "cable")), own)])
    assert shares["named, or in the class of what is"] == HitShare(1, 1)
    assert shares["named"] == HitShare(0, 1)
