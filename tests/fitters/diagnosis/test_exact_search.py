"""The search without errors: effects so small that errors of instrument and model describe them as well."""

import numpy as np
import pytest

from pzctl.fitters.diagnosis.hypotheses.candidates import candidates
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted, marginal_of
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.hypotheses.size_priors import block_of
from pzctl.fitters.diagnosis.search.exact_search import exact_hypotheses
from pzctl.fitters.diagnosis.search.screening import screened
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.error_model.error_sizes import ErrorSizes
from pzctl.fitters.interface import FitTask
from pzctl.models.base.arrays import Frequencies
from pzctl.models.effects import Device, EffectParameter, find_effect
from pzctl.models.sweep import Sweep

from .conftest import BUILD, F

CONSIDERED = ("lead-inductance", "leakage", "electrode-mass")
TINY = 6e-10
"""A lead of 0.6 nH: no more than the residual of a compensated fixture."""


def posed(device: Device, f: Frequencies, noise: float) -> Problem:
    random = np.random.default_rng(5)
    Z = device.impedance(f) * np.exp(noise * (random.normal(size=f.size) + 1j * random.normal(size=f.size)))
    return Problem.of(solve(FitTask(BUILD, {"disk": (Sweep(f, Z),)}), lambda _: None), None)


@pytest.fixture(scope="module")
def problem(bare) -> Problem:
    return posed(bare.with_effect(find_effect("lead-inductance"), "terminals", {"inductance": TINY}), F, 2e-5)


def test_errors_hide_a_tiny_lead_and_a_search_without_errors_finds_it(problem) -> None:
    null = fitted(problem, (), problem.values, near=True, rounds=5)
    assert null.fit.shortfall == 0, "the errors explain the recording"
    assert not null.fit.sizes.exact
    found = exact_hypotheses(problem, candidates(problem, CONSIDERED), null)
    best = max(found, key=lambda one: one.log_weight)
    (effect,) = best.effects
    assert effect.effect.name == "lead-inductance"
    assert best.fit.sizes.exact
    assert best.values["lead-inductance@terminals.inductance"] == pytest.approx(TINY, rel=0.1)
    assert best.log_weight > null.log_weight


def test_what_constants_absorb_is_found_beside_another_effect_though_it_promises_little(bare) -> None:
    lead = bare.with_effect(find_effect("lead-inductance"), "terminals", {"inductance": 1.2e-9})
    both = lead.with_effect(find_effect("loss-dispersion"), "layer:disk", {"exponent": 0.6})
    problem = posed(both, np.linspace(0.3e6, 5.2e6, 301), 1e-4)
    null = fitted(problem, (), problem.values, near=True, rounds=5)
    choice = candidates(problem, ("lead-inductance", "series-resistance", "loss-dispersion", "spurious-resonance"))
    found = exact_hypotheses(problem, choice, null)
    best = max(found, key=lambda one: one.log_weight)
    assert {effect.effect.name for effect in best.effects} == {"lead-inductance", "loss-dispersion"}
    assert best.log_weight > null.log_weight


def test_screening_estimates_sizes_below_all_trial_sizes(problem) -> None:
    null = fitted(problem, (), problem.values, (ErrorSizes(),), fixed=True)
    promises = screened(problem, null, candidates(problem, CONSIDERED))[2]
    assert promises[0].candidate.effect.name == "lead-inductance"
    assert promises[0].start["lead-inductance@terminals.inductance"] == pytest.approx(TINY, rel=0.5)
    assert all(0 <= one.survives <= 1 for one in promises)


def test_a_start_with_a_vanished_layer_begins_at_a_part_of_its_nominal_thickness(problem) -> None:
    values = {**problem.values, "disk.thickness": 1e-60}
    start = marginal_of(problem, (), values).objective.coordinates
    thickness, _ = start.forward(start.x)
    assert thickness["disk.thickness"] > 1e-3 * problem.values["disk.thickness"]


def test_every_value_of_a_fraction_is_equally_likely() -> None:
    block = block_of("weight", EffectParameter("weight", "1", typical=1.0, upper=1.0, fraction=True))
    (zero,), (half,), (one,) = (block.inverse(np.array([p])) for p in (0.0, 0.5, 1.0))
    assert half == pytest.approx(0)
    assert -zero == pytest.approx(one)
    assert one == pytest.approx(1)
