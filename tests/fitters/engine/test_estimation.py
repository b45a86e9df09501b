"""Uncertainty, budget and gluing steps of `mason`, each compared with an independent calculation."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build, read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.sherrit_thickness import SherritThickness
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.overrides import Amendments, amended
from pzctl.fitters.interface import FitResult, FitTask, Fitter, Options
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.layered.nelder_mead import MasonNelderMead
from pzctl.fitters.layered.nlopt_global import NloptGlobal
from pzctl.fitters.uncertainty.profile import profile_intervals
from pzctl.models.build import Build
from pzctl.models.stack import HalfSpace, Piezo, Stack
from pzctl.models.sweep import Sweep

DISK = """
name = "plate"
area_mm2 = 200.0
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.5, u = 0.001 }
density_kg_m3 = 7700
[load]
back = "vacuum"
front = "vacuum"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ground"
layers = ["disk"]
reground = { disk = { thickness_mm = { value = 0.47, u = 0.02 } } }
"""
TRUE = Piezo("disk", 0.5e-3, 7700.0, 145e9 * (1 + 0.0125j), 1.95e9 * (1 - 0.002j), 8.1e-9 * (1 - 0.017j))


def plate(thickness: float, seed: int = 1, points: int = 401) -> Sweep:
    """A free plate with relative noise of 1e-3."""
    f = np.linspace(1e6, 15e6, points)
    stack = Stack((replace(TRUE, thickness=thickness),), HalfSpace("v", 0.0), HalfSpace("v", 0.0), 200e-6)
    rng = np.random.default_rng(seed)
    error = 1e-3 * (rng.standard_normal(points) + 1j * rng.standard_normal(points))
    return Sweep(f, stack.impedance(f) * np.exp(error), id="plate")


USUAL = Options()


def disk(options: Options = USUAL) -> FitTask:
    return FitTask(parse_build(DISK), {"disk": (plate(0.5e-3),)}, options=options)


@pytest.fixture(scope="module")
def glued(cases: Path) -> Callable[[Options], FitResult]:
    folder = cases / "glue-null"
    sweeps = {step: (read_recording(folder / f"{step}.csv"),) for step in ("disk", "ml1")}
    return lambda options: Mason().fit(FitTask(read_build(folder / "build.toml"), sweeps, options=options))


def cost(build: Build, sweep: Sweep) -> float:
    """Sum of squares at the minimum."""
    return 2 * solve(FitTask(build, {"disk": (sweep,)}), lambda _: None).descent.cost


@pytest.mark.parametrize(("level", "rise"), [("p68", 1.0), ("p95", 3.841)])
def test_the_misfit_at_the_ends_of_a_profile_has_the_right_increase(level: str, rise: float) -> None:
    task = disk()
    assert task.build is not None
    interval = profile_intervals(solve(task, lambda _: None).descent)["disk.h33.re"]
    least = cost(task.build, plate(0.5e-3))
    for end in getattr(interval, level):
        pulled = amended(task.build, Amendments(prior=(("disk.h33", end, 1e-4 * abs(end)),)))
        at_end = cost(replace(pulled, layers=pulled.layers), plate(0.5e-3))
        assert at_end - least == pytest.approx(rise, rel=0.25)


@pytest.mark.parametrize("uncertainty", ["profile", "bootstrap"])
def test_intervals_are_about_the_answer_and_no_narrower_beside_an_analyzers_phase_error(uncertainty: str) -> None:
    sweep = plate(0.5e-3)
    f = sweep.frequency
    turned = replace(sweep, impedance=sweep.impedance * np.exp(8e-4j * np.sin(3 * np.log(f / f[0]))))
    build = parse_build(DISK)
    usual, wanted = (
        Mason().fit(FitTask(build, {"disk": (turned,)}, options=options))
        for options in (Options(), Options(uncertainty=uncertainty))
    )
    for name in ("disk.eps33S", "disk.h33"):
        u, one = usual.constants[name].u_im, wanted.constants[name]
        assert u is not None
        assert one.interval_im is not None
        low, high = one.interval_im.p95
        assert (low + high) / 2 == pytest.approx(one.im, abs=0.3 * u)
        assert (high - low) / 2 == pytest.approx(1.96 * u, rel=0.2)
        assert one.u_im == pytest.approx(u, rel=0.2)


def test_bootstrap_and_covariance_agree_for_a_quadratic_misfit() -> None:
    told, drawn = Mason().fit(disk()), Mason().fit(disk(Options(uncertainty="bootstrap")))
    for name in ("disk.c33D", "disk.eps33S", "disk.h33"):
        first, second = told.constants[name], drawn.constants[name]
        assert first.u_re is not None
        assert first.u_im is not None
        assert second.u_re == pytest.approx(first.u_re, rel=0.25)
        assert second.u_im == pytest.approx(first.u_im, rel=0.25)
    kt = drawn.derived["disk.kt"]
    assert kt.interval_re is not None
    assert kt.u_re == pytest.approx(told.derived["disk.kt"].u_re, rel=0.25)
    assert kt.interval_re.p95[0] < kt.interval_re.p68[0] < kt.re < kt.interval_re.p68[1] < kt.interval_re.p95[1]


def test_the_budget_adds_up_and_predicts_the_error_of_a_wrong_area() -> None:
    task = disk()
    assert task.build is not None
    result = Mason().fit(task)
    budget = result.budget
    assert budget is not None
    for name, share in budget.re.items():
        u = result.constants[name].u_re
        assert u is not None
        assert np.linalg.norm(
            [share.noise, share.instrument, share.model, share.dimensions, share.knowledge]
        ) == pytest.approx(u, rel=1e-6)
    off = 1 + budget.tolerances["area"] / task.build.area.re
    wrong = replace(task.build, area=replace(task.build.area, re=off * task.build.area.re))
    moved = Mason().fit(replace(task, build=wrong)).constants["disk.eps33S"].re - result.constants["disk.eps33S"].re
    assert budget.re["disk.eps33S"].largest[0] in ("area", "disk.thickness")
    assert abs(moved) == pytest.approx(budget.re["disk.eps33S"].assumptions, rel=0.3)


def test_sequential_fits_with_the_full_posterior_equal_a_joint_fit(glued: Callable[[Options], FitResult]) -> None:
    joint, steps = glued(Options()), glued(Options(procedure="sequential"))
    assert steps.converged
    for name, constant in joint.constants.items():
        if constant.u_re:
            assert abs(steps.constants[name].re - constant.re) < 0.3 * constant.u_re, name
            assert steps.constants[name].u_re == pytest.approx(constant.u_re, rel=0.1 if name != "ml1.q" else 1.0)


def test_frozen_constants_are_listed_and_keep_their_values(glued: Callable[[Options], FitResult]) -> None:
    frozen = glued(Options(procedure="frozen"))
    joint = glued(Options())
    assert any("frozen" in sentence for sentence in frozen.says)
    assert frozen.constants["disk.c33D"].u_re, "what was frozen keeps the uncertainty of its own step"
    assert abs(frozen.constants["ml1.z"].u_re or 0) < 0.1 * (joint.constants["ml1.z"].u_re or 0)


def test_inseparable_constants_are_reported(glued: Callable[[Options], FitResult]) -> None:
    says = glued(Options()).says
    assert any(s.startswith("ml1.c and ml1.thickness cannot be separated") and "ml1.delay =" in s for s in says)
    assert any(s.startswith("glue1.thickness depends on glue1.z and glue1.c") and "compliance" in s for s in says)


@pytest.mark.parametrize("procedure", ["joint", "sequential"])
def test_a_layer_ground_between_two_steps_has_two_thicknesses(procedure: str) -> None:
    sweeps = {"disk": (plate(0.5e-3),), "ground": (plate(0.45e-3, 2),)}
    options = Options(procedure="joint" if procedure == "joint" else "sequential")
    result = Mason().fit(FitTask(parse_build(DISK), sweeps, options=options))
    before, after = result.constants["disk.thickness"], result.constants["disk.thickness@ground"]
    assert after.u_re is not None
    assert after.re / before.re == pytest.approx(0.9, rel=1e-3)
    assert result.chi2_per_dof < 1.2


@pytest.mark.parametrize("fitter", [Mason(), NloptGlobal(), MasonNelderMead()], ids=lambda fitter: fitter.name)
def test_every_stack_fitter_supports_grinding_and_derives_values_per_thickness(fitter: Fitter) -> None:
    sweeps = {"disk": (plate(0.5e-3),), "ground": (plate(0.45e-3, 2),)}
    result = fitter.fit(FitTask(parse_build(DISK), sweeps))
    whole, ground = result.constants["disk.thickness"], result.constants["disk.thickness@ground"]
    assert ground.re / whole.re == pytest.approx(0.9, rel=5e-3)
    before, after = result.derived["disk.fp"], result.derived["disk.fp@ground"]
    assert after.re / before.re == pytest.approx(1 / 0.9, rel=5e-3)
    if fitter.name != "mason-nelder-mead":
        assert before.u_re is not None
        assert after.u_re is not None
        # the resonance is measured directly; the uncertain thickness does not matter
        assert abs(after.re - np.sqrt(145e9 / 7700) / 0.9e-3) < 4 * after.u_re < 1e-3 * after.re


def test_a_bare_disk_fitter_uses_the_thickness_of_its_step() -> None:
    found = SherritThickness().fit(FitTask(parse_build(DISK), {"ground": (plate(0.45e-3, points=3201),)}))
    assert found.constants["disk.thickness"].re == pytest.approx(0.47e-3)


@pytest.mark.parametrize("objective", ["thesis", "kt2"])
def test_other_objectives_find_the_same_coupling(objective: str) -> None:
    options = Options(objective="thesis" if objective == "thesis" else "kt2")
    task = replace(disk(options), sweeps={"disk": (plate(0.5e-3, points=3201),)})
    kt = Mason().fit(task).derived["disk.kt"]
    assert kt.re == pytest.approx((1.95e9 * (1 - 0.002j) * np.sqrt(TRUE.eps33S / TRUE.c33D)).real, rel=3e-3)


def test_a_held_constant_keeps_the_builds_value_not_that_of_the_peaks() -> None:
    build = parse_build(DISK)
    held = amended(build, Amendments(hold=("disk.c33D",)))
    found = Mason().fit(FitTask(held, {"disk": (plate(0.5e-3),)})).constants["disk.c33D"]
    assert not found.free
    assert complex(found.re, found.im) == pytest.approx(build.layer("disk").values["c33D"].value)
