"""The search for effects that explain a misfit: screening, refits, and the effects that remain."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from relaxing_disk import F, recorded

from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates
from pzctl.fitters.diagnosis.hypotheses.hypothesis import Hypothesis, fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.search import fitted_hypotheses
from pzctl.fitters.diagnosis.search.greedy_search import GreedySearch
from pzctl.fitters.diagnosis.search.look_alikes import resembling
from pzctl.fitters.diagnosis.search.plan import Plan
from pzctl.fitters.diagnosis.search.refit import as_refit, refit, shift_of
from pzctl.fitters.diagnosis.search.score_test import Score, scores, together
from pzctl.fitters.diagnosis.search.screening import screened
from pzctl.fitters.diagnosis.search.trial_fits import null_refit, polish, resoftened
from pzctl.fitters.diagnosis.search.weak_lines import weak_lines
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Device, EffectParameter, find_effect
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.sample import sample

POSITIVE = EffectParameter("mass", "kg/m2", typical=1.0, upper=10.0)
EITHER = EffectParameter("gain", "1", typical=1.0, lower=-5.0, upper=5.0)


def test_screening_ranks_the_true_effect_first_and_names_its_equivalents(lead_case) -> None:
    null = lead_case.search.null
    for promises in screened(lead_case.problem, null, lead_case.candidates):
        gains = [one.gain for one in promises]
        assert gains == sorted(gains, reverse=True)
    soft = screened(lead_case.problem, null, lead_case.candidates)[0]
    assert soft[0].candidate is lead_case.lead
    start = soft[0].start[lead_case.lead.prefix + "inductance"]
    assert start == pytest.approx(lead_case.inductance, rel=0.5)
    (mass,) = (one for one in soft if one.candidate.effect.name == "electrode-mass")
    assert {mass.candidate.where, *(one.where for one in mass.twins)} == {"face:back", "face:front"}
    assert screened(lead_case.problem, null, ()) == ([], [], [], [])


def test_a_strong_line_is_where_a_resonance_is_tried_and_is_no_weak_line(bare: Device, nothing: FitTask) -> None:
    mode = {"stiffness": 3e-3, "frequency": 3.3e6, "q": 90.0}
    f, device = (
        nothing.sweeps["disk"][0].frequency,
        bare.with_effect(find_effect("spurious-resonance"), "layer:disk", mode),
    )
    noise = np.random.default_rng(4).standard_normal((2, f.size))
    recorded = Sweep(f, device.impedance(f) * np.exp(2e-4 * (noise[0] + 1j * noise[1])))
    problem = Problem.of(solve(replace(nothing, sweeps={"disk": (recorded,)}), lambda _: None), None)
    null = fitted(problem, (), problem.values, near=True)
    assert not [line for line in weak_lines(null) if abs(line.frequency / 3.3e6 - 1) < 0.01]
    found = screened(problem, null, candidates(problem, ("spurious-resonance", "face-load", "loss-dispersion")))[1][0]
    start = {name.removeprefix(found.candidate.prefix): value for name, value in found.start.items()}
    assert found.candidate.effect.name == "spurious-resonance"
    assert start["frequency"] == pytest.approx(mode["frequency"], rel=0.01)
    assert start["stiffness"] == pytest.approx(mode["stiffness"], rel=0.7)


def test_a_resonance_just_outside_the_band_is_a_line_whose_flank_is_seen(bare: Device, nothing: FitTask) -> None:
    f = nothing.sweeps["disk"][0].frequency
    beyond = 1.003 * f[-1]
    device = bare.with_effect(
        find_effect("spurious-resonance"), "layer:disk", {"stiffness": 2e-4, "frequency": beyond, "q": 60.0}
    )
    noise = np.random.default_rng(4).standard_normal((2, f.size))
    recorded = Sweep(f, device.impedance(f) * np.exp(1e-4 * (noise[0] + 1j * noise[1])))
    problem = Problem.of(solve(replace(nothing, sweeps={"disk": (recorded,)}), lambda _: None), None)
    lines = weak_lines(fitted(problem, (), problem.values, near=True))
    assert [line.frequency for line in lines[:1]] == pytest.approx([beyond], rel=0.01)


def test_a_fit_follows_a_curved_valley(nothing: FitTask) -> None:
    """A dead layer, a capacitance and constants replace each other: one of these starts lost 30 nats to the other."""
    f = np.linspace(1.5e6, 12e6, 401)
    layer = {"back": 2e-5, "front": 2e-5, "stiffness": 0.85, "permittivity": 1.2}
    device = Device(sample(0).stack("disk")).with_effect(find_effect("surface-layer"), "layer:disk", layer)
    device = device.with_effect(find_effect("stray-capacitance"), "terminals", {"capacitance": 1e-10, "loss": 0.01})
    noise = np.random.default_rng(0).standard_normal((f.size, 2)) @ [1, 1j]
    recorded = Sweep(f, device.impedance(f) * np.exp(2e-4 * noise))
    problem = Problem.of(solve(replace(nothing, sweeps={"disk": (recorded,)}), lambda _: None), None)
    found = candidates(problem, ("surface-layer", "stray-capacitance"))
    both = [next(one for one in found if one.effect.name == name) for name in ("surface-layer", "stray-capacitance")]
    knobs = [pair for one in both for pair in zip(one.parameters, one.effect_parameters, strict=True)]

    def evidence(seed: int) -> float:
        sizes = {
            name: float(np.clip(knob.expected[0] * np.exp(0.7 * z), knob.lower, knob.upper))
            for (name, knob), z in zip(knobs, np.random.default_rng(seed).normal(size=len(knobs)), strict=True)
            if knob.from_nothing
        }
        start = {name: knob.null for name, knob in knobs} | sizes
        return fitted(problem, both, {**problem.values, **start}, near=True, rounds=4).log_evidence

    assert abs(evidence(0) - evidence(3)) < 15, "where in the valley it ends, rounding decides: ten nats at times"


def test_the_score_test_ranks_the_true_effect_first(lead_case) -> None:
    null = lead_case.null
    found = scores(lead_case.problem, lead_case.candidates, null.objective, null.descent.x)
    assert found[0].candidate is lead_case.lead
    assert found[0].gain > 3 * found[1].gain
    for one in found:
        assert one.gain >= 0
        assert one.survives <= 1 + 1e-9
        np.testing.assert_allclose(np.linalg.norm(one.columns, axis=0), 1)
        J = null.objective.jacobian(null.descent.x)
        inside = one.columns.T @ np.linalg.qr(J)[0]
        assert not inside.size or np.max(np.abs(inside)) < 1e-4, "what constants can do is taken off"


def test_what_an_error_of_the_instrument_can_do_as_well_says_little_of_an_effect(lead_case) -> None:
    null, lead = lead_case.null, lead_case.lead
    x = null.descent.x

    def of(*errors: np.ndarray) -> Score:
        found = scores(lead_case.problem, (lead,), null.objective, x, [np.stack(errors, axis=1)] if errors else ())
        return found[0]

    bare = null.objective.recordings[0].model
    f = null.objective.recordings[0].sweep.frequency
    knob = lead.effect_parameters[0]
    longer = bare.with_effect(lead.effect, lead.where, {knob.name: 0.1 * knob.typical})
    alike, other = 1e3 * bare.log_ratio(longer, f), 1e-4 * np.exp(1j * f / 1e5)
    free = of()
    assert of(alike).size == pytest.approx(free.size)
    assert of(alike).survives < 0.1 * free.survives
    assert of(other).survives == pytest.approx(free.survives, rel=0.1)
    assert of(alike).shifts.shape == x.shape


def test_no_score_remains_once_the_effect_is_in_the_model(lead_case) -> None:
    final = lead_case.final
    others = [one for one in lead_case.candidates if one is not lead_case.lead]
    found = scores(lead_case.problem, others, final.objective, final.descent.x)
    assert max(one.gain for one in found) < 30


def test_jointly_estimated_sizes_keep_their_sign() -> None:
    columns = np.linalg.qr(np.random.default_rng(1).standard_normal((40, 2)))[0]
    steps, fall = together(columns, -columns @ np.array([2.0, -3.0]), (POSITIVE, EITHER))
    assert steps == pytest.approx([2.0, -3.0])
    assert fall == pytest.approx(4 + 9)
    steps, fall = together(columns, -columns @ np.array([-2.0, -3.0]), (POSITIVE, EITHER))
    assert steps == pytest.approx([0.0, -3.0], abs=1e-9)
    assert fall == pytest.approx(9)
    assert together(np.zeros((40, 0)), np.ones(40), ())[1] == 0


def test_a_refit_shows_the_gain_of_an_effect_and_polishing_converges(lead_case) -> None:
    problem = lead_case.problem
    null, constants = null_refit(problem), lead_case.final.values
    values = {name: value for name, value in constants.items() if name not in lead_case.lead.parameters}
    rough = refit(problem, (lead_case.lead,), values, 2e-9)
    assert rough.chi2_per_dof < 0.01 * null.chi2_per_dof
    found = polish(problem, rough)
    assert found.chi2_per_dof < 2
    assert found.values[lead_case.lead.prefix + "inductance"] == pytest.approx(lead_case.inductance, rel=0.01)


def test_a_hypothesis_agrees_with_its_refit(lead_case) -> None:
    best = lead_case.search.best
    told = as_refit(lead_case.problem, best)
    assert told.effects == best.effects
    assert {name: told.values[name] for name in best.values} == pytest.approx(best.values)
    squares = sum(float(np.sum(np.abs(part) ** 2)) for part in told.in_noise)
    points = sum(part.size for part in told.in_noise)
    assert told.chi2_per_dof == pytest.approx(squares / (2 * points - told.descent.x.size), rel=1e-6)


def test_model_discrepancy_removes_a_wrong_models_misfit_but_not_a_correct_ones(lead_case) -> None:
    problem = lead_case.problem
    (wrong,) = resoftened(problem, lead_case.null).recordings
    (right,) = resoftened(problem, lead_case.final).recordings
    assert np.median(wrong.sigma / wrong.noise) > 100
    assert np.median(right.sigma / right.noise) == pytest.approx(1, abs=0.1)


def test_predicted_shifts_of_parameters_match_a_small_step(lead_case) -> None:
    objective, x = lead_case.final.objective, lead_case.final.descent.x
    change = 1e-7 * np.random.default_rng(3).standard_normal(x.size)
    before, after = (objective.coordinates.forward(at)[0] for at in (x, x + change))
    for name, moved in shift_of(objective, x, change).items():
        assert moved == pytest.approx(after[name] - before[name], rel=1e-3, abs=1e-9 * abs(before[name])), name


def test_the_search_finds_the_true_effect_and_nothing_else(lead_case) -> None:
    search = lead_case.search
    assert search.best.key == {lead_case.lead}
    assert search.ranked[0] is search.best
    assert search.inclusion({"lead-inductance"}) > 0.99
    assert search.inclusion({"electrode-mass", "leakage"}) < 0.1
    assert search.without(search.best, lead_case.lead) is search.null


def test_without_candidates_the_search_finds_nothing(lead_case) -> None:
    search = GreedySearch(lead_case.problem, ())
    assert search.run().effects == ()
    assert search.inclusion({"lead-inductance"}) == 0


@pytest.mark.long
def test_a_search_that_ends_at_its_budget_says_so(lead_case, monkeypatch: pytest.MonkeyPatch) -> None:
    considered = ("lead-inductance", "leakage")
    whole = diagnose(lead_case.task, considered)
    monkeypatch.setattr(fitted_hypotheses, "BUDGET", 0)
    cut = diagnose(lead_case.task, considered)
    assert [one.effect for one in cut.findings] == [one.effect for one in whole.findings] == ["lead-inductance"]
    assert (*whole.says, "The search ended at its budget of evaluations") == (
        *cut.says[:-1],
        cut.says[-1].split(":")[0],
    )


def test_what_looks_like_a_large_effect_is_compared_where_it_is_as_large(bare: Device) -> None:
    """A lead of 60 nH moves the resonances so far that one of usual size changes Z at other frequencies."""
    device = bare.with_effect(find_effect("lead-inductance"), "terminals", {"inductance": 6e-8})
    task = recorded(device.impedance(F))
    problem = Problem.of(solve(task, lambda _: None), None)
    cable, lead = (candidates(problem, (name,))[0] for name in ("cable", "lead-inductance"))
    start = {**problem.values, cable.prefix + "inductance": 6e-8}
    one, null = fitted(problem, (cable,), start), fitted(problem, (), problem.values, near=True)
    (found,) = resembling(problem, one, cable, null, [lead])
    assert found.gain > 0.95
    assert found.start[lead.prefix + "inductance"] == pytest.approx(6e-8, rel=0.05)


def test_beside_a_complete_description_nothing_is_fitted_that_it_would_hide(nothing: FitTask) -> None:
    problem = Problem.of(solve(nothing, lambda _: None), None)
    hidden = candidates(problem, ("stray-capacitance", "surface-layer", "face-load"))
    search = GreedySearch(problem, hidden)
    assert search.run().effects == ()
    assert search.null.is_complete
    assert list(search.found) == [frozenset()]


def test_where_constants_are_astray_effects_that_may_bring_them_back_are_fitted_from_the_build(
    nothing: FitTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What constants have absorbed promises too little to be fitted otherwise."""
    problem = Problem.of(solve(nothing, lambda _: None), None)
    null = fitted(problem, (), problem.values, near=True)
    from_the_build: list[str] = []
    plan = GreedySearch._from_the_build

    def noted(search: GreedySearch, parent: Hypothesis, effect: Candidate, start: Mapping[str, float]) -> Plan:
        from_the_build.append(effect.effect.name)
        return plan(search, parent, effect, start)

    monkeypatch.setattr(GreedySearch, "_from_the_build", noted)
    for astray in (False, True):
        monkeypatch.setattr(Hypothesis, "astray", astray)
        GreedySearch(problem, candidates(problem, ("leakage",)), found={null.key: null}).run()
        assert from_the_build == ["leakage"] * astray
