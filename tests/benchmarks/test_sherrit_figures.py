"""How well Sherrit's methods recover constants from computed spectra at usual spacings (`make bench`)."""

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.disk.sherrit_radial import SherritRadial
from pzctl.fitters.disk.sherrit_thickness import SherritThickness
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL
from pzctl.models.sweep import Sweep

BUILD = """
name = "D"
diameter_mm = {diameter}
[[layers]]
name = "disk"
kind = "piezo"
material = "{material}"
thickness_mm = {thickness}
density_kg_m3 = 7800
[load]
back = "vacuum"
front = "vacuum"
[[steps]]
name = "disk"
layers = ["disk"]
"""
DRAWS = 40


def recorded(model, f, noise, seed):
    rng = np.random.default_rng(seed)
    both = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
    return Sweep(f, model.impedance(f) * np.exp(noise * both))


def table(fitter, build, model, f, truth, noise):
    """Print the worst relative error of real and imaginary part over the draws; return the worst of each."""
    errors = {name: [] for name in truth}
    for seed in range(DRAWS):
        found = fitter.fit(FitTask(build, {"disk": (recorded(model, f, noise, seed),)})).constants
        for name, value in truth.items():
            c = found[f"disk.{name}"]
            errors[name].append((abs(c.re / value.real - 1), abs(c.im / value.imag - 1)))
    worst = {name: np.max(rows, axis=0) for name, rows in errors.items()}
    for name, (re, im) in worst.items():
        rms_re, rms_im = np.sqrt(np.mean(np.square(errors[name]), axis=0))
        print(f"  {name:8} re: rms {100 * rms_re:.3f} %, worst {100 * re:.3f} %;"
              f"  im: rms {100 * rms_im:.2f} %, worst {100 * im:.2f} %")  # fmt: skip
    return np.max(list(worst.values()), axis=0)


@pytest.mark.parametrize("noise", [1e-6, 1e-4, 3e-4, 1e-3])
def test_table_a1(noise):
    build = parse_build(BUILD.format(diameter=10, thickness=0.5, material="PZT-5A"))
    model = RadialDisk.of("disk", SHERRIT_RADIAL, build.area.re, 0.5e-3, 7800.0)
    truth = {name: getattr(SHERRIT_RADIAL, name) for name in ("s11E", "s12E", "d31", "eps33T")}
    print(f"\nsherrit-radial, table A.1 at 200 Hz, noise {noise:g}, {DRAWS} draws")
    re, im = table(SherritRadial(), build, model, np.arange(100e3, 700e3, 200.0), truth, noise)
    assert noise > 1e-4 or (re <= 0.002 and im <= 0.02)


@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-3])
def test_thickness_mode(noise):
    build = parse_build(BUILD.format(diameter=16, thickness=0.512, material="Pz27"))
    model = stack_of(build, build.steps[0])
    v = build.layer("disk").values
    truth = {name: v[name].value for name in ("c33D", "eps33S")}
    print(f"\nsherrit-thickness, Pz27 (Q 80) at 2.5 kHz, noise {noise:g}, {DRAWS} draws")
    table(SherritThickness(), build, model, np.arange(2e6, 10e6, 2.5e3), truth, noise)
