"""Fitter disk2d where it needs its whole search: a ceramic far from the library's, and a real disk."""

import json
from dataclasses import replace

import complex_ceramic
import numpy as np
import pytest
from disk_build import disk_build

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.diagnosis.inference.disk_beside import disk_beside
from pzctl.fitters.disk.two_d.disk2d import Disk2DFitter, disk_result, finite_disk
from pzctl.fitters.disk.two_d.disk_fit import fitted_disk
from pzctl.fitters.disk.two_d.disk_under_diagnosis import with_effects
from pzctl.fitters.disk.two_d.outside import Outside
from pzctl.fitters.disk.two_d.reduced_disk_cache import reduced_disk
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.engine.parameters.coordinates import positive
from pzctl.fitters.interface import FitTask
from pzctl.models.constants.passivity import passivity_margin
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.effects import Added, find_effect
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep

pytestmark = pytest.mark.usefixtures("own_cache")


def test_a_very_soft_ceramic_is_found_from_the_constants_of_another():
    real = np.array([126e9, 79.5e9, 84.1e9, 117e9, 23e9, -6.55, 23.3, 17.0, 15.05e-9, 13.02e-9])
    loss = np.where(np.arange(10) < 5, 1 / 65, np.where(np.arange(10) < 8, 0.0, -0.02))
    truth = Tensor6mm(*(real * (1 + 1j * loss)))
    _, reduced = reduced_disk(10.0, lambda _: None)
    f = np.linspace(1.4e6, 3.2e6, 301)
    law = CausalConstantQ(float(np.sqrt(f[0] * f[-1])))
    Z = Disk2D("disk", truth, np.pi * 25e-6, 1e-3, 7500.0, reduced, law).impedance(f)
    rng = np.random.default_rng(2)
    sweep = Sweep(f, Z * np.exp(2e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))))
    result = finite_disk(FitTask(disk_build(10, 1, 7500, "Pz27"), {"disk": (sweep,)}))
    assert result.chi2_per_dof < 1.3
    for name in CONSTANTS:
        assert abs(result.constants[f"disk.{name}"].re - getattr(truth, name).real) < (
            4 * result.constants[f"disk.{name}"].u_re
        ), name


def test_the_real_disk_of_20_by_2_mm_is_fitted_without_a_manual_start(recordings):
    sweep = read_recording(recordings / "disk-20x2" / "thickness-mode.csv")
    few = replace(sweep, frequency=sweep.frequency[::4], impedance=sweep.impedance[::4])
    result = Disk2DFitter().fit(FitTask(disk_build(20, 2.013, 7956), {"disk": (few,)}))
    assert result.rms_log_error < 0.05  # the one-dimensional model leaves 0.59
    # a narrow band around the thickness mode says almost nothing about motion along the circumference
    assert any("only together: disk.c12E" in sentence for sentence in result.says)
    # half of a soft ceramic's value: it compensates for the remaining misfit, and the result must say so
    assert any("Unusually far from" in sentence and "disk.eps11S" in sentence for sentence in result.says)
    tensor = Tensor6mm(*(complex(c.re, c.im) for c in (result.constants[f"disk.{name}"] for name in CONSTANTS)))
    assert passivity_margin(tensor.law) > 0
    assert 0.42 < tensor.thickness.kt.real < 0.55
    assert 500 < tensor.eps33S.real / 8.854e-12 < 1100


def test_a_lead_is_fitted_to_a_finite_element_disk(lab_cases):
    folder = lab_cases / "finite-disk-lead"
    truth = json.loads((lab_cases / "truth.json").read_text())["finite-disk-lead"]
    sweep = read_recording(folder / "disk.csv")
    few = replace(sweep, frequency=sweep.frequency[::16], impedance=sweep.impedance[::16])
    alone = fitted_disk(FitTask(read_build(folder / "build.toml"), {"disk": (few,)}), rounds=2, enough=0.1)
    lead = find_effect("lead-inductance")
    name = "lead-inductance@terminals.inductance"
    nominal = stack_of(alone.disk.build, alone.disk.build.step(alone.disk.step))
    added = Added(lead, "terminals", {"inductance": 0.0, "resistance": 0.0, "skin": 0.0, "capacitance": 0.0})
    whole = with_effects(alone, Outside((added,), (positive(name),), {name: 2e-8}, nominal=nominal))
    result = disk_result(whole, 0.0)
    assert result.rms_log_error < 0.05 * disk_result(alone, 0.0).rms_log_error
    values, _ = whole.descent.objective.coordinates.forward(whole.descent.x)
    assert values[name] == pytest.approx(truth["findings"][1]["inductance"], rel=0.02)


def test_two_effects_are_found_one_after_the_other_beside_a_finite_diameter():
    f = np.linspace(1.6e6, 3.2e6, 161)
    _, reduced = reduced_disk(10.0, lambda _: None)
    law = CausalConstantQ(float(np.sqrt(f[0] * f[-1])))
    Z = Disk2D("disk", complex_ceramic.TENSOR, np.pi * 25e-6, 1e-3, 7700.0, reduced, law).impedance(f)
    rng = np.random.default_rng(1)
    noise = np.exp(2e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)))
    wired = 1 / (1 / Z + 1 / 2e3) + 2j * np.pi * f * 60e-9
    task = FitTask(disk_build(10, 1, 7700), {"disk": (Sweep(f, wired * noise),)})
    found = disk_beside(task, 1.0, lambda _: None, 1, 1.0)
    assert [one.effect.name for one in found.beside] == ["lead-inductance", "leakage"]
