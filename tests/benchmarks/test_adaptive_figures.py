"""Constants of both modes from 801 fixed points, and from an adaptive sweep of the same duration (`make bench`)."""

import re

import numpy as np

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.drivers.planning.adaptive import adapted
from pzctl.fitters.disk.disk_fitter import DiskFitter
from pzctl.fitters.interface import FitError, FitTask
from pzctl.models.constants.causal import continued
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.bench.sample import RADIAL_REFERENCE
from pzctl.sim.server import SimOptions, running

SEEDS = range(8)
LINEAR = SweepPlan((Segment(50e3, 8e6, 801),))
LOG = SweepPlan((Segment(50e3, 8e6, 801, "log"),))
SECONDS = CAPABILITIES.seconds(LOG)
NAMES = ("s11E", "sigma_p", "c33D", "s11E''", "c33D''")

BUILD = """
name = "D"
diameter_mm = 16.0
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = {thickness!r}
density_kg_m3 = {density!r}
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
"""


def truth_at(sample, says):
    """The true constants at the fitter's reference frequencies."""
    radial, thickness = re.search(r"at ([\d.]+) kHz.* at ([\d.]+) MHz", says).groups()
    disk = sample.layers[0]
    fp = np.sqrt(disk.c33D.real / disk.density) / (2 * disk.thickness)

    def at(reference, value, frequency):
        return complex(continued(CausalConstantQ(reference), value, np.array([frequency]))[0][0])

    s11, s12 = (at(RADIAL_REFERENCE, v, 1e3 * float(radial)) for v in (sample.radial.s11E, sample.radial.s12E))
    c33 = at(fp, disk.c33D, 1e6 * float(thickness))
    return {"s11E": s11, "sigma_p": -s12 / s11, "c33D": c33}


def errors(sample, sweeps):
    """Errors of the five constants, and the fitter's uncertainties; relative."""
    disk = sample.layers[0]
    build = parse_build(BUILD.format(thickness=1e3 * disk.thickness, density=disk.density))
    result = DiskFitter().fit(FitTask(build, {"disk": sweeps}))
    found, rows = result.constants | result.derived, []
    for name, true in truth_at(sample, result.says[0]).items():
        c = found[f"disk.{name}"]
        rows.append((name, c.re / true.real - 1, c.u_re / abs(c.re)))
        rows.append((name + "''", c.im / true.imag - 1, c.u_im / abs(c.im)))
    return {name: (error, u) for name, error, u in rows if name in NAMES}


def recordings(sim):
    """Errors of both ways of measuring the disk on the bench."""
    analyzer = open_analyzer(sim.resource)
    found = adapted(LOG, SECONDS, analyzer.measure, CAPABILITIES)
    ways = {
        "801 linear": analyzer.measure(LINEAR),
        "801 log": analyzer.measure(LOG),
        "adaptive": analyzer.measure(found.plan),
    }
    analyzer.close()
    (sweep,) = ways["adaptive"]
    return ways, found, sweep.frequency.size


def test_adaptive_compared_with_fixed_points():
    told = {way: [] for way in ("801 linear", "801 log", "adaptive")}
    print(f"\n50 kHz to 8 MHz, {SECONDS:.0f} s in all (looks included), bandwidth 5, {len(SEEDS)} disks")
    for seed in SEEDS:
        with running(SimOptions(port=0, bench_port=0, time_scale=0.0, radial=True, seed=seed)) as sim:
            ways, found, points = recordings(sim)
            sample = sim.instrument.sweeper.bench.sample
        kept, left = len(found.resonances), len(found.left_out)
        segments = len(found.plan.segments)
        print(f"disk {seed}: {points} points in {segments} segments; {kept} resonances served, {left} left")
        for way, sweeps in ways.items():
            try:
                told[way].append(errors(sample, sweeps))
            except FitError as error:
                print(f"disk {seed}, {way}: {error}")
    print(f"{'rms error, ppm':16}" + "".join(f"{name:>10}" for name in NAMES))
    for way, rows in told.items():
        size = [1e6 * np.sqrt(np.mean([row[name][0] ** 2 for row in rows])) for name in NAMES]
        print(f"{way:16}" + "".join(f"{value:10.2f}" for value in size) + f"   ({len(rows)} fits)")
    print(f"{'stated u, ppm':16}" + "".join(f"{name:>10}" for name in NAMES))
    for way, rows in told.items():
        size = [1e6 * np.mean([row[name][1] for row in rows]) for name in NAMES]
        print(f"{way:16}" + "".join(f"{value:10.2f}" for value in size))
