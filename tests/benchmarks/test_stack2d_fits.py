"""Fitter stack2d on glued disks by general finite elements, beside mason on the same recordings.

`python tests/benchmarks/test_stack2d_fits.py results.jsonl [SEED ...]` runs further disks, and resumes.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from complex_ceramic import TENSOR
from stack_skfem import FeLayer, SkfemStack

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.interface import FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.layered.two_d.stack2d import Stack2DFitter
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.sweep import Sweep

BUILD = """
name = "glued"
diameter_mm = {diameter:.6f}
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27 Bergen"
thickness_mm = {{ value = 1.0, u = 0.002 }}
[[layers]]
name = "glue1"
kind = "elastic"
material = "epoxy"
thickness_mm = {{ value = 0.020, u = 0.008 }}
[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = {{ value = 10.3, u = 0.5 }}
c_m_s = {{ value = 2455, u = 150 }}
q = {{ value = 60, u = 30 }}
thickness_mm = {{ value = 0.28, u = 0.004 }}
[load]
back = "vacuum"
front = "vacuum"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ml1"
layers = ["disk", "glue1", "ml1"]
"""
F = np.linspace(1.0e6, 2.8e6, 241)
NOISE = 5e-4
MASON = ("disk.c33D", "disk.h33", "disk.eps33S", "glue1.compliance", "ml1.z", "ml1.delay")
"""Constants that both fitters determine."""


def drawn(seed):
    """Return diameter over thickness, and every true constant by name: each of the ten 3 to 8 % off the library's."""
    rng = np.random.default_rng(seed)
    off = 1 + rng.uniform(0.03, 0.08, 10) * rng.choice([-1, 1], 10)
    values = {f"disk.{name}": complex(getattr(TENSOR, name)) * part for name, part in zip(CONSTANTS, off, strict=True)}
    values |= {"disk.thickness": 1e-3 * (1 + 0.002 * rng.normal()), "disk.density": 7700 * (1 + 0.005 * rng.normal())}
    values |= {"glue1.thickness": rng.uniform(12e-6, 28e-6), "glue1.z": 2.42e6 * (1 + 0.05 * rng.normal())}
    values |= {"glue1.c": 2200 * (1 + 0.05 * rng.normal()), "glue1.q": rng.uniform(8, 15)}
    values |= {"ml1.thickness": 0.28e-3 * (1 + 0.01 * rng.normal()), "ml1.z": 10.3e6 * (1 + 0.04 * rng.normal())}
    values |= {"ml1.c": 2455 * (1 + 0.05 * rng.normal()), "ml1.q": rng.uniform(40, 80)}
    values |= {"glue1.poisson": rng.uniform(0.33, 0.40), "ml1.poisson": rng.uniform(0.29, 0.37)}
    return float(rng.uniform(8, 16)), values


def recorded(ratio, values, seed):
    """Return the recordings of both steps, computed by finite elements."""
    ten = tuple(values[f"disk.{name}"] for name in CONSTANTS)
    layers = [FeLayer(values["disk.thickness"], values["disk.density"], ten, 4)]
    for name, cells in (("glue1", 1), ("ml1", 2)):
        own = (values[f"{name}.{key}"] for key in ("thickness", "z", "c", "q", "poisson"))
        layers.append(FeLayer.isotropic(*own, cells=cells))
    rng, sweeps = np.random.default_rng(seed + 1000), {}
    for step, there in (("disk", layers[:1]), ("ml1", layers)):
        Z = SkfemStack(ratio * 0.5e-3, there, per_thickness=4).impedance(F)
        noise = NOISE * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
        sweeps[step] = (Sweep(F, Z * np.exp(noise)),)
    return sweeps


def plate(values):
    """Return the true constants with those of one dimension."""
    e, eps, c = (values[f"disk.{name}"] for name in ("e33", "eps33S", "c33E"))
    thin = {"disk.c33D": c + e**2 / eps, "disk.h33": e / eps}
    thin["glue1.compliance"] = values["glue1.thickness"] / (values["glue1.z"] * values["glue1.c"])
    thin["ml1.delay"] = values["ml1.thickness"] / values["ml1.c"]
    return values | thin


def judged(result, truth):
    """Return misfit, error (relative) and error in uncertainties of each constant."""
    found = {**result.constants, **result.derived}
    errors = {}
    for name, true in plate(truth).items():
        if name not in found or not found[name].u_re:
            continue
        one, off = found[name], complex(found[name].re, found[name].im) - true
        errors[name] = [off.real / abs(true), off.real / one.u_re]
        if one.u_im:
            errors[f"{name}''"] = [off.imag / abs(true), off.imag / one.u_im]
    return {"chi2": result.chi2_per_dof, "rms": result.rms_log_error, "converged": result.converged, "errors": errors}


def case(seed):
    """Return both fitters' results of one disk."""
    ratio, truth = drawn(seed)
    sweeps = recorded(ratio, truth, seed)
    build = parse_build(BUILD.format(diameter=ratio), "build.toml")
    made = {"seed": seed, "ratio": ratio}
    for fitter in (Mason(), Stack2DFitter()):
        began = time.process_time()
        result = fitter.fit(FitTask(build, sweeps))
        made[fitter.name] = {"seconds": time.process_time() - began, **judged(result, truth)}
    return made


def told(one):
    """Return a line on a case."""
    both = one["mason"]["errors"], one["stack2d"]["errors"]
    parts = ", ".join(f"{name} {100 * both[0][name][0]:+.1f} / {100 * both[1][name][0]:+.2f} %" for name in MASON)
    in_u = {name: u for name, (_, u) in both[1].items()}
    worst = max(in_u, key=lambda name: abs(in_u[name]))
    within = np.mean([abs(u) < 2 for u in in_u.values()])
    return (
        f"seed {one['seed']}, D/t {one['ratio']:.1f}: rms {one['mason']['rms']:.3f} / {one['stack2d']['rms']:.5f}, "
        f"chi2 {one['stack2d']['chi2']:.2f}, {one['stack2d']['seconds']:.0f} s; mason / stack2d: {parts}; "
        f"worst {worst} {in_u[worst]:+.1f} u, within 2 u {100 * within:.0f} %"
    )


@pytest.mark.timeout(600)
def test_a_glued_disk_by_finite_elements_is_recovered(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    one = case(1)
    with capsys.disabled():
        print(told(one))
    assert one["stack2d"]["chi2"] < 2
    for name in MASON:
        mason, stack = (abs(one[fitter]["errors"][name][0]) for fitter in ("mason", "stack2d"))
        assert stack < max(0.02, mason), name


if __name__ == "__main__":
    path = Path(sys.argv[1])
    done = {json.loads(line)["seed"] for line in path.read_text().splitlines()} if path.exists() else set()
    os.environ.setdefault("PZCTL_HOME", str(path.parent / "home"))
    for number in [int(text) for text in sys.argv[2:]] or range(1, 11):
        if number in done:
            continue
        line = case(number)
        with path.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(told(line), flush=True)
