"""Learned physics outside the catalogue: place, law and its numbers; and weak lines, which are not findings."""

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from relaxing_disk import F, recorded, relaxing, with_permittivity

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.files.builds.effects_writing import append_effects
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted, marginal_of
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.inference.conclusion import Conclusion, remaining_of
from pzctl.fitters.diagnosis.learning import laws, places
from pzctl.fitters.diagnosis.learning.delays import delays_at
from pzctl.fitters.diagnosis.learning.explanations import Explanation, chosen, distinct
from pzctl.fitters.diagnosis.learning.law_fits import LearnedCorrection
from pzctl.fitters.diagnosis.learning.learned_effect import Learning
from pzctl.fitters.diagnosis.learning.part_laws import part_laws
from pzctl.fitters.diagnosis.learning.places import all_places
from pzctl.fitters.diagnosis.learning.plain_laws import plainly_better_laws
from pzctl.fitters.diagnosis.learning.sharp import SharpCorrection, sharp_corrections
from pzctl.fitters.diagnosis.learning.usual_fits import has_usual_fixture, usually_fitted
from pzctl.fitters.diagnosis.search.echo_delays import likely_delays, longest_delay
from pzctl.fitters.diagnosis.search.local_errors import without_strong_lines
from pzctl.fitters.diagnosis.search.weak_lines import weak_lines
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.error_model.local_error_kinds import WeakLine
from pzctl.fitters.error_model.prior_scales import LINE
from pzctl.fitters.plugins import load_fitter, run
from pzctl.models.effects import Device, Effect, find_effect
from pzctl.models.effects.learned.corrections import Place
from pzctl.models.effects.learned.laws import laws as laws_of
from pzctl.models.effects.learned.learned import learned_law
from pzctl.models.stack import Piezo, Stack


@pytest.mark.long
def test_a_relaxation_outside_the_catalogue_is_located_named_sized_and_fitted(bare: Device, tmp_path: Path) -> None:
    strength, at, f = 0.2, 4e6, np.linspace(1.5e6, 7.5e6, 51)
    task = recorded(relaxing(bare.bare, strength, at, f), f)
    others = {
        "alike": recorded(relaxing(bare.bare, 1.05 * strength, at, f), f),
        "without": recorded(bare.bare.impedance(f), f),
    }
    diagnosis = diagnose(task, effects=("polarity",), learn=True, others=others)
    alike, without = diagnosis.others
    assert alike.effects == without.effects
    assert "learned at layer:disk" in alike.effects
    assert alike.chi2_per_dof_after < 0.05 * alike.chi2_per_dof_before
    assert without.chi2_per_dof_after > 2 * without.chi2_per_dof_before, "it does not have it"
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("layer:disk", "permittivity")
    assert diagnosis.places[0].probability > 0.9
    (finding,) = (one for one in diagnosis.findings if one.effect == "learned")
    assert finding.where == "layer:disk"
    relaxation = finding.parameters["at"]
    assert relaxation.unit == "Hz"
    assert relaxation.value == pytest.approx(at, rel=0.2)
    assert "permittivity of disk relaxes at" in finding.says
    assert any("the whole device absorbs power at all frequencies" in one for one in diagnosis.says)
    assert diagnosis.final.chi2_per_dof < 0.02 * diagnosis.baseline.chi2_per_dof

    build = tmp_path / "build.toml"
    build.write_text(THESIS_BUILD.read_text(encoding="utf-8"), encoding="utf-8")
    append_effects(build, diagnosis.effects)
    fit = run(load_fitter("mason"), replace(task, build=read_build(build)))
    assert fit.chi2_per_dof < 0.02 * diagnosis.baseline.chi2_per_dof
    name = next(name for name in fit.constants if name.startswith("learned@layer:disk") and name.endswith(".at"))
    assert fit.constants[name].re == pytest.approx(relaxation.value, abs=3 * relaxation.u)


@pytest.mark.long
def test_a_drift_outside_the_catalogue_is_learned_as_a_course_in_time(bare: Device) -> None:
    """A permittivity that rises by 2 % while a sweep runs up, and as much again while one runs down."""
    f, size = np.linspace(1.5e6, 7.5e6, 51), 0.02
    passed = dict(zip(f.tolist(), np.linspace(0, 1, f.size).tolist(), strict=True))
    up, down = (
        recorded(with_permittivity(bare.bare, change, f), f)
        for change in (lambda one: size * passed[one], lambda one: size * (2 - passed[one]))
    )
    sweeps = tuple(
        replace(task.sweeps["disk"][0], settings={"direction": direction, "sweep_seconds": 60})
        for task, direction in ((up, "up"), (down, "down"))
    )
    diagnosis = diagnose(replace(up, sweeps={"disk": sweeps}), effects=("polarity",), learn=True)
    (finding,) = (one for one in diagnosis.findings if one.effect == "learned")
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("layer:disk", "permittivity")
    assert "permittivity of disk drifts by" in finding.says
    drift = finding.parameters["size"]
    assert abs(drift.value - size) < 3 * drift.u
    assert drift.u < 0.02 * size
    assert diagnosis.effects == (), "it belongs to the sweeps, not to the sample"


@pytest.fixture
def at_the_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Laws are looked for at the terminals, and are the simplest three; in other tests all places and laws compete."""
    monkeypatch.setattr(places, "all_places", lambda _problem: ((Place("terminals", "series"), ("disk",)),))
    monkeypatch.setattr(laws, "laws", lambda quantity: laws_of(quantity)[:3])


@pytest.mark.usefixtures("at_the_terminals")
def test_lines_that_the_catalogue_leaves_are_none_if_a_law_explains_them(bare: Device) -> None:
    """Without the law some points at the resonance pass for a weak line; beside it they determine the constants."""
    f = np.linspace(1.5e6, 7.5e6, 41)
    task = recorded(bare.bare.impedance(f) + 2j * np.pi * f * 5e-9, f, noise=3e-5)
    diagnosis = diagnose(task, effects=("polarity",), learn=True)
    (finding,) = diagnosis.findings
    assert (diagnosis.verdict, finding.effect, finding.where) == ("explained", "learned", "terminals")
    assert finding.parameters["inductance"].value == pytest.approx(5e-9, rel=1e-3)
    assert diagnosis.final.chi2_per_dof < 1.3
    assert diagnosis.final.held_out < 1.3


@pytest.mark.usefixtures("at_the_terminals")
def test_a_contact_is_a_sum_of_a_resistance_and_an_inductance(bare: Device) -> None:
    """No single law is both; a root of frequency describes it within what a fixture does, with a wrong meaning."""
    f = np.linspace(1.5e6, 7.5e6, 41)
    diagnosis = diagnose(recorded(bare.bare.impedance(f) + 0.3 + 2j * np.pi * f * 3e-9, f), ("polarity",), learn=True)
    (finding,) = diagnosis.findings
    assert [one.law for one in diagnosis.effects] == ["resistance+inertance"]
    resistance, inductance = finding.parameters["size"], finding.parameters["inductance"]
    assert abs(resistance.value - 0.3) < 3 * resistance.u < 0.1
    assert abs(inductance.value - 3e-9) < 3 * inductance.u < 1.5e-9
    assert "has a resistance of" in finding.says


@pytest.mark.usefixtures("at_the_terminals")
@pytest.mark.long
def test_beside_effects_that_imitate_it_a_law_that_leaves_nothing_is_fitted_but_not_looked_for(bare: Device) -> None:
    f, said = np.linspace(1.5e6, 7.5e6, 41), list[str]()
    task = recorded(bare.bare.impedance(f) + 2j * np.pi * f * 2e-8, f)
    problem = Problem.of(solve(task, lambda _: None), None)
    null = fitted(problem, (), problem.values)
    resistance = _candidate(find_effect("series-resistance"), "terminals", bare.bare)
    imitated = fitted(problem, (resistance,), problem.values)
    nothing = Conclusion(null, null, (), remaining_of(null), something_else=1.0, nearest=None)
    found, _ = Learning(problem, said.append).extended(nothing, [imitated, null])
    assert [(one.effect.name, one.where) for one in found.final.effects] == [("learned", "terminals")]
    assert sum(one.startswith("trying a correction") for one in said) == 1


@pytest.mark.usefixtures("at_the_terminals")
def test_an_effect_of_the_catalogue_that_the_search_has_missed_is_told(bare: Device) -> None:
    """A resistance that errors of instrument and fixture describe as well, but less probably."""
    f = np.linspace(1.5e6, 7.5e6, 41)
    problem = Problem.of(solve(recorded(bare.bare.impedance(f) + 0.03, f, noise=3e-5), lambda _: None), None)
    null = fitted(problem, (), problem.values)
    ended = Conclusion(null, null, (), remaining_of(null), something_else=0.0, nearest=None)
    assert not ended.something_left
    resistance = _candidate(find_effect("series-resistance"), "terminals", bare.bare)
    missed = fitted(problem, (resistance,), problem.values)
    found, _ = Learning(problem).extended(ended, [null, missed])
    assert [(one.candidate.effect.name, one.candidate.where) for one in found.named] == [
        ("series-resistance", "terminals")
    ]


def _candidate(effect: Effect, where: str, stack: Stack) -> Candidate:
    return Candidate(effect, where, ("disk",), effect.effect_parameters(stack, where))


def test_beside_a_law_no_formula_of_an_effect_may_err(bare: Device) -> None:
    """Smooth errors of a formula, of 10 % and more, would absorb what the law describes."""
    problem = Problem.of(solve(recorded(bare.bare.impedance(F)), lambda _: None), None)
    place = Place("layer:disk", "permittivity")
    law = _candidate(learned_law(place, "power", bare.bare), place.where, bare.bare)
    lead = _candidate(find_effect("series-resistance"), "terminals", bare.bare)
    assert list(marginal_of(problem, (lead,), problem.values).shapes) == [lead.prefix]
    assert not marginal_of(problem, (lead, law), problem.values).shapes
    assert not marginal_of(problem, (law,), problem.values).shapes


def test_the_delay_of_an_echo_is_read_from_the_residual(bare: Device) -> None:
    """Twelve periods of the echo are in the band: no smooth correction follows them."""
    delay, place = 2e-6, Place("face:front", "impedance")
    echo = learned_law(place, "echo", bare.bare)
    device = bare.with_effect(echo, place.where, {"size": 0.02 * echo.natural, "delay": delay, "echo": 0.3})
    problem = Problem.of(solve(recorded(device.impedance(F)), lambda _: None), None)
    null = fitted(problem, (), problem.values, near=True)
    likely = delays_at(null, place, ("disk",), 1e-7, 1e-5)
    assert likely[0].delay == pytest.approx(delay, abs=1 / (4 * F[-1])), "within a quarter of a period"


def test_sweeps_over_the_same_points_show_no_longer_delays_than_one() -> None:
    """An echo of delay + 1/spacing differs from that of delay by a phase only, which a slow error can imitate."""
    spacing, delay = 5e3, 20e-6
    f = 1e6 + spacing * np.arange(300)
    assert longest_delay([f, f, f]) == longest_delay([f]) == pytest.approx(1 / (2 * spacing))
    assert longest_delay([f, f + spacing / 2]) == pytest.approx(1 / (2 * spacing))
    assert longest_delay([]) == longest_delay([f[:1]]) == 0
    many = np.concatenate([f, f, f])
    r = -0.01 * np.exp(-2j * np.pi * many * delay + 0.3j)
    found = likely_delays(
        many, np.ones(many.size, complex), np.ones((many.size, 1), complex), r, 1e-7, longest_delay([f])
    )
    assert found[0].delay == pytest.approx(delay, abs=1 / f[-1])


def test_places_of_a_resonance_and_of_an_echo_are_read_from_the_residual(bare: Device) -> None:
    """Both are too sharp for a smooth correction of any place."""
    strength, at, q = 0.005, 3.5e6, 40.0
    place = Place("layer:disk", "permittivity")
    resonance = learned_law(place, "resonance", bare.bare)
    device = bare.with_effect(resonance, place.where, {"size": strength, "at": at, "q": q})
    found = {(one.place, one.law.name): one for one in _sharp(device)}
    start = resonance.physical(found[place, "resonance"].start)
    assert start["at"] == pytest.approx(at, rel=0.02)
    assert start["size"] == pytest.approx(strength, rel=0.5)

    place = Place("face:front", "impedance")
    echo = learned_law(place, "echo", bare.bare)
    values = {"size": 0.02 * echo.natural, "delay": 2e-6, "echo": 0.3}
    echoes = [one for one in _sharp(bare.with_effect(echo, place.where, values)) if one.law.name == "echo"]
    assert [one.place.where for one in echoes] == ["face:back"], "both faces are alike: one of them is enough"


def _sharp(device: Device) -> tuple[SharpCorrection, ...]:
    problem = Problem.of(solve(recorded(device.impedance(F)), lambda _: None), None)
    null = fitted(problem, (), problem.values)
    return sharp_corrections(problem, null, all_places(problem, loads=True))


def test_weak_lines_are_found_at_their_frequencies(bare: Device) -> None:
    lines = ((2.6e6, 90.0, 4e-5), (3.3e6, 60.0, 5e-5), (6.1e6, 120.0, 3e-5))
    stack = bare.bare
    disk = next(layer for layer in stack.layers if isinstance(layer, Piezo))
    C0 = disk.eps33S.real * stack.area / disk.thickness
    w = 2 * np.pi * F
    Y = 1 / stack.impedance(F)
    for f, q, strength in lines:
        wk = 2 * np.pi * f
        Y = Y + 1j * w * strength * C0 / (1 - (w / wk) ** 2 + 1j * w / (wk * q))
    problem = Problem.of(solve(recorded(1 / Y), lambda _: None), None)
    null = fitted(problem, (), problem.values, near=True)
    found = sorted(weak_lines(null), key=lambda line: line.frequency)
    assert [line.frequency for line in found] == pytest.approx([f for f, _, _ in lines], rel=4e-3)
    with_lines = fitted(replace(problem, local=tuple(found)), (), null.values, (null.fit.sizes,), near=True)
    assert with_lines.log_evidence > null.log_evidence + 50
    nothing = Problem.of(solve(recorded(stack.impedance(F)), lambda _: None), None)
    assert weak_lines(fitted(nothing, (), nothing.values, near=True)) == ()


@pytest.mark.parametrize(("size", "weak"), [(0.005, True), (0.1, False)])
def test_a_line_of_the_error_model_that_is_higher_than_lines_are_is_none(bare: Device, size: float, weak: bool) -> None:
    """0.1 of the clamped capacitance's admittance has a cause of its own, whatever was estimated of it beforehand."""
    place, q = Place("terminals", "shunt"), 60.0
    law = learned_law(place, "resonance", bare.bare)
    device = bare.with_effect(law, place.where, law.physical({"size": size, "at": 0.95, "q": q}))
    line = WeakLine("disk", 0.95 * law.reference, q)
    problem = replace(Problem.of(solve(recorded(device.impedance(F)), lambda _: None), None), local=(line,))
    found = fitted(problem, (), problem.values)
    assert found.fit.line_heights[line] == pytest.approx(size / LINE, rel=0.2)
    assert without_strong_lines(problem, found).local == ((line,) if weak else ())


def test_a_wire_is_no_residual_of_a_fixture(bare: Device) -> None:
    """It absorbs 5 nH with five times its usual size; such a fit explains nothing."""
    f = np.linspace(1.5e6, 7.5e6, 61)
    problem = Problem.of(solve(recorded(bare.bare.impedance(f) + 2j * np.pi * f * 5e-9, f), lambda _: None), None)
    assert not has_usual_fixture(fitted(problem, (), problem.values, barred=("tau",)))
    assert usually_fitted(problem, (), problem.values, near=False).fit.sizes.fixture == 0
    good = Problem.of(solve(recorded(bare.bare.impedance(f), f), lambda _: None), None)
    assert has_usual_fixture(fitted(good, (), good.values, barred=("tau",)))


def test_a_law_that_changes_a_device_much_is_found_by_plain_least_squares(bare: Device) -> None:
    """A permittivity that halves with frequency."""
    f = np.linspace(1.5e6, 7.5e6, 41)
    problem = Problem.of(solve(recorded(relaxing(bare.bare, 1.0, 3e6, f), f), lambda _: None), None)
    plain = fitted(problem, (), problem.values, near=False, rounds=0)
    best = max(plainly_better_laws(problem, plain, plain), key=lambda one: one.hypothesis.log_evidence)
    assert best.effect.place == Place("layer:disk", "permittivity")
    assert best.hypothesis.log_evidence > fitted(problem, (), problem.values, barred=("tau",)).log_evidence + 200


def test_a_mass_on_a_part_of_a_face_is_found_by_its_satellite_and_counts_once(bare: Device) -> None:
    """No correction over frequency shows it; on a bare disk nothing tells one face from the other."""
    f, place = np.linspace(2.5e6, 6e6, 201), Place("face:front", "impedance")
    law = learned_law(place, "part-inertance", bare.bare)
    device = bare.with_effect(law, place.where, {"share": 0.02, "size": 0.4 * law.natural})
    problem = Problem.of(solve(recorded(device.impedance(f), f, noise=3e-5), lambda _: None), None)
    plain = fitted(problem, (), problem.values, near=False, rounds=0)
    best = max(part_laws(problem, plain, plain), key=lambda one: one.hypothesis.log_evidence)
    values = law.dimensionless(
        {name: best.hypothesis.values[best.candidate.prefix + name] for name in ("share", "size")}
    )
    assert best.effect.law.name == "part-inertance"
    assert (values["share"], values["size"]) == pytest.approx((0.02, 0.4), rel=0.02)
    assert best.hypothesis.fit.shortfall == 0

    here = Explanation(best.hypothesis, best, plain)
    there = _at_the_other_face(best)
    assert distinct([here, there]) == [here]
    choice = chosen(distinct([here, there]))
    assert choice is not None
    assert choice.probability == 1


def _at_the_other_face(law: LearnedCorrection) -> Explanation:
    other = Place("face:back" if law.effect.place.where == "face:front" else "face:front", "impedance")
    effect = copy(law.effect)
    effect.place = other
    twin = replace(law, effect=effect, placed=replace(law.placed, place=other))
    return Explanation(twin.hypothesis, twin, replace(twin.hypothesis, effects=()))


def test_a_strong_resonance_across_the_terminals_is_tried_there(bare: Device) -> None:
    """Near the device's own resonance it is not linear in its size: laws inside the disk then seem to explain more."""
    place = Place("terminals", "shunt")
    law = learned_law(place, "resonance", bare.bare)
    values = law.physical({"size": 0.1, "at": 1.05, "q": 31.0})
    found = _sharp(bare.with_effect(law, place.where, values))
    assert (place, "resonance") in {(one.place, one.law.name) for one in found}
