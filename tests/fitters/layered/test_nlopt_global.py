"""The global search finds the truth from data sheets that are 30 % wrong, and reports its evidence."""

import re

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.engine.parameters.assembly import coordinates_of, nominal_parameters, priors_of, stack_of
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.layered.multistart import box_of
from pzctl.fitters.layered.nlopt_global import NloptGlobal

DISK = """
name = "S4"
diameter_mm = 16.0
[[layers]]
name = "disk"
kind = "piezo"
thickness_mm = 0.512
density_kg_m3 = 7700
c33D_GPa = {{ re = {c}, im = 1.0, u = 40, u_im = 1.0 }}
h33_1e8_V_m = {{ re = {h}, im = 0, u = 6, u_im = 0.5 }}
eps33S_r = {{ re = {e}, im = -20, u = 250, u_im = 20 }}
[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = {{ value = {z}, u = 3 }}
c_m_s = {{ value = {s}, u = 700 }}
q = {{ value = {q}, u = 20 }}
thickness_mm = 0.139
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ml1"
layers = ["disk", "ml1"]
"""
TRUTH = {"c": 150.0, "h": 19.8, "e": 914.0, "z": 10.3, "s": 2455.0, "q": 30.0}
F = np.linspace(1e6, 9e6, 201)


def told(factors):
    return parse_build(DISK.format(**{name: value * factors[name] for name, value in TRUTH.items()}))


@pytest.fixture(scope="module")
def truth():
    return told(dict.fromkeys(TRUTH, 1.0))


@pytest.fixture
def sweeps(truth, swept):
    return {step.name: (swept(stack_of(truth, step), F, 2e-4),) for step in truth.steps}


@pytest.mark.long
def test_the_truth_is_found_from_wrong_data_sheets(truth, sweeps):
    rng = np.random.default_rng(0)
    build = told({name: rng.uniform(0.7, 1.3) for name in TRUTH})
    result = NloptGlobal().fit(FitTask(build, sweeps))
    for name, constant in result.constants.items():
        if constant.free:
            layer, what = name.split(".")
            assert abs(constant.re - truth.layer(layer).values[what].re) < 4 * constant.u_re, name
    assert 0.8 < result.chi2_per_dof < 1.2
    assert re.match(r"\d+ descents ended in \d+ distinct minima; ", result.says[0])
    assert "MLSL+LBFGS 1x" in result.says[1]
    assert "disk.c33D 1.5e+11" in result.says[1]


def test_bounds_are_physical_and_wide(truth):
    begun = nominal_parameters(truth)
    box = box_of(coordinates_of(truth, ("disk", "ml1"), begun, None), priors_of(truth, ("disk", "ml1")))
    bounds = dict(zip(box.names, zip(box.low, box.high, strict=True), strict=True))
    for name in ("disk.c33D", "ml1.z", "ml1.c"):
        low, high = np.exp(bounds[name])
        value = begun.get(name, begun.get(f"{name}.re"))
        assert low <= 0.7 * value < 1.3 * value <= high
    assert bounds["disk.h33"][0] > 0  # the impedance depends on its square, so one sign is enough
    box.check()


def test_time_and_cancelling(truth, sweeps):
    result = NloptGlobal(seconds=0.3).fit(FitTask(told({**dict.fromkeys(TRUTH, 1.0), "z": 1.3}), sweeps))
    assert "the time of 0.3 s was over" in result.says[0]

    def stop(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        NloptGlobal().fit(FitTask(truth, sweeps), stop)


def test_nothing_free_is_said(truth, sweeps):
    with pytest.raises(FitError, match="nothing is free to be fitted"):
        NloptGlobal().fit(FitTask(truth, sweeps, ()))
