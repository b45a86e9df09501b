"""Effects stated in a build are part of the model and fitted like constants."""

from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, build_from_json, build_to_json, parse_build
from pzctl.daemon.files.builds.build_table import BuildError
from pzctl.daemon.files.builds.effects_writing import append_effects
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask, TaskError
from pzctl.fitters.plugins import load_fitter, run
from pzctl.models.effects import Device, find_effect
from pzctl.models.sweep import Sweep

TEXT = THESIS_BUILD.read_text(encoding="utf-8")
LEAD = """
[[effects]]
effect = "lead-inductance"
where = "terminals"
inductance_H = { value = 5e-8, u = 2e-8 }
"""
F = np.linspace(1.5e6, 7.5e6, 301)
INDUCTANCE = 3.7e-8


@pytest.fixture(scope="module")
def behind_a_lead() -> dict[str, tuple[Sweep, ...]]:
    """A disk in series with an inductance, whose impedance is added here."""
    random = np.random.default_rng(4)
    noise = 2e-4 * (random.normal(size=F.size) + 1j * random.normal(size=F.size))
    build = parse_build(TEXT)
    disk = stack_of(build, build.step("disk")).impedance(F)
    return {"disk": (Sweep(F, (disk + 2j * np.pi * F * INDUCTANCE) * np.exp(noise)),)}


def test_a_stated_lead_is_fitted_with_its_uncertainty(behind_a_lead: dict[str, tuple[Sweep, ...]]) -> None:
    build = parse_build(TEXT + LEAD)
    assert build_from_json(build_to_json(build)) == build
    fit = run(load_fitter("mason"), FitTask(build, behind_a_lead))
    found = fit.constants["lead-inductance@terminals.inductance"]
    assert (found.unit, found.free) == ("H", True)
    assert found.u_re is not None
    assert found.re == pytest.approx(INDUCTANCE, abs=3 * found.u_re)
    assert found.u_re < 0.1 * INDUCTANCE
    assert fit.chi2_per_dof < 2
    without = run(load_fitter("mason"), FitTask(parse_build(TEXT), behind_a_lead))
    assert without.chi2_per_dof > 20 * fit.chi2_per_dof


def test_a_stated_effect_that_is_not_there_ends_at_its_limit_and_is_not_told_as_held() -> None:
    build = parse_build(TEXT)
    noise = 2e-4 * np.random.default_rng(4).normal(size=F.size)
    bare = stack_of(build, build.step("disk")).impedance(F)
    behind_less_than_nothing = (bare - 2j * np.pi * F * 1e-8) * np.exp(noise)
    fit = run(load_fitter("mason"), FitTask(parse_build(TEXT + LEAD), {"disk": (Sweep(F, behind_less_than_nothing),)}))
    found = fit.constants["lead-inductance@terminals.inductance"]
    assert (found.re, found.u_re, found.free) == (pytest.approx(0, abs=1e-14), None, True)
    assert any("At an end of its range" in says and says.endswith("terminals.inductance.") for says in fit.says)


def test_a_stated_effect_is_not_searched_again(behind_a_lead: dict[str, tuple[Sweep, ...]]) -> None:
    task = FitTask(parse_build(TEXT + LEAD), behind_a_lead)
    diagnosis = diagnose(task, effects=("lead-inductance", "stray-capacitance"))
    assert (diagnosis.verdict, diagnosis.findings) == ("no-mismatch", ())


def test_a_fitter_without_effects_refuses_such_a_build(behind_a_lead: dict[str, tuple[Sweep, ...]]) -> None:
    task = FitTask(parse_build(TEXT + LEAD), behind_a_lead)
    with pytest.raises(TaskError, match=r"cannot model the effects of build .* \(lead-inductance at terminals\)"):
        load_fitter("mason-nelder-mead").fit(task)


def test_a_finding_is_written_to_the_build_and_read_again(
    behind_a_lead: dict[str, tuple[Sweep, ...]], tmp_path: Path
) -> None:
    diagnosis = diagnose(FitTask(parse_build(TEXT), behind_a_lead), effects=("lead-inductance",))
    build = tmp_path / "build.toml"
    build.write_text(TEXT, encoding="utf-8")
    append_effects(build, diagnosis.effects)
    text = build.read_text(encoding="utf-8")
    assert text.startswith(TEXT.rstrip())
    (spec,) = parse_build(text).effects
    assert (spec.effect, spec.where) == ("lead-inductance", "terminals")
    assert spec.values["inductance"].re == pytest.approx(INDUCTANCE, rel=0.05)
    with pytest.raises(BuildError, match="lead-inductance at terminals is given twice"):
        append_effects(build, diagnosis.effects)
    assert build.read_text(encoding="utf-8") == text


def test_the_delay_of_a_fixture_is_fitted_where_a_build_states_it_and_may_be_left_out(tmp_path: Path) -> None:
    residual = '[[effects]]\neffect = "fixture-residual"\nwhere = "terminals"\ninductance_H = 0\nresistance_ohm = 0\n'
    residual += "skin_ohm = 0\ncapacitance_F = 0\nconductance_S = 0\n"
    stated = parse_build(TEXT + residual + "delay_s = { value = 1e-10, u = 1e-10 }\n")
    build, delay = parse_build(TEXT), 3.2e-10
    line = 50j * np.tan(2 * np.pi * F * delay)
    disk = stack_of(build, build.step("disk")).impedance(F)
    seen = (disk + line) / (1 + disk * line / 50**2)
    sweeps = {"disk": (Sweep(F, seen * np.exp(2e-4 * np.random.default_rng(4).normal(size=F.size))),)}
    found = run(load_fitter("mason"), FitTask(stated, sweeps)).constants["fixture-residual@terminals.delay"]
    assert found.re == pytest.approx(delay, rel=0.02)
    without = run(load_fitter("mason"), FitTask(parse_build(TEXT + residual), sweeps))
    assert without.constants["fixture-residual@terminals.delay"].re == 0
    diagnosis = diagnose(FitTask(build, sweeps), effects=("fixture-residual",))
    (tmp_path / "build.toml").write_text(TEXT, encoding="utf-8")
    append_effects(tmp_path / "build.toml", diagnosis.effects)
    (spec,) = parse_build((tmp_path / "build.toml").read_text("utf-8")).effects
    assert spec.values["inductance"].re + 50 * spec.values["delay"].re == pytest.approx(50 * delay, rel=0.1)


def test_a_lead_is_found_in_a_step_where_the_build_states_none() -> None:
    build, random = (
        parse_build(TEXT + LEAD.replace('"terminals"', '"terminals"\nsteps = ["ml1"]')),
        np.random.default_rng(1),
    )
    f, sweeps = F[::2], dict[str, tuple[Sweep, ...]]()
    for step, inductance in (("disk", 6e-8), ("ml1", 5e-8)):
        noise = 2e-4 * (random.normal(size=f.size) + 1j * random.normal(size=f.size))
        Z = stack_of(build, build.step(step)).impedance(f) + 2j * np.pi * f * inductance
        sweeps[step] = (Sweep(f, Z * np.exp(noise)),)
    problem = Problem.of(solve(FitTask(build, sweeps), lambda _: None), None)
    (one,) = candidates(problem, ("lead-inductance",))
    found = fitted(problem, (one,), problem.values)
    assert one.steps == ("disk",)
    assert found.values[one.parameters[0]] == pytest.approx(6e-8, rel=0.02)
    assert found.values["lead-inductance@terminals.inductance"] == pytest.approx(5e-8, rel=0.02)


def test_a_resonance_is_found_beside_one_that_the_build_states(tmp_path: Path) -> None:
    lines = {2.6e6: 0.03, 4.9e6: 0.02}
    section = '[[effects]]\neffect = "spurious-resonance"\nwhere = "layer:disk"\nstrength = {}\nstiffness = 0\n'
    known = section.format(0.03) + "frequency_Hz = 2.6e6\nq = 60\nphase_rad = 0\n"
    device = Device(stack_of(parse_build(TEXT), parse_build(TEXT).step("disk")))
    for number, (frequency, strength) in enumerate(lines.items(), 1):
        values = {"strength": strength, "frequency": frequency, "q": 60.0}
        device = device.with_effect(find_effect("spurious-resonance").another(number), "layer:disk", values)
    random = np.random.default_rng(4)
    f = F[::2]
    noise = 2e-4 * (random.normal(size=f.size) + 1j * random.normal(size=f.size))
    sweeps = {"disk": (Sweep(f, device.impedance(f) * np.exp(noise)),)}
    build = tmp_path / "build.toml"
    build.write_text(TEXT + known, encoding="utf-8")
    diagnosis = diagnose(FitTask(parse_build(TEXT + known), sweeps), effects=("spurious-resonance",))
    append_effects(build, diagnosis.effects)
    found = [one.values["frequency"].re for one in parse_build(build.read_text("utf-8")).effects]
    assert sorted(found) == pytest.approx(sorted(lines), rel=1e-3)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("lead-inductance", "lead-inductanc"), "effects\\[0\\]: effect 'lead-inductanc' is not known; .*did you mean"),
        (('"terminals"', '"terminal"'), "where is 'terminal'; there are terminals"),
        (("inductance_H", "inductance"), "effects\\[0\\].inductance is not a known key; did you mean inductance_H"),
        (("5e-8", "-5e-8"), "inductance_H is -5e-08; allowed is 0 or more"),
        (("value = 5e-8, ", ""), "has no value; write inductance_H = { value"),
        (("value = 5e-8", "value = 0.0"), "inductance_H is 0 with u = 2e-08; give the value from which"),
        (("inductance_H = { value = 5e-8, u = 2e-8 }", ""), "lead-inductance has no inductance_H; it needs"),
        (("lead-inductance", "temperature-drift"), "temperature-drift belongs to a sweep, not to a sample"),
        (("lead-inductance", "learned"), "learned: quantity is missing; there are stiffness"),
        (('"terminals"', '"terminals"\nsteps = ["x"]'), "steps has 'x'; there are disk"),
        ((LEAD, LEAD + LEAD), "lead-inductance at terminals is given twice"),
    ],
)
def test_an_impossible_effect_is_refused_with_a_sentence(change: tuple[str, str], says: str) -> None:
    with pytest.raises(BuildError, match=says):
        parse_build(TEXT + LEAD.replace(*change))


def test_a_learned_law_needs_a_place_and_a_law_of_its_quantity() -> None:
    law = '\n[[effects]]\neffect = "learned"\nwhere = "layer:disk"\nquantity = "permittivity"\nlaw = "{}"\n'
    with pytest.raises(BuildError, match="there is no law 'spring' for the permittivity of disk; there are power"):
        parse_build(TEXT + law.format("spring"))
    with pytest.raises(BuildError, match="no law is named for the permittivity of disk; there are power"):
        parse_build(TEXT + law.replace('law = "{}"\n', ""))
    with pytest.raises(BuildError, match="learned: where is 'face:back'; there are layer:disk"):
        parse_build(TEXT + law.format("debye").replace("layer:disk", "face:back"))


def test_several_laws_can_be_learned_at_one_place() -> None:
    """They act in the order of the file, the first innermost; the second is called `learned-2`."""
    law = '\n[[effects]]\neffect = "learned"\nwhere = "terminals"\nlaw = "resistance"\n'
    series = law + 'quantity = "series"\nsize_ohm = 3\n'
    shunt = law + 'quantity = "shunt"\nsize_S = { value = 1e-3, u = 5e-4 }\n'
    build = parse_build(TEXT + series + shunt)
    Z = stack_of(build, build.step("disk")).impedance(F)
    fit = run(load_fitter("mason"), FitTask(build, {"disk": (Sweep(F, 1 / (1 / (Z + 3) + 2e-3)),)}))
    assert fit.constants["learned-2@terminals.size"].re == pytest.approx(2e-3, rel=1e-3)
    assert fit.chi2_per_dof < 2
    assert build.data_sheet["learned@terminals.size"].re == 3
