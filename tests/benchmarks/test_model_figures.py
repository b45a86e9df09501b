"""Cost and accuracy of the models of single devices; run by `make bench`."""

import importlib.util
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from fixture_path import Fixture
from scipy.optimize import least_squares

from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.constants import sherrit
from pzctl.models.constants.piezo_constants import Radial, Thickness
from pzctl.models.disk.round_disk import BothModes, RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL, find
from pzctl.models.stack import VACUUM, CausalConstantQ, Piezo, Stack

AREA = np.pi * 5e-3**2


def seconds(call):
    times = []
    for _ in range(30):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def plate(Q=80.0, tan=0.017):
    truth = Thickness(1.5e11 * (1 + 1j / Q), 1.98e9, 8.1e-9 * (1 - 1j * tan))
    layer = Piezo("disk", 0.5e-3, 7800.0, truth.c33D, truth.h33, truth.eps33S)
    return Stack((layer,), VACUUM, VACUUM, AREA), truth


def test_value_and_jacobian_of_each_model():
    stack, _ = plate()
    radial = RadialDisk.of("disk", SHERRIT_RADIAL, AREA, 0.5e-3, 7800.0)
    lumped = Lumped(1e-9, tuple(Branch.from_resonance(4e6 + k * 1e5, 80, 1e-11) for k in range(4)))
    models = {
        "lumped, 4 branches": lumped,
        "radial disk": radial,
        "both modes": BothModes.of(stack, "disk", SHERRIT_RADIAL),
        "plate": stack,
        "plate in a fixture": Fixture(stack),
    }
    f = np.linspace(1e5, 1e7, 801)
    unit = seconds(lambda: np.exp(1j * f))
    print(f"\n801 points; one complex exp over them takes {unit * 1e6:.0f} us, which is the unit")
    for name, model in models.items():
        names = list(model.parameters())
        value = seconds(lambda model=model: model.impedance(f))
        full = seconds(lambda model=model, names=names: model.jacobian(f, names))
        print(
            f"{name:20s} {len(names):3d} parameters: value {value / unit:5.1f}, value and Jacobian {full / unit:6.1f} "
            f"({full / value:.1f} values)"
        )


def test_the_benefit_of_dividing_by_frequency_in_sherrits_method():
    print("\nerror of c33D', c33D'' and kt^2' from critical frequencies of wZ, Y/w and of Z, Y themselves")
    f = np.arange(3e6, 6e6, 50.0)
    for Q in (80, 20, 10):
        stack, truth = plate(Q, 0.012)
        Z = stack.impedance(f)
        w = 2 * np.pi * f
        above = 12e6, complex(stack.impedance(np.array([12e6]))[0])
        for name, shown in (("divided", Z), ("as they are", Z / w)):  # the functions multiply by w, which Z / w undoes
            fs, fp = sherrit.resonance_frequencies(f, shown), sherrit.antiresonance_frequencies(f, shown)
            found = sherrit.thickness_constants(fs.complex, fp.complex, 0.5e-3, 7800.0, above, AREA)
            errors = (
                found.c33D.real / truth.c33D.real - 1,
                found.c33D.imag / truth.c33D.imag - 1,
                (found.kt**2).real / (truth.kt**2).real - 1,
            )
            print(f"Q {Q:3d} {name:12s}", *(f"{error:+.1e}" for error in errors))


def test_the_accuracy_of_radial_models_for_a_disk_of_finite_thickness():
    path = Path(__file__).parents[1] / "models" / "disk2d" / "test_finite_disk.py"
    spec = importlib.util.spec_from_file_location("finite_disk", path)
    finite = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(finite)
    print("\nrms |ln(Z_model/Z)| against a direct solution in both dimensions, Pz27, 10 mm")
    for ratio in (10, 20, 40):
        thickness = 10e-3 / ratio
        fp = 4319 / (2 * thickness)
        bands = {"0.1-0.8 MHz": (1e5, 8e5, 14, 5), "0.1 MHz-0.5 fp": (1e5, 0.5 * fp, 20 + ratio, 5)}
        if ratio <= 20:
            bands["0.5-0.8 fp"] = (0.5 * fp, 0.8 * fp, 20 + 2 * ratio, 7)
            bands["0.8-1.2 fp"] = (0.8 * fp, 1.2 * fp, 20 + 2 * ratio, 7)
            bands["1.2-1.8 fp"] = (1.2 * fp, 1.8 * fp, 24 + 3 * ratio, 9)
        for band, (low, high, nr, nz) in bands.items():
            misfit = finite.misfits(thickness, np.linspace(low, high, 61), nr, nz)
            print(f"D/t {ratio} {band:15s}", *(f"{name} {size:.4f} " for name, size in misfit.items()))


def test_what_a_real_disk_says_about_finite_thickness_and_causality(recordings):
    tables = [np.loadtxt(recordings / "disk-35x2" / f"radial-mode-{k}.csv", delimiter=",", skiprows=1) for k in (1, 2)]
    f, size, degrees = np.concatenate(tables).T
    measured = size * np.exp(1j * np.deg2rad(degrees))
    area = np.pi * 17.5e-3**2
    values = find("Li 2021 disk").values
    start = Radial(*(values[key].value for key in ("s11E", "s12E", "d31", "eps33T")))
    disk = RadialDisk.of("disk", start, area, 2e-3, 14.8993e-3 / (area * 2e-3))
    law = CausalConstantQ(1e5)
    causal = RadialDisk(replace(disk.arm, laws=dict.fromkeys(("s11E", "s12E", "d31"), law)), disk.eps33T, law)
    print("\n35 mm x 2 mm, first and second radial mode, eight constants fitted: rms |ln(Z_model/Z)|")
    for alpha in (0.0, 0.66, 0.83):
        for name, model in (("constant losses", disk), ("causal losses", causal)):
            massive = model.replace({"disk.alpha": alpha, "disk.d33f": 1.4e-10 if alpha else 0.0})
            rms, sigma = fitted(massive, f, measured)
            print(f"alpha {alpha:.2f} {name:16s} {100 * rms:.2f} %, sigma_p' {sigma:.3f}")


def fitted(model, f, measured):
    names = [f"disk.{c}.{part}" for c in ("s11E", "s12E", "d31", "eps33T") for part in ("re", "im")]
    scale = np.array([abs(model.parameters()[name]) for name in names])
    begin = np.array([model.parameters()[name] for name in names]) / scale

    def at(x):
        return model.replace(dict(zip(names, x * scale, strict=True)))

    def residual(x):
        error = np.log(at(x).impedance(f) / measured)
        return np.concatenate([error.real, error.imag])

    def slopes(x):
        J = at(x).jacobian(f, names)[1] * scale[:, None]
        return np.concatenate([J.real, J.imag], axis=1).T

    found = least_squares(residual, begin, slopes, method="lm")
    return np.sqrt(2 * found.cost / f.size), at(found.x).radial.sigma_p.real
