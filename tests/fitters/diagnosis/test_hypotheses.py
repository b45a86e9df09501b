"""Hypotheses: possible places of an effect, likely sizes, held-out data, and posterior probabilities."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.diagnosis.decision_rules import ODDS
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates, flaws
from pzctl.fitters.diagnosis.hypotheses.conditions import as_devices
from pzctl.fitters.diagnosis.hypotheses.held_out import bands_of, blocks, held_out
from pzctl.fitters.diagnosis.hypotheses.hypothesis import (
    Hypothesis,
    coarseness,
    fitted,
    marginal_of,
    probabilities,
    temper_of,
)
from pzctl.fitters.diagnosis.hypotheses.instrument_artefacts import FLAWS, RangeStep
from pzctl.fitters.diagnosis.hypotheses.own_losses import log_losses, own_losses
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.hypotheses.size_priors import (
    SizePriors,
    block_of,
    formula_errors,
    log_tails_of,
    shown,
    unusual_size,
    width,
)
from pzctl.fitters.diagnosis.search.greedy_search import GreedySearch
from pzctl.fitters.diagnosis.search.screening import ScreenedCandidate
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.recording import Prior, QualityFactor
from pzctl.fitters.error_model.error_sizes import ErrorSizes
from pzctl.fitters.error_model.prior_scales import LEFT, SHAPE
from pzctl.fitters.interface import FitTask
from pzctl.models import materials
from pzctl.models.effects import Device, EffectParameter, catalogue
from pzctl.models.effects.base.scale import resonance
from pzctl.models.stack import Piezo
from pzctl.models.sweep import Sweep

FROM_NOTHING = EffectParameter("inductance", "H", typical=2e-8, upper=1e-5, prior=(1.5e-8, 0.9))
BETWEEN = EffectParameter("impedance", "ohm", typical=10.0, lower=25.0, upper=200.0, null=50.0)
EITHER_SIGN = EffectParameter("gain", "1", typical=1e-3, lower=-0.5, upper=0.5)


def test_a_wrong_dimension_costs_nats_but_explains_no_amount_of_evidence() -> None:
    z = np.linspace(0, 12, 25)
    cost = z**2 / 2 - [log_tails_of(np.array([one]), np.array([one])) for one in z]
    assert cost[:4] == pytest.approx(z[:4] ** 2 / 2, abs=0.15), "what is usual is as usual as it was"
    assert np.all(np.diff(cost) > 0)
    assert cost[-1] == pytest.approx(-np.log(0.01 / 10) + (12 / 10) ** 2 / 2, rel=0.01)
    assert log_tails_of(z, z) == pytest.approx(sum(log_tails_of(np.array([one]), np.array([one])) for one in z))


def test_an_effect_is_tried_at_all_its_places(lead_case) -> None:
    found = candidates(lead_case.problem, ("electrode-mass", "cable"))
    assert {(one.effect.name, one.where) for one in found} == {
        ("electrode-mass", "face:back"),
        ("electrode-mass", "face:front"),
        ("cable", "terminals"),
    }
    assert {one.steps for one in found} == {("disk",)}
    assert {one.effect.name for one in candidates(lead_case.problem)} <= {effect.name for effect in catalogue()}


@pytest.mark.parametrize(
    ("name", "rough"),
    [
        ("cable", False),
        ("electrode-mass", False),
        ("face-load", False),
        ("dielectric-dispersion", False),
        ("thickness-variation", True),
        ("local-mass", True),
    ],
)
def test_circuits_and_laws_err_smoothly_parts_of_the_face_from_line_to_line(lead_case, name: str, rough: bool) -> None:
    (one, *_) = candidates(lead_case.problem, (name,))
    made = marginal_of(lead_case.problem, (one,), lead_case.problem.values)
    (points,) = made.columns(made.objective.coordinates.x).points
    assert bool(np.any(points.bent > 0)) is rough


@pytest.fixture(scope="module")
def two_steps(cases) -> Problem:
    """A disk before and after a layer was glued to it."""
    files = json.loads((cases / "truth.json").read_text())["glue-null"]["files"]
    folder = cases / "glue-null"
    sweeps = {step: tuple(read_recording(folder / file) for file in of) for step, of in files.items()}
    task = FitTask(read_build(folder / "build.toml"), sweeps)
    return Problem.of(solve(task, lambda _: None), None)


def test_the_library_knows_losses_and_a_relaxation_adds_to_them(lead_case) -> None:
    problem, sheet = lead_case.problem, materials.find("Pz27").values
    told = {prior.parameter: prior for prior in problem.losses}
    assert {(name, one.mean, one.u) for name, one in told.items()} == {
        (f"disk.{name}.im", sheet[name].im, sheet[name].u_im) for name in ("c33D", "h33", "eps33S")
    }
    (one,) = candidates(problem, ("dielectric-dispersion",))
    beside = {prior.parameter: prior for prior in own_losses(problem.losses, (one,))}
    assert [name for name, prior in beside.items() if prior is not told[name]] == ["disk.eps33S.im"]
    loss, knobs = beside["disk.eps33S.im"], {"relaxation": 0.03, "relaxation_frequency": 0.6}
    absent = {name: knob.null for name, knob in zip(one.parameters, one.effect_parameters, strict=True)}
    values = {**absent, **{one.prefix + name: value for name, value in knobs.items()}}
    values |= {"disk.eps33S.re": 8e-9, "disk.eps33S.im": -1.4e-10}
    device = Device(lead_case.stack.replace({name: values[name] for name in ("disk.eps33S.re", "disk.eps33S.im")}))
    (part,) = device.with_effect(one.effect, one.where, knobs).assembly.parts
    (disk,) = (layer for layer in part.stack.layers if layer.name == "disk")
    assert isinstance(disk, Piezo)
    far = np.array([1e4]) * resonance(lead_case.stack)  # where nothing relaxes any more
    (own,) = np.imag(disk.eps_law.over(disk.eps33S, far))
    assert loss.predicted(values) == pytest.approx(own, rel=0.05), "to first order"
    for name, slope in loss.slopes(values).items():
        step = 1e-4 * (abs(values[name]) or 1.0)
        ends = [loss.predicted({**values, name: values[name] + way * step}) for way in (1, -1)]
        assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-5, abs=1e-20), name


def test_losses_weigh_explanations_as_a_prior_would_but_draw_no_fit(lead_case) -> None:
    problem = replace(lead_case.problem, losses=())
    inductance, *others = lead_case.lead.effect_parameters  # whatever the catalogue says of leads
    lead = replace(lead_case.lead, effect_parameters=(replace(inductance, prior=(1.6e-8, 1.2)), *others))

    def made(problem: Problem) -> Hypothesis:
        return fitted(problem, (lead,), problem.values, (ErrorSizes(),), fixed=True)

    free = made(problem)
    loss = free.values["disk.c33D.im"]
    for known in (0.9, 0.5, 2.0):  # of the loss that was fitted
        prior = Prior("disk.c33D.im", known * loss, 0.3 * known * abs(loss))
        told, drawn = made(replace(problem, losses=(prior,))), made(replace(problem, priors=(*problem.priors, prior)))
        assert told.values["disk.c33D.im"] == pytest.approx(loss, rel=1e-6)
        assert told.log_evidence - free.log_evidence == pytest.approx(drawn.log_evidence - free.log_evidence, abs=0.2)
    far = made(replace(problem, losses=(Prior("disk.c33D.im", 30 * loss, loss),)))
    assert -13 < far.log_evidence - free.log_evidence < -9, "one in a hundred is off by ten times what is said"


def test_losses_of_a_dozen_ceramics_cost_no_more_than_a_dozen_times_those_of_one() -> None:
    def of(layers: int) -> float:
        """Return ln of the density for ceramics that are all alike; combinations of all would be 2^36."""
        names = [f"p{k}.{constant}.im" for k in range(layers) for constant in ("c33D", "h33", "eps33S")]
        count = len(names)
        coordinates = SimpleNamespace(
            parameters=names, forward=lambda x: (dict(zip(names, x, strict=True)), np.eye(count))
        )
        marginal = SimpleNamespace(objective=SimpleNamespace(coordinates=coordinates))
        fit = SimpleNamespace(marginal=marginal, x=np.full(count, 0.3), value=SimpleNamespace(H=100 * np.eye(count)))
        return log_losses([Prior(name, 0.0, 1.0) for name in names], fit)

    assert of(12) == pytest.approx(12 * of(1))


def test_between_two_steps_a_clip_may_change_but_a_bond_stays(two_steps) -> None:
    first, last = two_steps.steps
    steps = {}
    for one in candidates(two_steps, ("lead-inductance", "bond-void", "face-load")):
        steps.setdefault((one.effect.name, one.where.partition(":")[0]), set()).add(one.steps)
    assert steps["lead-inductance", "terminals"] == {(first, last), (first,), (last,)}
    assert all(of[-1] == last for of in steps["bond-void", "interface"])
    fronts = [one.steps for one in candidates(two_steps, ("face-load",)) if one.where == "face:front"]
    assert sorted(fronts) == sorted([(first,), (last,)]), "the front of a step is inside the next one"


@pytest.mark.parametrize("name", ["electrode-mass", "electrode-sheet"])
def test_an_electrode_stays_on_the_disk_when_something_is_glued_to_it(two_steps, name: str) -> None:
    first, last = two_steps.steps
    found = {one.where: one.steps for one in candidates(two_steps, (name,))}
    (glued,) = (where for where in found if where.startswith("interface:disk|"))
    assert found[glued] == found["face:back"] == (first, last)
    assert found.get("face:front", (last,)) == (last,), "the disk's front is free in the first step only"


def test_an_effect_is_moved_to_no_place_where_there_is_one_of_its_kind(two_steps, monkeypatch) -> None:
    every = candidates(two_steps, ("face-load", "lead-inductance"))
    (back,) = (one for one in every if one.where == "face:back")
    (front, _) = (one for one in every if one.where == "face:front")
    (lead, *_) = [one for one in every if one.where == "terminals" and one.steps == two_steps.steps]
    search = GreedySearch(two_steps, every)
    planned = []
    monkeypatch.setattr(search, "fit", planned.extend)
    monkeypatch.setattr(search, "polish", lambda: None)
    values = {name: 1.0 for one in (front, back, lead) for name in one.parameters}
    search.relocate(
        SimpleNamespace(effects=(front, back, lead), values=values, fit=SimpleNamespace(sizes=ErrorSizes()))
    )
    assert planned
    for plan in planned:
        places = [(one.effect.name, one.where) for one in plan.effects]
        assert len(set(places)) == len(places)


def test_an_effect_is_moved_with_the_parameters_that_it_has_at_both_places(two_steps, monkeypatch) -> None:
    every = candidates(two_steps, ("electrode-mass",))
    (back,) = (one for one in every if one.where == "face:back")
    search = GreedySearch(two_steps, every)
    planned = []
    monkeypatch.setattr(search, "fit", planned.extend)
    monkeypatch.setattr(search, "polish", lambda: None)
    values = {back.prefix + "mass": 0.03, back.prefix + "impedance": 2e7, back.prefix + "other": 0.5}
    search.relocate(SimpleNamespace(effects=(back,), values=values, fit=SimpleNamespace(sizes=ErrorSizes())))
    assert any(len(one.parameters) < len(back.parameters) for plan in planned for one in plan.effects)
    for plan in planned:
        (one,) = plan.effects
        there = {name.removeprefix(one.prefix): plan.values[name] for name in one.parameters}
        assert there == {name: values[back.prefix + name] for name in there}


def test_a_further_resonance_is_searched_for_where_the_recording_shows_at_least_its_flank(lead_case) -> None:
    f = lead_case.task.sweeps["disk"][0].frequency
    (line, *_) = candidates(lead_case.problem, ("spurious-resonance",))
    (knob,) = (knob for knob in line.effect_parameters if knob.name == "frequency")
    assert 0.85 * f[0] < knob.lower < 0.95 * f[0]
    assert 1.05 * f[-1] < knob.upper < 1.15 * f[-1]
    assert line.resonance_parameters == (line.prefix + "frequency",)


@pytest.mark.parametrize("flaw", FLAWS, ids=lambda flaw: type(flaw).__name__)
def test_an_artefact_of_no_size_changes_nothing(flaw, bare: Device) -> None:
    f = np.linspace(1e6, 12e6, 101)
    own = flaw.effect_parameters(bare.bare, "any")
    assert own[0].null == 0
    assert np.array_equal(bare.with_effect(flaw, "any").impedance(f), bare.impedance(f))
    moved = bare.with_effect(flaw, "any", {own[0].name: own[0].typical}).impedance(f)
    assert np.max(np.abs(moved / bare.impedance(f) - 1)) > 1e-5


def test_a_range_step_is_a_factor_from_one_frequency_on(bare: Device) -> None:
    f = np.linspace(1e6, 12e6, 101)
    stepped = bare.with_effect(RangeStep(), "any", {"gain": 0.01, "phase": -0.02, "frequency": f[60]})
    change = np.log(stepped.impedance(f) / bare.impedance(f))
    np.testing.assert_allclose(change[:60], 0, atol=1e-12)
    np.testing.assert_allclose(change[61:], 0.01 - 0.02j, rtol=1e-9)


def test_artefacts_share_a_name_and_have_no_place(lead_case) -> None:
    assert {(one.effect.name, one.where) for one in flaws(lead_case.problem)} == {("unknown", "any")}
    assert len(flaws(lead_case.problem)) == len(FLAWS)


@pytest.mark.parametrize("knob", [FROM_NOTHING, BETWEEN, EITHER_SIGN], ids=lambda knob: knob.name)
@given(z=st.floats(-2, 2))
def test_coordinates_of_sizes_round_trip_with_correct_derivatives(knob: EffectParameter, z: float) -> None:
    block, x = block_of("p", knob), np.array([z])
    value, slope = block.forward(x)
    assert knob.lower <= value[0] <= knob.upper
    assert block.inverse(value) == pytest.approx(x, abs=1e-6)
    step = 1e-6
    above, below = (block.forward(x + sign * step)[0][0] for sign in (1, -1))
    assert slope[0, 0] == pytest.approx((above - below) / (2 * step), rel=1e-4)


def test_typical_sizes_are_likelier_but_the_prior_has_wide_tails(lead_case) -> None:
    free = ("disk.c33D", *lead_case.lead.parameters)
    priors = SizePriors((lead_case.lead,), free)
    K = len(lead_case.lead.parameters)

    def log_density(z: float) -> float:
        spreads = [knob.expected[1] for knob in lead_case.lead.effect_parameters]
        x = np.array([7.0, *(z * spreads[0] / spread for spread in spreads)])  # a longer wire: all of it in proportion
        rows, slopes = priors.rows(x)
        assert slopes.shape == (K, len(free))
        assert not slopes[:, 0].any()
        return -float(rows @ rows) / 2 + priors.log_tails(x)

    at = [log_density(z) for z in (0.0, 1.0, 2.0, 4.0, 8.0)]
    assert at == sorted(at, reverse=True)
    assert at[-1] > -8, "a normal density alone would say -32"
    assert width(BETWEEN) > width(FROM_NOTHING) == width(EITHER_SIGN) == 1
    told = shown(dict.fromkeys(lead_case.lead.parameters, -1.0), lead_case.lead)
    assert told["inductance"] == 0, "no size below its limit is shown"


def test_a_lead_of_microhenries_is_told_as_one_that_may_stand_for_something_else(lead_case) -> None:
    """Of 18 uH in series with a real transducer it was said that the wire or clip had them, with 0.86."""
    (lead,) = candidates(lead_case.problem, ("lead-inductance",))
    usual = {knob.name: knob.expected[0] for knob in lead.effect_parameters}
    assert unusual_size(lead, usual) == ""
    assert unusual_size(lead, {**usual, "inductance": 3e-7}) == ""
    told = unusual_size(lead, {**usual, "inductance": 1.8e-5})
    assert told.startswith("But its inductance of 1.8e-05 H is far above the usual 2e-09 to 3e-07 H")


def test_two_contiguous_blocks_are_held_out_and_listed_as_bands(lead_case) -> None:
    (recording,) = lead_case.problem.recordings
    (mask,) = held_out([recording], "bands")
    assert np.array_equal(mask, blocks(recording.sweep))
    assert np.count_nonzero(np.diff(mask.astype(int)) == 1) == 2
    assert mask.mean() == pytest.approx(2 / 11, abs=0.01)
    f, bands = recording.sweep.frequency, bands_of(recording, mask)
    told = np.any([(f >= a) & (f <= b) for a, b in bands], axis=0)
    assert np.array_equal(told, mask)


def test_held_out_points_have_no_weight(lead_case) -> None:
    problem = lead_case.problem
    (mask,) = problem.proof
    objective = problem.without(problem.proof).objective((), problem.values)
    residual = objective.residual(objective.coordinates.x)[: 2 * mask.size].reshape(2, -1)
    assert not residual[:, mask].any()
    whole = problem.objective((), problem.values)
    np.testing.assert_allclose(
        residual[:, ~mask], whole.residual(whole.coordinates.x)[: 2 * mask.size].reshape(2, -1)[:, ~mask]
    )


def test_devices_have_the_conditions_of_their_sweep(lead_case) -> None:
    (recording,) = lead_case.problem.recordings
    down = Sweep(recording.sweep.frequency, recording.sweep.impedance, {"direction": "down", "oscillator_V": 0.1})
    (seen,) = as_devices([replace(recording, sweep=down, model=recording.model.bare)])
    assert (seen.model.conditions.direction, seen.model.conditions.level_V) == ("down", 0.1)


def test_a_true_effect_has_the_highest_evidence_and_its_true_size(lead_case) -> None:
    problem, lead = lead_case.problem, lead_case.lead
    null = lead_case.search.null
    start = {lead.prefix + "inductance": 1e-8, lead.prefix + "resistance": 1e-3}
    made = fitted(problem, (lead,), {**null.values, **start})
    assert made.key == {lead}
    # without it, its 9 nH would be a residual of the fixture nine times as large as usual
    assert made.log_weight > null.log_weight + 9**2 / 2
    assert made.values[lead.prefix + "inductance"] == pytest.approx(lead_case.inductance, rel=0.01)
    assert made.log_odds < 0 == null.log_odds


def test_constants_and_errors_of_the_instrument_that_stand_for_something_else_are_strained(lead_case) -> None:
    null, best = lead_case.search.null, lead_case.search.best
    assert null.strained, "a lead of 9 nH is no residue of a fixture"
    assert not null.astray
    assert not best.strained


def weighed(evidence: float, odds: float, shortfall: float, prior: float = 0.0, left: float = 0.0) -> SimpleNamespace:
    fit, weight = SimpleNamespace(shortfall=shortfall, exact=shortfall == 0), evidence + odds
    known = {"log_prior": prior, "log_left": left}
    return SimpleNamespace(log_evidence=evidence, log_odds=odds, log_weight=weight, fit=fit, **known)


def test_a_fit_that_has_not_arrived_is_not_credited_with_what_it_promises(lead_case) -> None:
    problem, best, lead = lead_case.problem, lead_case.search.best, lead_case.lead
    off = {**best.values, lead.parameters[0]: 1.5 * best.values[lead.parameters[0]]}
    begun, arrived = (fitted(problem, (lead,), off, near=True, rounds=rounds, fixed=True) for rounds in (0, 5))
    missing = arrived.log_evidence - begun.log_evidence
    assert missing > 1000
    assert begun.fit.promised == pytest.approx(missing, rel=0.05)
    assert not begun.fit.converged
    assert arrived.fit.converged
    assert arrived.fit.promised == 0


def test_what_is_known_beforehand_of_a_size_counts_in_full_however_coarse_the_evidence() -> None:
    usual, thrice = probabilities([weighed(0.0, 0.0, 1e3), weighed(0.0, 0.0, 1e3, prior=np.log(1 / 3))])
    assert usual / thrice == pytest.approx(3 ** (1 - 1 / coarseness(1e3)))


def test_leaving_more_than_a_good_device_does_costs_the_odds_of_a_cause_of_its_own(lead_case) -> None:
    null = lead_case.search.null
    assert null.unexplained > 3 * LEFT
    assert null.log_left < np.log(ODDS)
    assert lead_case.search.best.log_left == pytest.approx(np.log(1 - ODDS), abs=0.05)
    named, left = probabilities([weighed(0.0, np.log(ODDS), 0.0), weighed(0.0, 0.0, 0.0, left=null.log_left)])
    assert named > left, "of two explanations as good as each other, that by an effect leaves less unexplained"


@given(st.floats(-4, 0))
def test_how_usual_a_rest_is_follows_from_two_densities(decades: float) -> None:
    left = 10**decades
    from scipy.stats import halfnorm, loguniform  # imported late: that takes half a second in each process

    good, other = halfnorm(scale=LEFT), loguniform(LEFT, 1.0)
    density = (1 - ODDS) * good.pdf(left) + ODDS * other.pdf(max(left, LEFT * (1 + 1e-12)))
    said = Hypothesis.log_left.fget(SimpleNamespace(unexplained=left))
    assert said == pytest.approx(np.log(density / good.pdf(0.0)), abs=1e-6)
    cause = Hypothesis.cause_left.fget(SimpleNamespace(unexplained=left))
    assert cause == pytest.approx(1 - (1 - ODDS) * good.pdf(left) / density, abs=1e-9)


def test_an_effect_that_has_to_be_bent_is_as_improbable_as_another_one_beside_it(lead_case) -> None:
    (stray,) = (one for one in lead_case.candidates if one.effect.name == "stray-capacitance")
    sizes = ErrorSizes(slow=1.0, shape=3.0)
    right, wrong = (
        fitted(lead_case.problem, (one,), lead_case.problem.values, (sizes,), fixed=True)
        for one in (lead_case.lead, stray)
    )
    assert right.fit.bent < 0.5 * SHAPE
    assert wrong.fit.bent > 2 * SHAPE, "no stray capacitance does what a lead does"
    assert right.log_bent == pytest.approx(np.log(1 - ODDS), abs=0.1)
    assert wrong.log_bent < np.log(ODDS) / 2
    costs = right.log_prior - right.log_bent, wrong.log_prior - wrong.log_bent
    assert costs == pytest.approx(
        tuple(one.log_tails - 0.5 * one.fit.gram.before.q + one.fit.log_usual for one in (right, wrong))
    )
    from scipy.stats import halfnorm, loguniform  # imported late: that takes half a second in each process

    good, other = halfnorm(scale=SHAPE), loguniform(SHAPE, 1.0)
    for bent in (0.01, 0.2, 0.5):
        density = (1 - ODDS) * good.pdf(bent) + ODDS * other.pdf(max(bent, SHAPE * (1 + 1e-12)))
        said = Hypothesis.log_bent.fget(SimpleNamespace(fit=SimpleNamespace(bent=bent)))
        assert said == pytest.approx(np.log(density / good.pdf(0.0)), abs=1e-6)


@given(st.floats(-5, 5))
def test_a_formula_errs_by_the_logarithm_of_what_may_vary(x: float) -> None:
    knob = replace(BETWEEN, varies=True)
    effect = SimpleNamespace(key="cable", sizes=1, errs_roughly=False, errs_in_time=False)
    one = Candidate(effect, "terminals", ("disk",), (FROM_NOTHING, knob))
    made = formula_errors([one])
    assert set(made) == {one.prefix, one.prefix + "impedance"}
    ((name, per_log),) = made[one.prefix + "impedance"].through
    p, slope = block_of(name, knob).forward(np.array([x]))
    assert per_log(x) == pytest.approx(p.item() / slope.item(), rel=1e-9)


@given(st.lists(st.tuples(st.floats(-500, 500), st.floats(-10, 0)), min_size=1, max_size=6), st.floats(0, 1e4))
def test_probabilities_are_coarsened_by_the_misfit_of_the_best_explanation(parts, shortfall: float) -> None:
    exact, coarse = (probabilities([weighed(*one, short) for one in parts]) for short in (0.0, shortfall))
    for found in (exact, coarse):
        assert np.sum(found) == pytest.approx(1)
        assert np.all(found >= 0)
    weight = np.array([evidence + odds for evidence, odds in parts])
    np.testing.assert_allclose(exact, np.exp(weight - weight.max()) / np.exp(weight - weight.max()).sum(), atol=1e-12)
    flat = [weighed(evidence, 0.0, shortfall) for evidence, _ in parts]
    sharp = [weighed(evidence, 0.0, 0.0) for evidence, _ in parts]
    assert np.max(probabilities(flat)) <= np.max(probabilities(sharp)) + 1e-12
    assert coarseness(-5.0, exact=True) == coarseness(0.0, exact=True) == 1 < coarseness(0.0) <= coarseness(shortfall)


def test_unusual_errors_of_the_largest_evidence_do_not_make_all_uncertain() -> None:
    """What is missing is what even the best explanations miss: another one may need no unusual errors."""
    astray, physics, null = weighed(100.0, 0.0, 1e4), weighed(90.0, 0.0, 10.0), weighed(0.0, 0.0, 5e3)
    assert temper_of([astray, physics, null]) == coarseness(10.0)
    assert probabilities([astray, physics, null])[2] < 0.01


def test_a_short_lead_usually_has_little_resistance(lead_case) -> None:
    free = lead_case.lead.parameters
    priors = SizePriors((lead_case.lead,), free)

    def unusual(factor: float, resistance: float) -> float:
        knobs = lead_case.lead.effect_parameters
        sizes = [knob.expected[0] * factor for knob in knobs]
        sizes[1] *= resistance
        x = np.concatenate(
            [
                block_of(name, knob).inverse(np.array([size]))
                for name, knob, size in zip(free, knobs, sizes, strict=True)
            ]
        )
        residual, slopes = priors.rows(x)
        np.testing.assert_allclose(slopes @ x, residual)
        return float(residual @ residual)

    assert unusual(1.0, 1.0) == pytest.approx(0)
    spread = lead_case.lead.effect_parameters[0].expected[1]
    assert unusual(0.1, 1.0) == pytest.approx((np.log(10) / spread) ** 2), "only the inductance is unusual"
    assert unusual(0.1, 10.0) > unusual(0.1, 1.0) + 1


def test_one_of_several_sizes_may_be_absent_but_not_all(lead_case) -> None:
    (mode, *_) = candidates(lead_case.problem, ("spurious-resonance",))
    priors = SizePriors((mode,), mode.parameters)

    def log_density(*sizes: float) -> float:
        x = np.array([*sizes, *[0.0] * (len(mode.parameters) - len(sizes))])
        rows, _ = priors.rows(x)
        return -float(rows @ rows) / 2 + priors.log_tails(x)

    assert log_density(0.0, -6.0) == pytest.approx(log_density(-6.0, 0.0))
    assert log_density(0.0, -6.0) > log_density(0.0, 0.0) - np.log(10)
    assert log_density(-6.0, -6.0) < log_density(0.0, -6.0) - 3


def test_a_resistance_is_as_usual_without_a_skin_effect_as_with_one(lead_case) -> None:
    """A contact of 20 mohm was told as the sheet of an electrode: that it has no skin effect counted against it."""
    (contact,) = candidates(lead_case.problem, ("series-resistance",))
    resistance, skin = contact.effect_parameters
    wire = replace(contact, effect_parameters=(resistance, replace(skin, absent=0.1)))

    def gain(skin: float) -> float:
        """Return what ln prior density gains beside that of a part which one time in ten has no skin effect."""
        densities = (SizePriors((one,), one.parameters).log_tails(np.array([0.0, skin])) for one in (contact, wire))
        return next(densities) - next(densities)

    assert gain(-6.0) == pytest.approx(np.log(0.5 / 0.1), abs=0.01)
    assert gain(-0.01) == pytest.approx(0, abs=0.1)


def test_a_quality_factor_is_as_improbable_by_a_factor_below_as_above_what_the_build_states() -> None:
    """40(25) may be 20 or 80, but never 1, which a normal prior would allow within 1.6 of its u."""
    prior = QualityFactor("ml1.q", 40.0, 25.0)
    below, above, gone = (prior.deviation({"ml1.q": q}) for q in (20.0, 80.0, 1.0))
    assert below == pytest.approx(-above) == pytest.approx(-1.2, abs=0.02)
    assert gone < -6
    assert QualityFactor("ml1.q", 40.0, 0.4).deviation({"ml1.q": 40.4}) == pytest.approx(1, rel=0.01)


def test_constants_far_from_what_the_build_states_are_astray_and_can_begin_there_again(two_steps, cases) -> None:
    near = fitted(two_steps, (), two_steps.values, near=True, rounds=1)
    assert not near.astray
    elsewhere = tuple(replace(prior, mean=prior.mean + 5 * prior.u) for prior in two_steps.priors)
    far = fitted(replace(two_steps, priors=elsewhere), (), near.values, near=True, rounds=0)
    assert far.astray
    layers = read_build(cases / "glue-null" / "build.toml").layers
    glued = next(layer for layer in layers if layer.kind == "elastic" and layer.values["z"].u)
    stated = two_steps.model.as_stated({**near.values, f"{glued.name}.z": 1e5, "lead@terminals.inductance": 2e-8})
    assert stated[f"{glued.name}.z"] == pytest.approx(glued.values["z"].re)
    assert stated["lead@terminals.inductance"] == 2e-8, "no build states the effects that are sought"


def test_an_effect_that_is_absorbed_or_unusually_small_is_tried_with_a_large_size_too(lead_case) -> None:
    name = lead_case.lead.parameters[0]
    median, spread = lead_case.lead.effect_parameters[0].expected
    seen = ScreenedCandidate(lead_case.lead, 1.0, {name: median / 2}, survives=0.5)
    assert seen.starts == [{name: median / 2}]
    for one in (replace(seen, survives=0.05), replace(seen, start={name: 1e-12})):
        small, large = one.starts
        assert small == one.start
        assert large[name] == pytest.approx(median * np.exp(spread))
