"""The disk in two dimensions: cost and accuracy of a curve, and the constants that recordings determine.

PZCTL_DRAWS: how many random ceramics (20), some 40 s of processor time each.
"""

import os
import time

import numpy as np
import pytest
from disk_skfem import SkfemDisk
from passive_coordinates import is_passive

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.two_d.disk2d import Disk2DFitter
from pzctl.fitters.disk.two_d.reduced_disk_cache import reduced_disk
from pzctl.fitters.interface import FitTask
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.constants.causal import continued
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.capacitance import solved
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.error_estimate import estimate
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.disk2d.training import sampled, trained
from pzctl.models.materials import find
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep

pytestmark = pytest.mark.timeout(6 * 3600)  # twenty ceramics take a quarter of an hour of a free core, both bands twice
DENSITY, THICKNESS = 7700.0, 2e-3
DRAWS = int(os.environ.get("PZCTL_DRAWS", "20"))


def lossy(rng):
    while True:
        tan = np.where(np.arange(10) < 5, 1 / rng.uniform(60, 150, 10), np.where(np.arange(10) < 8, -0.003, -0.018))
        tensor = Tensor6mm(*(sampled(rng) * (1 + 1j * tan)))
        if is_passive(tensor.law):
            return tensor


def least(call, times):
    made = []
    for _ in range(times):
        began = time.process_time()
        call()
        made.append(time.process_time() - began)
    return min(made)


@pytest.mark.parametrize("ratio", [5, 10, 20, 40])
def test_a_curve_of_801_points_costs_1_300_of_801_sparse_solutions(ratio):
    began = time.process_time()
    full, reduced = FullDisk.of(ratio), trained(ratio)
    offline = time.process_time() - began
    shape, f = Shape(ratio * THICKNESS / 2, THICKNESS, DENSITY), np.linspace(5e4, 1.62e6, 801)
    rng, some = np.random.default_rng(8), slice(None, None, 40)
    errors, said = [], []
    for _ in range(5):
        tensor = lossy(rng)
        c = Disk2D("d", tensor, 1.0, 1.0, 1.0, reduced, CausalConstantQ(4e5)).over(f)
        true = full.capacitance(shape, c[some], f[some])
        errors.append(np.abs(solved(reduced, shape, c, f).capacitance[some] / true - 1).max())
        said.append(estimate(full, reduced, shape, c[some], f[some]).max())
    solution = least(lambda: full.solution(shape, c[400], float(f[400])), 5)
    rival = SkfemDisk(shape.radius, shape.thickness, 3)
    apart = np.abs(rival.capacitance(c[some], DENSITY, f[some]) / true - 1).max()
    other = least(lambda: rival.capacitance(c[400:401], DENSITY, f[400:401]), 3)
    curve = least(lambda: solved(reduced, shape, c, f).capacitance, 3)
    both = least(lambda: solved(reduced, shape, c, f).slopes, 3)
    print(
        f"\nD/t {ratio}: {full.size} unknowns reduced to {reduced.u.shape[1]} + {reduced.p.shape[1]}, {offline:.0f} s; "
        f"801 sparse solutions {801 * solution:.0f} s, curve {1e3 * curve:.0f} ms (1/{801 * solution / curve:.0f}), "
        f"with derivatives {both / curve:.2f} times; error to 1.5 f0 {max(errors):.1g}, estimate {max(said):.1g}; "
        f"scikit-fem, {rival.free.size} unknowns, {apart:.1g} apart: 801 solutions {801 * other:.0f} s "
        f"(1/{801 * other / curve:.0f})"
    )
    assert max(said) < 2e-4  # error of the basis; a fit enriches it where this is above 1e-4
    assert max(errors) < 1e-4  # ten different losses are the hardest case for the last projection
    assert both < 4 * curve


def build(diameter, nominal, density=DENSITY, thickness=THICKNESS):
    values = {name: Quantity(z.real, z.imag) for name in CONSTANTS for z in [complex(getattr(nominal, name))]}
    plate, radial = nominal.thickness, nominal.radial
    values |= {name: Quantity(z.real, z.imag) for name, z in (("c33D", plate.c33D), ("h33", plate.h33))}
    values |= {name: Quantity(z.real, z.imag) for name in ("s11E", "s12E") for z in [getattr(radial, name)]}
    values |= {"thickness": Quantity(thickness), "density": Quantity(density)}
    air = LoadSpec("air", Quantity(0.0))
    layer = LayerSpec("disk", "piezo", values)
    area = Quantity(np.pi * diameter**2 / 4)
    return Build("D", area, (layer,), air, air, (Step("disk", ("disk",)),), Quantity(diameter))


def deviations(result, truth):
    """Return the error of each real and imaginary part in its uncertainty."""
    made = {}
    for name in CONSTANTS:
        found, true = result.constants[f"disk.{name}"], complex(getattr(truth, name))
        made[f"{name}'"] = abs(found.re - true.real) / found.u_re
        made[f"{name}''"] = abs(found.im - true.imag) / found.u_im
    return made


@pytest.mark.parametrize("bands", ["radial and thickness", "thickness"])
def test_constants_of_twenty_random_ceramics_are_recovered(bands):
    """D/t 8 to 20, noise 0.02 %, starts up to 15 % wrong; the curves are by scikit-fem, independent of the fitter."""
    rng = np.random.default_rng(11)
    within, told = dict.fromkeys(CONSTANTS, 0), dict.fromkeys(CONSTANTS, 0)
    silent, seconds, missed, beyond, unsaid = [], [], [], 0, []
    for k in range(DRAWS):
        truth = lossy(rng)
        ratio = (8, 10, 12.5, 16, 20)[k % 5]
        # stiffnesses, piezoelectric constants and permittivities each scaled by one factor: stable and passive
        s, e = 1 + rng.uniform(-0.15, 0.15, 2)
        factors = np.where(np.arange(10) < 5, s, np.where(np.arange(10) < 8, np.sqrt(s * e), e))
        nominal = Tensor6mm(*(factors * np.array([getattr(truth, name) for name in CONSTANTS])))
        diameter = ratio * THICKNESS
        fp, fr = truth.thickness.speed(DENSITY).real / (2 * THICKNESS), 2900 * 2.07 / (np.pi * diameter)
        f = np.linspace(0.8 * fp, 1.15 * fp, 201)
        if bands != "thickness":
            f = np.concatenate([np.linspace(0.7 * fr, 3 * fr, 201), f])
        law = CausalConstantQ(float(np.sqrt(f[0] * f[-1])))
        over = np.array([continued(law, getattr(truth, name), f)[0] for name in CONSTANTS]).T
        Z = 1 / (2j * np.pi * f * SkfemDisk(diameter / 2, THICKNESS, 3).capacitance(over, DENSITY, f))
        noise = 2e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        result = Disk2DFitter().fit(FitTask(build(diameter, nominal), {"disk": (Sweep(f, Z * np.exp(noise)),)}))
        seconds.append(result.seconds)
        off = deviations(result, truth)
        beyond += sum(value > 3 for value in off.values())
        for name in CONSTANTS:
            within[name] += max(off[f"{name}'"], off[f"{name}''"]) < 3
            told[name] += result.constants[f"disk.{name}"].u_re < 0.02 * abs(getattr(truth, name).real)
            vague = result.constants[f"disk.{name}"].u_re > 0.05 * abs(getattr(truth, name).real)
            if vague and not any(f"disk.{name}" in sentence for sentence in result.says):
                unsaid.append((k, name))
        worst = max(off, key=off.get)
        if off[worst] > 3:
            missed.append((k, ratio, worst, round(off[worst], 1), float(f"{result.rms_log_error:.2g}")))
            if off[worst] > 5 and result.rms_log_error < 1e-3:
                silent.append(k)
        print(
            f"\n{k}: D/t {ratio:g}, rms {result.rms_log_error:.2g}, worst {worst} {off[worst]:.1f} sigma, "
            f"{result.seconds:.0f} s; " + " ".join(said for said in result.says if "determine" in said),
            end="",
            flush=True,
        )
    print(f"\nwithin 3 sigma of {DRAWS}: {within}\nknown to 2 %: {told}")
    print(f"beyond 3 sigma: {beyond} of {20 * DRAWS} numbers; worst of a disk (D/t, number, sigma, rms): {missed}")
    print(f"unknown to 5 % and not said: {unsaid}; silently wrong (5 sigma, rms 0.1 %): {silent}")
    print(f"seconds a fit: median {np.median(seconds):.0f}, at most {max(seconds):.0f}")
    assert not silent


def test_possible_causes_of_the_residual_in_the_radial_modes_of_the_disk_of_35_by_2_mm(recordings):
    """The reduction of the misfit by one further cause, to first order; constants move within the range of PZT."""
    sweeps = [read_recording(recordings / "disk-35x2" / f"radial-mode-{k}.csv") for k in (1, 2)]
    nominal = Tensor6mm(*(find("PZT-5A").values[name].value for name in CONSTANTS))
    given = build(35e-3, nominal, 7743.0)
    result = Disk2DFitter().fit(FitTask(given, {"disk": tuple(sweeps)}))
    tensor = Tensor6mm(*(complex(c.re, c.im) for c in (result.constants[f"disk.{name}"] for name in CONSTANTS)))
    f, Z = (np.concatenate([getattr(s, part) for s in sweeps]) for part in ("frequency", "impedance"))
    law = CausalConstantQ(float(np.sqrt(f[0] * f[-1])))
    disk = Disk2D("disk", tensor, given.area.re, THICKNESS, 7743.0, reduced_disk(17.5, lambda _: None)[1], law)
    names = [f"disk.{name}.{part}" for name in CONSTANTS for part in ("re", "im")]
    model, J = disk.jacobian(f, names)
    ratio = np.log(model / Z)
    real = np.array([abs(getattr(tensor, name).real) for name in CONSTANTS])
    widths = np.column_stack([0.15 * real, 0.01 * real]).ravel()

    over, by = disk.over(f), solved(disk.reduced, disk.shape, disk.over(f), f).slopes
    radial = tensor.radial
    softer = over.copy()  # stiffness at constant field falls, d and the free permittivity stay
    softer[:, 8], softer[:, 9] = 0.0, over[:, 9] - radial.eps33T
    soft = (by.by_constant * softer).sum(axis=1) / by.capacitance
    strain = np.abs(1 / (2j * np.pi * f * Z) - radial.eps33p * disk.area / THICKNESS)
    log_f = np.log(f / 1e5)
    causes = {"nothing": [], "inductance and resistance": [2j * np.pi * f / Z, 1 / Z]}
    causes |= {"capacitance and conductance": [2j * np.pi * f * Z, Z], "gain and delay": [1 + 0j * f, 1j * log_f]}
    for source in (0, 25, 50, 100):  # ohm; 25 is that of the analyzer
        at = strain * np.abs(Z / (Z + source))
        loop = soft * at / at.max()
        causes[f"Rayleigh softening, source of {source} ohm"] = [loop * (1 - 4j / (3 * np.pi))]
        causes[f"softening and loss by strain, source of {source} ohm"] = [loop, -1j * loop]
    for k, name in enumerate(CONSTANTS):
        part = -by.by_constant[:, k] * over[:, k] / by.capacitance * log_f
        causes[f"dispersion and loss dispersion of {name}"] = [part, 1j * part]

    def left(columns):
        """Return the misfit with these causes, and their strengths."""
        rows = np.vstack([J * widths[:, None] * 250, *(c[None] * 0.1 * 250 for c in columns)]).T
        known = np.eye(rows.shape[1])[: widths.size]
        A = np.vstack([rows.real, rows.imag, known])
        r = np.concatenate([ratio.real * 250, ratio.imag * 250, np.zeros(widths.size)])
        x = np.linalg.lstsq(A, -r, rcond=None)[0]
        after = (r + A @ x)[: 2 * f.size]
        return float(np.sqrt(np.sum(after**2) / f.size)) / 250, 0.1 * x[widths.size :]

    made = {name: left(columns) for name, columns in causes.items()}
    print(f"\nfitted: {100 * result.rms_log_error:.2f} %")
    for name, (rms, strengths) in sorted(made.items(), key=lambda one: one[1][0]):
        print(f"{100 * rms:.3f} % {name} " + " ".join(f"{s:.2g}" for s in strengths))
    best = made["Rayleigh softening, source of 25 ohm"]
    assert 0 < best[1][0] < 0.01
    assert best[0] < 0.8 * min(rms for name, (rms, _) in made.items() if "soft" not in name)
