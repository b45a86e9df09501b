"""Condensed recordings: fewer points that say the same, for a search over dense sweeps."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.fitters.diagnosis.hypotheses.candidates import candidates
from pzctl.fitters.diagnosis.hypotheses.condensed_recordings import condensed
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.inference.effect_size import constants_of
from pzctl.fitters.diagnosis.search.greedy_search import GreedySearch
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.error_model.error_sizes import ErrorSizes
from pzctl.fitters.interface import FitTask
from pzctl.models.base.arrays import Reals
from pzctl.models.effects import Conditions, Device, find_effect
from pzctl.models.sweep import Sweep

DENSE = np.linspace(1.5e6, 7.5e6, 2401)
LEAD = {"inductance": 1.2e-8}


@pytest.fixture(scope="module")
def dense(bare: Device, nothing: FitTask) -> Problem:
    """A dense sweep of the disk with a lead."""
    return swept(DENSE, bare, nothing)


def swept(f: Reals, bare: Device, nothing: FitTask, colour: float = 0.0) -> Problem:
    """Return the problem of a sweep of the disk with a lead, with noise of that correlation between neighbours."""
    random = np.random.default_rng(7)
    device = bare.with_effect(find_effect("lead-inductance"), "terminals", LEAD)
    white = random.normal(size=f.size) + 1j * random.normal(size=f.size)
    from scipy.signal import lfilter  # imported late: it takes half a second, in every process of a test run

    noise = lfilter([2e-4 * np.sqrt(1 - colour**2)], [1.0, -colour], white)
    task = replace(nothing, sweeps={"disk": (Sweep(f, device.impedance(f) * np.exp(noise)),)})
    return Problem.of(solve(task, lambda _: None), None)


def test_a_fit_to_condensed_recordings_has_the_values_and_uncertainties_of_all_points(dense: Problem) -> None:
    few = condensed(dense, 0.0)
    (lead,) = candidates(dense, ("lead-inductance",))
    assert few.recordings[0].noise.size < DENSE.size / 3
    exact = (ErrorSizes(),)
    whole, part = (
        constants_of(problem, fitted(problem, (lead,), problem.values, exact, fixed=True)) for problem in (dense, few)
    )
    for name, own in whole.items():
        if own.free:
            assert part[name].re == pytest.approx(own.re, abs=0.1 * own.u_re), name
            assert part[name].im == pytest.approx(own.im, abs=0.1 * own.u_im), name
            assert part[name].u_re == pytest.approx(own.u_re, rel=0.1), name


def test_points_that_are_left_keep_the_time_at_which_the_sweep_passed_them(bare: Device) -> None:
    lag, drift = find_effect("sweep-lag"), find_effect("temperature-drift")
    device = bare.with_effect(lag, "sweep", {"lag": 300.0, "memory": 0.5})
    device = device.with_effect(drift, "sweep", {"relative": 1e-3, "permittivity": 3e-3})
    f = np.geomspace(1.5e6, 7.5e6, 2401)
    at = np.unique(np.random.default_rng(1).choice(f.size, 400))
    for direction in ("up", "down"):
        ran = Conditions(direction=direction)
        left = replace(ran, points=tuple(ran.passed(f.size)[at].tolist()))
        Z = replace(device, conditions=ran).impedance(f)[at]
        np.testing.assert_allclose(replace(device, conditions=left).impedance(f[at]), Z, rtol=1e-4)
        steady = device.assembly.steady(f[at])
        assert np.max(np.abs(Z / steady - 1)) > 1e-2


@pytest.mark.long
def test_a_search_over_a_dense_sweep_ends_with_all_its_points(dense: Problem) -> None:
    search = GreedySearch(dense, candidates(dense, ("lead-inductance", "leakage")))
    found = search.run()
    assert [one.effect.name for one in found.effects] == ["lead-inductance"]
    assert found.objective.points == DENSE.size
    assert search.problem.recordings == dense.recordings


@pytest.mark.long
def test_hypotheses_keep_their_order_when_coloured_noise_is_seen_at_all_points(bare: Device, nothing: FitTask) -> None:
    """Means of groups have less colour: with theirs, all effects were 4000 nats behind a fit without any."""
    problem = swept(DENSE[::2], bare, nothing, 0.8)
    search = GreedySearch(problem, candidates(problem, ("lead-inductance", "series-resistance")))
    search.run()
    assert [one.effect.name for one in search.best.effects] == ["lead-inductance"]
    assert {one.fit.sizes.colour for one in search.ranked} <= {0.65, 0.8}


def test_a_recording_that_is_not_dense_stays_as_it_is(bare: Device, nothing: FitTask) -> None:
    sparse = swept(DENSE[::16], bare, nothing)
    assert condensed(sparse, 0.0) is sparse
