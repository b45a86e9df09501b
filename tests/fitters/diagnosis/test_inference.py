"""Inference through the public results: probabilities of explanations, shifts of constants, undetectable effects."""

import ast
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.fitters.diagnosis import decision_rules
from pzctl.fitters.diagnosis.data_quality.data_gates import Gated
from pzctl.fitters.diagnosis.data_quality.data_issues import DataCheck, DataIssue
from pzctl.fitters.diagnosis.decision_rules import ODDS, SUREST, UNFORESEEN
from pzctl.fitters.diagnosis.findings import Alternative, Finding
from pzctl.fitters.diagnosis.hypotheses.hypothesis import probabilities
from pzctl.fitters.diagnosis.hypotheses.instrument_artefacts import UNKNOWN
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate
from pzctl.fitters.diagnosis.inference import certainty, conclusion
from pzctl.fitters.diagnosis.inference.averaged_constants import averaged_constants
from pzctl.fitters.diagnosis.inference.certainty import Certainties, Certainty
from pzctl.fitters.diagnosis.inference.conclusion import Conclusion, conclude
from pzctl.fitters.diagnosis.inference.data_findings import of_the_data, verdict_with, where_disturbed
from pzctl.fitters.diagnosis.inference.effect_size import (
    change_by,
    constants_of,
    largest_of,
    moved,
    moves_a_constant,
    powers_of,
)
from pzctl.fitters.diagnosis.inference.finite_diameter import FiniteDisk, beside, tried
from pzctl.fitters.diagnosis.inference.uncertainty_by_source import by_source
from pzctl.fitters.diagnosis.inference.undetectable import not_decidable
from pzctl.fitters.diagnosis.learning.learned_conclusion import as_sure_as_the_list
from pzctl.fitters.diagnosis.search.greedy_search import GreedySearch
from pzctl.fitters.diagnosis.search.score_test import scores
from pzctl.fitters.diagnosis.validation.improvement import LeastSquares
from pzctl.fitters.error_model.prior_scales import INSTRUMENT
from pzctl.fitters.interface import Constant
from pzctl.models.effects import find_effect

from .conftest import NOISE


def test_the_true_effect_is_found_with_its_size(lead_case) -> None:
    found = conclude(lead_case.search)
    (named,) = found.findings
    assert named.candidate is lead_case.lead
    assert named.probability > 0.9
    final, without = (LeastSquares.of(lead_case.problem, one) for one in (found.final, named.without))
    assert final.share_beside(without) > 0.99
    assert found.verdict == "explained"
    assert not found.something_left


def test_an_effect_moves_what_constants_leave_of_it(lead_case) -> None:
    search = lead_case.search
    null, alone = search.null, search.found[frozenset({lead_case.lead})]
    # a fit by least squares leaves that and the noise, whatever errors of instrument and model could imitate
    (left,) = LeastSquares.of(lead_case.problem, null).fit.in_noise
    expected = np.sqrt(np.mean(np.abs(left) ** 2) / 2 - 1) * np.sqrt(2) * NOISE
    assert moved(lead_case.problem, alone, lead_case.lead, null) == pytest.approx(expected, rel=0.1)


def test_an_unexplained_misfit_is_reported_as_unexplained(lead_case) -> None:
    search = GreedySearch(lead_case.problem, ())
    search.run()
    found = conclude(search)
    assert found.something_left
    assert (found.verdict, found.named) == ("unexplained", ())


def test_what_is_there_without_a_name_is_no_agreement(lead_case) -> None:
    null = lead_case.search.null
    left = conclude(GreedySearch(lead_case.problem, (), found={null.key: null})).remaining
    agrees = Conclusion(null, null, (), left, something_else=0.5, nearest=None)
    either = (Alternative("face-load", "face:front", 0.47), Alternative("sweep-lag", "sweep", 0.42))
    undecided = replace(agrees, something_else=0.96, undecided=either)
    exact = SimpleNamespace(cause_left=0.0)
    verdicts = [replace(one, final=exact).verdict for one in (agrees, undecided)]
    assert verdicts == ["no-mismatch", "unexplained"]


@dataclass(eq=False)
class Answer:
    """A hypothesis that has effects and nothing else."""

    effects: tuple[str, ...]


def test_of_two_answers_about_as_certain_the_more_probable_one_is_told(monkeypatch) -> None:
    null, likely, rare = (Answer((name,) if name else ()) for name in ("", "ml1", "glue1"))
    search = SimpleNamespace(best=likely, probable=[likely, rare, null], null=null)
    sure = {"ml1": 0.862, "glue1": 0.865}

    def certain(_search, one, _certainties):
        return one, {name: Certainty(sure[name], sure[name], frozenset()) for name in one.effects}

    monkeypatch.setattr(conclusion, "_without_the_improbable", certain)
    monkeypatch.setattr(conclusion, "_most_probable_alike", lambda _search, there, _sure: there)
    told = [conclusion._most_certain(search, None)[0]]
    sure["glue1"] = 0.9
    told.append(conclusion._most_certain(search, None)[0])
    assert told == [likely, rare]


def test_the_second_of_two_effects_of_one_name_is_as_certain_as_that_there_are_two(monkeypatch) -> None:
    front, back = (Candidate(find_effect("local-mass"), face, ("disk",), ()) for face in ("face:front", "face:back"))
    both, one = SimpleNamespace(effects=(back, front)), SimpleNamespace(effects=(front,))
    rest = {front: SimpleNamespace(log_weight=-3900), back: SimpleNamespace(log_weight=-300)}
    search = SimpleNamespace(
        best=SimpleNamespace(fit=SimpleNamespace(exact=True)),
        posterior=[(both, 0.3), (one, 0.6)],
        without=lambda _both, effect: rest[effect],
    )
    monkeypatch.setattr(certainty, "look_alikes", lambda *_: set())
    monkeypatch.setattr(Certainties, "_itself_in", lambda _, of: dict.fromkeys(of.effects, 1.0))
    sure = Certainties(search).of(both)
    assert (sure[front].of_effect, sure[back].of_effect) == (pytest.approx(0.9), pytest.approx(0.3))


@pytest.mark.parametrize(("lead", "cable", "told"), [(0.4, 0.45, "lead-inductance"), (0.3, 0.6, "cable")])
def test_a_lead_that_may_be_a_short_cable_is_a_lead(lead: float, cable: float, told: str) -> None:
    candidates = {
        name: Candidate(find_effect(name), "terminals", ("disk",), ()) for name in ("lead-inductance", "cable")
    }
    found = {frozenset({one}): SimpleNamespace(effects=(one,), key=frozenset({one})) for one in candidates.values()}
    probable = {"lead-inductance": lead, "cable": cable}
    search = SimpleNamespace(found=found)
    certainties = SimpleNamespace(search=search, present=lambda names: sum(probable.get(name, 0.0) for name in names))
    first = next(iter(found.values()))
    sure = {first.effects[0]: Certainty(lead, lead + cable, frozenset(candidates.values()) - first.key)}
    (named,) = conclusion._most_probable_alike(certainties, first, sure).effects
    assert named.effect.name == told


def test_only_the_part_that_constants_cannot_absorb_counts_as_an_effects_shift(lead_case) -> None:
    problem, best, lead = lead_case.problem, lead_case.search.best, lead_case.lead
    (change,) = change_by(problem, best, lead)
    (sweep,) = lead_case.task.sweeps["disk"]
    without = lead_case.stack.impedance(sweep.frequency)
    told = np.log(1 + 2j * np.pi * sweep.frequency * lead_case.inductance / without)
    assert np.median(np.abs(change - told)) < 0.02 * np.median(np.abs(told))
    (left,) = best.projected([[change]]).T
    assert np.linalg.norm(left) < np.linalg.norm(change)
    power, largest = powers_of(problem, best)[lead], largest_of(problem, best, lead)
    assert np.sqrt(power.sum()) == pytest.approx(np.linalg.norm(left))
    assert largest == pytest.approx(np.max(np.abs(left)) / INSTRUMENT), "in units of the accuracy"


def test_constants_are_correct_only_with_the_effect(lead_case) -> None:
    problem, search = lead_case.problem, lead_case.search
    right, wrong = (constants_of(problem, one) for one in (search.best, search.null))
    true = lead_case.stack.parameters()
    for name in ("c33D", "h33", "eps33S"):
        own = right[f"disk.{name}"]
        assert own.u_re
        assert abs(own.re - true[f"disk.{name}.re"]) < 4 * own.u_re, name
    assert moves_a_constant(wrong, right)
    assert not moves_a_constant(right, right)


def test_doubt_about_what_is_present_widens_the_uncertainties(lead_case) -> None:
    problem, best, null = lead_case.problem, lead_case.search.best, lead_case.search.null
    as_good = replace(null, log_odds=null.log_odds + best.log_weight - null.log_weight)
    part, other = probabilities([best, as_good])
    assert 1e-4 < other < 0.99
    alone, there = constants_of(problem, best), constants_of(problem, null)
    averaged = averaged_constants(problem, best, [best, as_good])
    for name, own in averaged.items():
        if alone[name].u_re:
            mean = part * alone[name].u_re ** 2 + other * (there[name].u_re ** 2 + (there[name].re - own.re) ** 2)
            assert own.u_re == pytest.approx(np.sqrt(mean))
            assert own.re == alone[name].re
    assert averaged_constants(problem, best, [best]) == alone


def test_uncertainties_are_told_by_source_whose_squares_add_up(lead_case) -> None:
    problem, best, null = lead_case.problem, lead_case.search.best, lead_case.search.null
    as_good = replace(null, log_odds=null.log_odds + best.log_weight - null.log_weight)
    averaged = averaged_constants(problem, best, [best, as_good])
    for constants in (constants_of(problem, best), averaged):
        for name, own in by_source(problem, best, constants).items():
            for u, by in ((own.u_re, own.u_by), (own.u_im, own.u_by_im)):
                assert bool(u) == (by is not None), name
                assert by is None or sum(part**2 for part in by.values()) == pytest.approx((u or 0) ** 2), name
    alone, doubted = (by_source(problem, best, one)["disk.h33"].u_by for one in (constants_of(problem, best), averaged))
    assert alone
    assert doubted
    assert doubted["noise"] == pytest.approx(alone["noise"])
    assert doubted["model"] > alone["model"], "that the lead may not be there is a doubt about the model"


@given(st.floats(-3, 3), st.floats(-3, 3), st.booleans())
def test_a_constant_has_shifted_if_either_part_shifted_by_its_uncertainty(re: float, im: float, free: bool) -> None:
    before = {"disk.c33D": Constant(100.0, 5.0, 1.0, 0.1, "Pa")}
    after = {"disk.c33D": Constant(100.0 + re, 5.0 + 0.1 * im, 1.0, 0.1, "Pa", free=free)}
    moved = abs(after["disk.c33D"].re - 100.0) > 1.0 or abs(after["disk.c33D"].im - 5.0) > 0.1
    assert moves_a_constant(before, after) == (free and moved)
    assert not moves_a_constant({}, after)


def shift_in_u(name: str, shift: float, constants: dict[str, Constant]) -> float:
    own = constants[name.removesuffix(".im")]
    value, u = (own.im, own.u_im) if name.endswith(".im") else (own.re, own.u_re)
    return abs(shift * value) / (u or np.inf)


def test_undetectable_effects_are_listed_with_their_shift_of_constants(lead_case) -> None:
    problem, final = lead_case.problem, lead_case.final
    remaining = scores(problem, lead_case.candidates, final.objective, final.descent.x)
    constants = constants_of(problem, lead_case.search.best)
    listed = {one.effect: one for one in not_decidable(final, remaining, constants, {"lead-inductance"})}
    assert "lead-inductance" not in listed
    mass = listed["electrode-mass"]
    assert mass.where.startswith("face:")
    assert mass.shifts["disk.c33D"] > 0, "a mass that is ignored makes the disk too soft"
    assert max(shift_in_u(*one, constants) for one in mass.shifts.items()) > 1, "a shift below u would not be listed"
    assert not_decidable(final, remaining, constants, {one.candidate.effect.name for one in remaining}) == ()


def test_two_dimensions_are_not_tried_where_one_is_sufficient(lead_case) -> None:
    said: list[str] = []
    assert tried(lead_case.task, lead_case.null, lead_case.final, said.append) is None
    assert said == []


def test_what_is_beside_a_finite_diameter_is_no_more_probable_than_that() -> None:
    said = [
        Finding(name, "terminals", "disk", probability, (), {}, 9.0, 1.0, 9.0, 1.0, (), "")
        for name, probability in (("stray-capacitance", 0.9), ("cable", 0.8), (UNKNOWN, 1.0))
    ]
    found = beside(FiniteDisk(None, 0.6), said)  # type: ignore[arg-type]
    assert [(one.effect, one.probability) for one in found] == [
        ("stray-capacitance", pytest.approx(0.54)),
        (UNKNOWN, 1.0),
    ]


JUMP = DataIssue("step", (2e6, 2.01e6), 3.0, 0.004)
LINE = SimpleNamespace(steps=("disk",), resonance_parameters=("line",))


def gated(*troubles: DataIssue, turned: str = "") -> Gated:
    return Gated({}, (DataCheck("disk", 0, 801, troubles=troubles, turned=turned),))


@pytest.mark.parametrize(
    ("data", "verdict", "deserved"),
    [
        (gated(), "no-mismatch", "no-mismatch"),
        (gated(turned="inverted"), "no-mismatch", "explained"),
        (gated(turned="inverted"), "unexplained", "unexplained"),
        (gated(JUMP), "no-mismatch", "unexplained"),
        (gated(JUMP), "explained", "partly-explained"),
        (gated(JUMP, turned="inverted"), "explained", "partly-explained"),
    ],
)
def test_inverted_data_can_be_explained_but_disturbed_data_never_fully(
    data: Gated, verdict: str, deserved: str
) -> None:
    assert verdict_with(data, verdict) == deserved  # type: ignore[arg-type]


def test_beside_errors_no_effect_is_surer_than_hypotheses_that_may_all_be_wrong(lead_case) -> None:
    """Of an exact recording that is explained to its noise there is no such doubt."""
    best = lead_case.search.best
    assert best.fit.exact
    doubtful = SimpleNamespace(exact=False)
    search = SimpleNamespace(
        posterior=lead_case.search.posterior, problem=lead_case.problem, best=SimpleNamespace(fit=doubtful)
    )
    sure, unsure = (Certainties(one).present({"lead-inductance"}) for one in (lead_case.search, search))
    assert unsure == pytest.approx((1 - UNFORESEEN) * sure + UNFORESEEN * ODDS)
    assert Certainties(search).present({"leakage"}) >= UNFORESEEN * ODDS


def test_an_effect_is_no_more_certain_than_it_is_present(lead_case) -> None:
    certainties = Certainties(lead_case.search)
    assert certainties.present({"lead-inductance"}) == pytest.approx(1, abs=0.01)
    for name in ("lead-inductance", "stray-capacitance", "electrode-mass", "leakage"):
        assert certainties.present({name}) <= lead_case.search.inclusion({name}) + 1e-9
    (own,) = certainties.of(lead_case.search.best).values()
    assert own.of_effect == certainties.present({"lead-inductance"}) <= own.of_class


def test_at_most_three_disturbances_are_listed_and_lines_within_them_dropped() -> None:
    (finding,) = of_the_data(gated(*[JUMP] * 5), 1.0, 1.0)
    assert finding.says.count("it jumps by") == 3
    assert "and 2 more" in finding.says
    for at, inside in ((2.005e6, True), (1.985e6, True), (1.9e6, False)):
        found = SimpleNamespace(values={"line": at})
        assert where_disturbed(gated(JUMP), LINE, found) is inside  # type: ignore[arg-type]
        elsewhere = SimpleNamespace(steps=("ml1",), resonance_parameters=("line",))
        assert not where_disturbed(gated(JUMP), elsewhere, found)  # type: ignore[arg-type]
    small = replace(JUMP, kind="glitch", size=1e-3)
    assert of_the_data(gated(small), 1.0, 1.0) == [], "a small glitch may be a faint line"
    slight = replace(JUMP, size=1e-3)
    assert of_the_data(gated(slight), 1.0, 1.0) == [], "a 4294A is accurate to 0.08 %"


def test_every_threshold_states_its_source() -> None:
    body = ast.parse(Path(decision_rules.__file__).read_text(encoding="utf-8")).body[1:]
    for number, words in zip(body[::2], body[1::2], strict=True):
        assert isinstance(number, ast.Assign)
        assert isinstance(words, ast.Expr)
        assert len(ast.literal_eval(words.value)) > 20


def test_where_laws_are_looked_for_no_name_is_surer_than_the_list_is_complete(lead_case) -> None:
    found = conclude(lead_case.search)
    (listed,), (unsure,) = found.named, as_sure_as_the_list(found).named
    assert listed.candidate.effect.name == unsure.candidate.effect.name == "lead-inductance"
    assert listed.probability > 0.95
    assert unsure.probability == SUREST < 0.9
