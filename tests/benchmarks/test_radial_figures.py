"""The radial fitter on a real disk, with and without parts of its physics, and its intervals (`make bench`)."""

from collections import defaultdict
from dataclasses import replace

import numpy as np

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.disk.radial_coordinates import plate_blocks, radial_constants_block
from pzctl.fitters.engine.descent import descend
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.parameters.coordinates import Coordinates
from pzctl.fitters.engine.recording import Recording
from pzctl.fitters.interface import FitTask
from pzctl.models.constants.piezo_constants import Radial
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL, find
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep

BUILD = """
name = "D"
diameter_mm = {{ value = {diameter}, u = 0.01 }}
[[layers]]
name = "disk"
kind = "piezo"
material = "PZT-5A"
thickness_mm = {{ value = {thickness}, u = 0.001 }}
density_kg_m3 = {{ value = {density}, u = 10 }}
{more}
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
"""
KNOWN = """s11E_1e-12_m2_N = { re = 17.5, im = -0.3, u = 1.0 }
s12E_1e-12_m2_N = { re = -6.2, im = 0.15, u = 0.5 }
d31_pC_N = { re = -220, im = 5, u = 10 }
eps33T_r = { re = 3000, im = -60, u = 150 }"""
DRAWS = 100


def test_the_real_disk_with_and_without_each_part_of_the_physics(recordings):
    sweeps = tuple(read_recording(recordings / "disk-35x2" / f"radial-mode-{k}.csv") for k in (1, 2))
    v = find("Li 2021 disk").values
    constants = Radial(*(v[name].value for name in ("s11E", "s12E", "d31", "eps33T")))
    thin = RadialDisk.of("disk", constants, np.pi * 17.5e-3**2, 2e-3, v["density"].re)
    law = CausalConstantQ(55.6e3)
    causal = replace(thin, arm=replace(thin.arm, laws=dict.fromkeys(("s11E", "s12E", "d31"), law)), eps_law=law)
    usual = {"disk.alpha": 0.75, "disk.d33f": 1.3e-10}
    block = radial_constants_block("disk")
    print("\ndisk-35x2, both radial modes; rms of Re and Im of ln(Z_model/Z) each, without priors")
    for name, model, freed in (
        ("thin disk, constant losses", thin, ()),
        ("thin disk, causal losses", causal, ()),
        ("finite thickness, constant losses", thin.replace(usual), ()),
        ("finite thickness and causal losses", causal.replace(usual), ()),
        ("the same, alpha free", causal.replace(usual), ("disk.alpha",)),
        ("the same, alpha and d33f free", causal.replace(usual), ("disk.alpha", "disk.d33f")),
    ):
        coordinates = Coordinates((block, *plate_blocks("disk")), model.parameters(), (*block.coordinates, *freed))
        objective = Objective(
            [Recording("", sweep, model, np.full(sweep.frequency.size, 1e-3)) for sweep in sweeps], coordinates, ()
        )
        ratios = np.concatenate(objective.log_ratios(descend(objective, coordinates.x).x))
        print(f"  {name:36} {100 * np.sqrt(np.mean(np.abs(ratios) ** 2) / 2):.3f} %")
    build = parse_build(BUILD.format(diameter=35, thickness=2, density=7743, more=""))
    result = RadialLeastSquares().fit(FitTask(build, {"disk": sweeps}))
    per_part = result.rms_log_error / np.sqrt(2)
    print(f"  fitter `radial`: {100 * per_part:.3f} % ({100 * result.rms_log_error:.3f} % as |ln|)")
    assert per_part <= 0.0045


def test_intervals_over_noise_and_sizes():
    build = parse_build(BUILD.format(diameter=10, thickness=0.5, density=7800, more=KNOWN))
    law, f = CausalConstantQ(197.26e3), np.arange(120e3, 650e3, 1e3)
    pulls = defaultdict(list)
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        diameter, thickness, density = rng.normal((10e-3, 0.5e-3, 7800), (1e-5, 1e-6, 10))
        thin = RadialDisk.of("disk", SHERRIT_RADIAL, np.pi / 4 * diameter**2, thickness, density)
        arm = replace(
            thin.arm, alpha=rng.normal(0.68, 0.09), d33f=1.42e-10, laws=dict.fromkeys(("s11E", "s12E", "d31"), law)
        )
        noise = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
        sweep = Sweep(f, replace(thin, arm=arm, eps_law=law).impedance(f) * np.exp(2e-4 * noise))
        found = RadialLeastSquares().fit(FitTask(build, {"disk": (sweep,)})).constants
        for name in ("s11E", "s12E", "d31", "eps33T"):
            c, truth = found[f"disk.{name}"], getattr(SHERRIT_RADIAL, name)
            pulls[f"{name}.re"].append((c.re - truth.real) / c.u_re)
            pulls[f"{name}.im"].append((c.im - truth.imag) / c.u_im)
    print(f"\nradial, {DRAWS} draws of noise (2e-4), sizes and alpha: error over stated uncertainty")
    for name, values in pulls.items():
        inside = np.mean(np.abs(values) < 1.96)
        print(f"  {name:10} rms {np.sqrt(np.mean(np.square(values))):.2f}, within 95 % intervals {100 * inside:.0f} %")
        assert np.max(np.abs(values)) < 5, name
