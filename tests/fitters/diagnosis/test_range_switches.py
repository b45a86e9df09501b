"""Switches of the analyzer's range: a step of the gain at every crossing of one level of |Z|, in all steps the same."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.search.local_errors import with_local_errors
from pzctl.fitters.diagnosis.search.range_switches import range_switches
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.error_model.local_error_kinds import RangeSwitch
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Device
from pzctl.models.sweep import Sweep


def recorded(bare: Device, task: FitTask, step: float, level: float, seed: int) -> Problem:
    f = task.sweeps["disk"][0].frequency
    Z = bare.impedance(f)
    noise = np.random.default_rng(seed).standard_normal((2, f.size))
    seen = Sweep(f, Z * np.exp(step * (np.abs(Z) > level) + 1e-4 * (noise[0] + 1j * noise[1])))
    return Problem.of(solve(replace(task, sweeps={"disk": (seen,)}), lambda _: None), None)


@pytest.mark.parametrize("step", [6e-4, -4e-4])
def test_a_step_of_gain_at_a_level_of_impedance_is_found_there(bare: Device, nothing: FitTask, step: float) -> None:
    Z = np.sort(np.abs(bare.impedance(nothing.sweeps["disk"][0].frequency)))
    level = float(np.median(Z))
    problem = recorded(bare, nothing, step, level, seed=5)
    null = fitted(problem, (), problem.values, near=True)
    aware = with_local_errors(problem, null)
    (found,) = (one for one in aware.local if isinstance(one, RangeSwitch))
    off = np.searchsorted(Z, found.level) - np.searchsorted(Z, level)
    assert abs(off) <= 6, "points on the wrong side of the level"
    after = fitted(aware, (), null.values, (null.fit.sizes,), near=True)
    assert after.log_evidence > null.log_evidence + 10
    assert range_switches(after) == (found,), "what is accounted for is found again, and nothing else"


def test_noise_is_no_switch_of_the_range(bare: Device, nothing: FitTask) -> None:
    for seed in range(4):
        problem = recorded(bare, nothing, 0.0, 1.0, seed)
        assert range_switches(fitted(problem, (), problem.values, near=True)) == ()
