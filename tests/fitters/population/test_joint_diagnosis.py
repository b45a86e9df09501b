"""Shared effects of samples of one bench: a common lead is found, different leads are not, and no effect gives none."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.drivers.recordings.write import write_csv
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.hypotheses.bench_effects import BenchEffect
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.fitters.population.batch import BatchJob, Failure, results_of
from pzctl.fitters.population.exact_bench import exact_bench
from pzctl.fitters.population.joint_diagnosis import HowToDiagnose, TooFewSamplesError, diagnose_together
from pzctl.fitters.population.process_pool import process_pool
from pzctl.fitters.population.sample_equations import SampleEquations, bench_effects, ends_of, sample_equations
from pzctl.fitters.population.shared_bench import SharedBench
from pzctl.fitters.population.shared_effects import shared_bench
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
STACK = stack_of(BUILD, BUILD.step("disk"))
F = np.linspace(1.5e6, 7.5e6, 41)
EFFECTS = ("lead-inductance", "leakage")


def bench(leads: Sequence[float], seed: int, accuracy: float = 3e-4) -> Mapping[str, FitTask]:
    """Disks with different constants, a lead each, and an analyzer with errors of this size."""
    rng = np.random.default_rng(seed)
    slope = complex(*rng.normal(0, accuracy, 2))
    tasks: dict[str, FitTask] = {}
    for k, lead in enumerate(leads):
        own = {name: STACK.parameters()[name] * rng.normal(1, 0.02) for name in ("disk.c33D.re", "disk.eps33S.re")}
        noise = 3e-4 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
        Z = STACK.replace(own).impedance(F) + 2j * np.pi * F * lead
        tasks[f"S{k + 1}"] = FitTask(BUILD, {"disk": (Sweep(F, Z * np.exp(noise + slope * np.log(F / 4e6))),)})
    return tasks


def shared(tasks: Mapping[str, FitTask], made: dict[tuple[str, str], SampleEquations] | None = None) -> SharedBench:
    """The shared effects of these samples, computed in this process; `made`: equations of these and of others."""
    ends, knobs, made = ends_of(list(tasks.values())), bench_effects(STACK, EFFECTS), {} if made is None else made

    def survey(known: tuple[BenchEffect, ...]) -> list[SampleEquations]:
        for name, task in tasks.items():
            if (name, repr(known)) not in made:
                made[name, repr(known)] = sample_equations(name, task, ends, knobs, known)
        return [made[name, repr(known)] for name in tasks]

    return shared_bench(survey, knobs, ends, dict.fromkeys(EFFECTS, 1.0))


@pytest.mark.long
def test_a_common_lead_has_one_size() -> None:
    found = shared(bench([9e-9] * 3, 3))
    (lead,) = found.effects
    assert (lead.effect, lead.probability > 0.8) == ("lead-inductance", True)
    residue = found.fixture["inductance"].value if found.fixture else 0.0
    assert lead.parameters["inductance"].value + residue == pytest.approx(9e-9, abs=4e-10)
    assert sum(p for s, p in lead.scatter.items() if float(s) <= 0.1) > 0.9
    assert not lead.within_fixture
    assert set(lead.sizes) == set(lead.alone) == {"S1", "S2", "S3"}


@pytest.mark.long
def test_different_leads_are_not_shared() -> None:
    found = shared(bench([0.0, 30e-9, 12e-9], 4))
    assert not found.effects
    assert "lead-inductance" in found.not_shared


@pytest.mark.long
def test_many_samples_determine_the_fixtures_residual_better() -> None:
    tasks, made = bench([2e-9] * 4, 5), dict[tuple[str, str], SampleEquations]()
    few, many = shared({name: tasks[name] for name in ("S1", "S2")}, made), shared(tasks, made)
    assert many.fixture["inductance"].value == pytest.approx(2e-9, abs=3 * many.fixture["inductance"].u)
    assert many.fixture["inductance"].u < few.fixture["inductance"].u
    assert many.fixture["inductance"].probability > 0.9
    nothing = shared(bench([0.0] * 2, 6))
    assert not nothing.effects
    assert not nothing.not_shared
    assert all(part.probability < 0.5 for part in nothing.fixture.values())


@pytest.mark.long
def test_a_shared_effect_is_not_found_again_in_a_sample() -> None:
    (task,) = bench([3e-8], 7).values()
    values = {"inductance": 3e-8, "resistance": 0.0, "skin": 0.0}
    without = diagnose(task, EFFECTS)
    beside = diagnose(task, EFFECTS, known=(BenchEffect("lead-inductance", values),))
    assert [one.effect for one in without.findings] == ["lead-inductance"]
    assert (beside.verdict, beside.findings) == ("no-mismatch", ())
    assert beside.final.constants["disk.c33D"].re == pytest.approx(without.final.constants["disk.c33D"].re, rel=1e-3)


def test_without_errors_of_the_analyzer_a_lead_is_no_cable() -> None:
    alone = {name: diagnose(task, ("lead-inductance", "cable")) for name, task in bench([2e-8] * 2, 9, 0.0).items()}
    assert all(one.exact for one in alone.values())
    knobs = bench_effects(STACK)
    found = exact_bench(alone, knobs)
    assert found is not None
    (lead,) = found.effects
    size = lead.parameters["inductance"]
    assert (lead.effect, lead.probability > 0.9) == ("lead-inductance", True)
    assert size.value == pytest.approx(2e-8, abs=3 * size.u)
    assert size.u < min(u for _, u in lead.sizes.values())
    assert float(lead.scatter["0"]) > 0.4
    (own,) = alone["S2"].findings
    other = replace(own, parameters={**own.parameters, "inductance": replace(own.parameters["inductance"], value=6e-8)})
    assert exact_bench({**alone, "S2": replace(alone["S2"], findings=(other,))}, knobs) is None
    assert exact_bench({**alone, "S2": replace(alone["S2"], findings=())}, knobs) is None


@pytest.mark.long
def test_what_each_sample_of_a_folder_has_is_written_to_its_build(tmp_path: Path) -> None:
    for name, task in bench([2e-8] * 2, 9, 0.0).items():
        (tmp_path / name).mkdir()
        shutil.copy(THESIS_BUILD, tmp_path / name / "build.toml")
        write_csv(task.sweeps["disk"][0], tmp_path / name / "disk.csv")
    done = CliRunner().invoke(app, ["diagnose", str(tmp_path), "--learn", "--effects", "lead-inductance"])
    assert done.exit_code == 0, done.output
    for name in ("S1", "S2"):
        (lead,) = read_build(tmp_path / name / "build.toml").effects
        assert lead.values["inductance"].re == pytest.approx(2e-8, rel=0.05)
        assert f"written to {tmp_path / name / 'build.toml'}: lead-inductance at terminals" in done.output


@pytest.mark.long
def test_a_sample_that_cannot_be_fitted_does_not_stop_the_others() -> None:
    tasks = dict(bench([9e-9] * 2, 8))
    flat = FitTask(BUILD, {"disk": (Sweep(F, np.full(F.size, 50.0 + 0j)),)})
    jobs = [BatchJob(name, task) for name, task in (*tasks.items(), ("flat", flat))]
    joint = diagnose_together(jobs, {}, HowToDiagnose(("lead-inductance",)))
    assert set(joint.own) == set(tasks)
    assert set(joint.failed) == {"flat"}
    assert all(one.verdict == "no-mismatch" for one in joint.own.values())
    assert joint.population.constants["disk.c33D"].re.n == 2
    with pytest.raises(TooFewSamplesError, match="two or more"):
        diagnose_together(jobs[:1], {})


def test_results_are_in_order_with_a_sentence_for_each_failure() -> None:
    # Another process cannot import a function of a test module; this one it can.
    with process_pool(2) as pool:
        first, missing, last = results_of(read_build, [THESIS_BUILD, Path("not-there.toml"), THESIS_BUILD], pool)
    assert first == last == BUILD
    assert isinstance(missing, Failure)
    assert "not-there.toml" in missing.says
