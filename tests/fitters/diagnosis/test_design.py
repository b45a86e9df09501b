"""Experiment design, comparison of recordings without a model, and undetectable effects."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.fitters.diagnosis.design.candidate_sweeps import experiments, frequencies, plan_of, settings_of
from pzctl.fitters.diagnosis.design.experiment_design import proposals
from pzctl.fitters.diagnosis.design.sweep_comparison import compared
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.findings import Diagnosis
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates
from pzctl.fitters.diagnosis.hypotheses.conditions import conditions_of
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.inference.inflated_uncertainty import widened
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.noise import noise_of
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Conditions, Device, find_effect
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.sample import sample

BUILD = read_build(THESIS_BUILD)
F = np.linspace(3e6, 5e6, 101)
NOISE = 5e-5
INSTRUMENT = replace(CAPABILITIES, noise=lambda plan, f, Z: np.full(f.size, NOISE))
STILL = ("stray-capacitance", "electrode-mass")
OF_THE_SWEEP = ("drive-nonlinearity", "sweep-lag", "temperature-drift")
CONSIDERED = (*OF_THE_SWEEP, "lead-inductance", *STILL)
"""Effects similar to those hidden here; the tests of `pzctl measure --diagnose` use the whole catalogue."""


def swept(ran: Conditions | None = None, seed: int = 1, f=F, **settings: object) -> Sweep:
    """Sweep the thesis's disk, which softens with the level, with the noise of a 4294A."""
    stack = sample(0).stack("disk")
    device = Device(stack, conditions=ran or Conditions()).with_effect(  # type: ignore[arg-type]
        find_effect("drive-nonlinearity"), "layer:disk", {"softening": 60.0}
    )
    random = np.random.default_rng(seed)
    Z = device.impedance(f) * np.exp(NOISE * (random.normal(size=f.size) + 1j * random.normal(size=f.size)))
    usual = {"oscillator_V": 0.5, "bandwidth": 5, "direction": "up", "estimated_seconds": 26.0, "sweep_seconds": 26.0}
    return Sweep(f, Z, {**usual, **settings})


@pytest.fixture(scope="module")
def told() -> tuple[FitTask, Diagnosis]:
    task = FitTask(BUILD, {"disk": (swept(),)})
    return task, diagnose(task, CONSIDERED)


def test_sweep_conditions_are_read_from_the_settings() -> None:
    first = swept()
    fast = swept(bandwidth=1, estimated_seconds=0.52, sweep_seconds=0.01)
    ran = conditions_of([first, fast, swept(direction="down", oscillator_V=0.1)])
    assert [round(one.pace, 6) for one in ran] == [1, 50, 1]
    assert [one.began for one in ran] == [0, 1, 1.02], "a clock that a simulated sweep outruns is not believed"
    assert [(one.direction, one.level_V) for one in ran] == [("up", 0.5), ("up", 0.5), ("down", 0.1)]
    np.testing.assert_allclose(ran[2].elapsed(3), [2.02, 1.52, 1.02])
    later = replace(first, time="2026-01-01T10:01:44Z")
    clocked = conditions_of([replace(first, time="2026-01-01T10:00:00Z"), later])
    assert [one.began for one in clocked] == [0, 4], "an instrument's clock is"
    silent = [replace(one, settings={}) for one in (first, fast)]
    assert [(one.began, one.pace) for one in conditions_of(silent)] == [(0, 1), (1, 1)]


def test_a_plan_is_recovered_from_settings() -> None:
    plan = plan_of(swept(bandwidth=3, direction="down"))
    assert (plan.bandwidth, plan.direction, plan.oscillator_V) == (3, "down", 0.5)
    kinds = {one.kind: one.plan for one in experiments([swept()], INSTRUMENT)}
    assert kinds["lower level"].oscillator_V == 0.1
    assert kinds["direction"].direction == "down"
    assert kinds["wider band"].segments[0].stop_Hz == 16.5e6
    assert "higher level" not in kinds, "a 4294A measures below 48 ohm with at most 0.5 V"
    any_impedance = replace(INSTRUMENT, low_impedance=None)
    assert "higher level" in {one.kind for one in experiments([swept()], any_impedance)}
    assert "higher level" not in {one.kind for one in experiments([swept(oscillator_V=1.0)], any_impedance)}


def test_a_recording_states_the_source_impedance() -> None:
    for said, null in (({"source_ohm": 50.0}, 50.0), ({}, 25.0)):
        problem = Problem.of(solve(FitTask(BUILD, {"disk": (swept(**said),)}), lambda _: None), None)
        (drive,) = (one for one in candidates(problem) if one.effect.name == "drive-nonlinearity")
        assert {knob.name: knob.null for knob in drive.effect_parameters}["source"] == null


def test_proposed_sweeps_are_within_the_analyzers_capabilities() -> None:
    usual = replace(INSTRUMENT, low_impedance=None)
    own = experiments([swept()], usual)
    small = replace(usual, frequency_Hz=(2e6, 7e6), oscillator_V=(0.2, 0.6), bandwidths=(2, 3), points_per_sweep=100)
    kinds = {one.kind: one.plan for one in experiments([swept()], small)}
    assert {one.kind for one in own} - kinds.keys() == {"lower level", "higher level"}
    (wider,) = kinds["wider band"].segments
    assert (wider.start_Hz, wider.stop_Hz, kinds["bandwidth"].bandwidth) == (2e6, 7e6, 3)


def test_proposed_sweeps_are_possible_and_differ_as_stated() -> None:
    sweep = swept()
    base = plan_of(sweep)
    for one in experiments([sweep, swept(f=np.linspace(1e6, 9e6, 101))], INSTRUMENT):
        f = frequencies(one.plan)
        assert 40 <= f[0] < f[-1] <= 110e6, one.kind
        assert f.size == one.plan.segments[0].points <= 801
        said = plan_of(Sweep(f, np.full(f.size, 1 - 1j), settings_of(one.plan)))
        assert (said.direction, said.oscillator_V, said.bandwidth) == (
            one.plan.direction,
            one.plan.oscillator_V,
            one.plan.bandwidth,
        )
        assert (one.plan == base) == (one.kind == "repeat"), one.kind


@pytest.mark.long
def test_another_level_is_proposed_where_it_decides(told: tuple[FitTask, Diagnosis]) -> None:
    task, diagnosis = told
    assert [finding.effect for finding in diagnosis.findings] == ["drive-nonlinearity"]
    asked = {
        (q.effect, q.kind): one.experiment.kind for one in proposals(task, diagnosis, INSTRUMENT) for q in one.decides
    }
    assert "level" in asked["drive-nonlinearity", "seen once"]
    again = replace(task, sweeps={"disk": (swept(), swept(Conditions(level_V=0.1), 2, oscillator_V=0.1))})
    sure = replace(diagnosis, findings=(replace(diagnosis.findings[0], alternatives=()),), not_decidable=())
    assert [one.decides[0].kind for one in proposals(task, sure, INSTRUMENT)] == ["seen once"]
    assert not proposals(again, sure, INSTRUMENT), "it was seen at two levels"


def test_recordings_are_compared_without_a_model() -> None:
    low = swept(Conditions(level_V=0.1), 2, oscillator_V=0.1)
    same, other, band = compared([swept()], [swept(seed=3), low, swept(seed=4, f=np.linspace(3.5e6, 6e6, 301))])
    assert same.says == "repeated: the two recordings agree to within noise."
    assert other.differs
    assert other.says.startswith("0.1 V instead of 0.5 V: the two recordings differ by ")
    assert other.shift is not None
    assert 3e-6 < other.shift < 3e-5, "at the lower level it is stiffer"
    assert band.excess < 1.5, "where both were recorded they agree"


def test_sweeps_under_other_conditions_are_not_repeats() -> None:
    low = swept(Conditions(level_V=0.1), 2, oscillator_V=0.1)
    noise, sigmas = noise_of([swept(), low])
    assert noise.source == "smoothness"
    assert all(0.8 * NOISE < np.median(sigma) < 1.3 * NOISE for sigma in sigmas)
    assert noise_of([swept(), swept(seed=2)])[0].source == "repeats"


def test_uncertainties_include_undetectable_effects(told: tuple[FitTask, Diagnosis]) -> None:
    _, diagnosis = told
    (entry, *_) = [one for one in diagnosis.not_decidable if one.effect == "electrode-mass"]
    before, after = (one.final.constants["disk.c33D"] for one in (diagnosis, widened(diagnosis)))
    assert before.u_re is not None
    assert after.u_re is not None
    for key, value, u, wider in (
        ("disk.c33D", before.re, before.u_re, after.u_re),
        ("disk.c33D.im", before.im, before.u_im, after.u_im),
    ):
        parts = [one.shifts.get(key, 0.0) * value / np.sqrt(3) for one in diagnosis.not_decidable]
        assert any(parts)
        assert u is not None
        assert wider == pytest.approx(np.sqrt(u**2 + np.sum(np.square(parts))))
    assert abs(entry.shifts["disk.c33D"]) * before.re > before.u_re
    assert "electrode-mass" in widened(diagnosis).says[-1]
