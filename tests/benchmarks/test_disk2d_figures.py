"""The disk in two dimensions: what a curve costs and how exact it is, and which constants recordings give back."""

import time

import numpy as np
import pytest

from pzctl.fitters.disk2d import Disk2DFitter
from pzctl.fitters.disk2d_cache import reduced_disk
from pzctl.fitters.interface import FitTask
from pzctl.models.build import Build, LayerSpec, Load, Quantity, Step
from pzctl.models.disk2d.capacitance import capacitance, slopes
from pzctl.models.disk2d.error import estimate
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.disk2d.model import Disk2D
from pzctl.models.disk2d.training import sampled, trained
from pzctl.models.passivity import is_passive
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep
from pzctl.models.tensor import Tensor6mm

pytestmark = pytest.mark.timeout(3600)
DENSITY, THICKNESS = 7700.0, 2e-3


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
        errors.append(np.abs(capacitance(reduced, shape, c, f)[some] / true - 1).max())
        said.append(estimate(full, reduced, shape, c[some], f[some]).max())
    solution = least(lambda: full.solution(shape, c[400], float(f[400])), 5)
    curve = least(lambda: capacitance(reduced, shape, c, f), 3)
    both = least(lambda: slopes(reduced, shape, c, f), 3)
    print(
        f"\nD/t {ratio}: {full.size} unknowns reduced to {reduced.u.shape[1]} + {reduced.p.shape[1]}, {offline:.0f} s; "
        f"801 sparse solutions {801 * solution:.0f} s, curve {1e3 * curve:.0f} ms (1/{801 * solution / curve:.0f}), "
        f"with derivatives {both / curve:.2f} times; error to 1.5 f0 {max(errors):.1g}, estimate {max(said):.1g}"
    )
    assert max(said) < 6e-4  # of the basis; a fit enriches it where this is above 1e-4
    assert max(errors) < 3e-4  # ten losses that all differ are the hardest case for the last projection
    assert both < 4 * curve


def build(diameter, nominal):
    values = {name: Quantity(z.real, z.imag) for name in CONSTANTS for z in [complex(getattr(nominal, name))]}
    plate, radial = nominal.thickness, nominal.radial
    values |= {name: Quantity(z.real, z.imag) for name, z in (("c33D", plate.c33D), ("h33", plate.h33))}
    values |= {name: Quantity(z.real, z.imag) for name in ("s11E", "s12E") for z in [getattr(radial, name)]}
    values |= {"thickness": Quantity(THICKNESS), "density": Quantity(DENSITY)}
    air = Load("air", Quantity(0.0))
    layer = LayerSpec("disk", "piezo", values)
    area = Quantity(np.pi * diameter**2 / 4)
    return Build("D", area, (layer,), air, air, (Step("disk", ("disk",)),), Quantity(diameter))


def test_what_comes_back_of_twenty_random_ceramics():
    """D/t 8 to 20, noise 0.02 %, starts up to 15 % wrong; radial and thickness bands."""
    rng = np.random.default_rng(11)
    within, silent, seconds, missed = dict.fromkeys(CONSTANTS, 0), [], [], []
    told = dict.fromkeys(CONSTANTS, 0)
    for k in range(20):
        truth = lossy(rng)
        ratio = float(rng.choice([8, 10, 12.5, 16, 20]))
        # stiffnesses, piezoelectric constants and permittivities each wrong by their own factor: stable and passive
        s, e = 1 + rng.uniform(-0.15, 0.15, 2)
        factors = np.where(np.arange(10) < 5, s, np.where(np.arange(10) < 8, np.sqrt(s * e), e))
        nominal = Tensor6mm(*(factors * np.array([getattr(truth, name) for name in CONSTANTS])))
        diameter = ratio * THICKNESS
        _, reduced = reduced_disk(ratio, lambda _: None)
        fp, fr = truth.thickness.speed(DENSITY).real / (2 * THICKNESS), 2900 * 2.07 / (np.pi * diameter)
        f = np.concatenate([np.linspace(0.7 * fr, 3 * fr, 401), np.linspace(0.8 * fp, 1.15 * fp, 401)])
        law = CausalConstantQ(float(np.sqrt(f[0] * f[-1])))
        area = np.pi * diameter**2 / 4
        Z = Disk2D("disk", truth, area, THICKNESS, DENSITY, reduced, law).impedance(f)
        noise = 2e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        result = Disk2DFitter().fit(FitTask(build(diameter, nominal), {"disk": (Sweep(f, Z * np.exp(noise)),)}))
        seconds.append(result.seconds)
        worst = 0.0
        for name in CONSTANTS:
            found, true = result.constants[f"disk.{name}"], complex(getattr(truth, name))
            off = max(abs(found.re - true.real) / found.u_re, abs(found.im - true.imag) / found.u_im)
            worst = max(worst, off)
            within[name] += off < 3
            told[name] += found.u_re < 0.02 * abs(true.real)
        if worst > 3:
            missed.append((k, ratio, round(worst, 1), result.rms_log_error))
            if result.rms_log_error < 1e-3:
                silent.append(k)
        print(
            f"\n{k}: D/t {ratio:g}, rms {result.rms_log_error:.2g}, worst {worst:.1f} sigma, {result.seconds:.0f} s",
            end="",
        )
    print(f"\nwithin 3 sigma of 20: {within}\nknown to 2 %: {told}\nmissed (disk, D/t, sigma, rms): {missed}")
    print(f"seconds a fit: median {np.median(seconds):.0f}, at most {max(seconds):.0f}; silently wrong: {silent}")
