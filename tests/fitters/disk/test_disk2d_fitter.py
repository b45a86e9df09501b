"""Fitter disk2d: a known disk, a real recording, and refusals."""

import os

import complex_ceramic
import numpy as np
import pytest
from budget_sums import assert_the_budget_adds_up
from disk_build import disk_build

from pzctl.fitters.disk.bare_disk import bare_disk
from pzctl.fitters.disk.two_d.disk2d import Disk2DFitter
from pzctl.fitters.disk.two_d.disk_fit import FittedDisk
from pzctl.fitters.disk.two_d.disk_under_diagnosis import plate_of
from pzctl.fitters.disk.two_d.reduced_disk_cache import reduced_disk
from pzctl.fitters.disk.two_d.tensor_coordinates import COORDINATES, tensor_block
from pzctl.fitters.disk.two_d.tensor_start import expected
from pzctl.fitters.engine.descent import Descent
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.parameters.coordinates import Coordinates, positive
from pzctl.fitters.interface import FitError, FitTask
from pzctl.models.build import LayerSpec
from pzctl.models.constants.passivity import passivity_margin
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.effects.base.scale import resonance
from pzctl.models.materials import find
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep

TRUTH = complex_ceramic.TENSOR


pytestmark = pytest.mark.usefixtures("own_cache")


def test_coordinates_give_passive_constants_and_their_derivatives():
    block = tensor_block("disk")
    values = np.array([part for name in CONSTANTS for z in [getattr(TRUTH, name)] for part in (z.real, z.imag)])
    x = block.inverse(values)
    made, J = block.forward(x)
    np.testing.assert_allclose(made, values, rtol=1e-9)
    for k in range(len(COORDINATES)):
        step = np.zeros_like(x)
        step[k] = 1e-6
        slope = (block.forward(x + step)[0] - block.forward(x - step)[0]) / 2e-6
        np.testing.assert_allclose(J[:, k], slope, rtol=1e-5, atol=1e-7 * np.abs(slope).max())
    far = block.forward(x + np.random.default_rng(0).normal(0, 0.5, x.size))[0].reshape(-1, 2)
    assert passivity_margin(Tensor6mm(*(complex(re, im) for re, im in far)).law) > -1e-9
    x[[3, 4]] = -600.0  # shear, which a wide thin disk does not feel
    away = block.forward(x)[0].reshape(-1, 2)
    assert np.isfinite(passivity_margin(Tensor6mm(*(complex(re, im) for re, im in away)).law))


def test_the_reduced_disk_is_cached_and_a_damaged_file_is_rebuilt(tmp_path):
    _, first = reduced_disk(4.0, lambda _: None)
    (file,) = (tmp_path.parent / os.environ["PZCTL_HOME"] / "cache").glob("disk2d-*.npz")
    said = []
    _, again = reduced_disk(4.0, said.append)
    assert not said
    np.testing.assert_array_equal(first.stiffness, again.stiffness)
    file.write_bytes(file.read_bytes()[:1000])
    _, third = reduced_disk(4.0, said.append)
    assert len(said) > 1
    assert third.stiffness.shape == first.stiffness.shape


@pytest.mark.long
def test_a_known_disk_is_recovered_and_undetermined_constants_are_listed():
    diameter, thickness, density = 10e-3, 1e-3, 7700.0
    _, reduced = reduced_disk(10.0, lambda _: None)
    area = np.pi * diameter**2 / 4
    f = np.concatenate([np.linspace(0.15e6, 0.6e6, 101), np.linspace(1.6e6, 2.6e6, 101)])
    resonance = float(np.sqrt(TRUTH.thickness.c33D.real / density)) / (2 * thickness)
    disk = Disk2D("disk", TRUTH, area, thickness, density, reduced, CausalConstantQ(resonance))
    rng = np.random.default_rng(1)
    noise = 2e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
    sweep = Sweep(f, disk.impedance(f) * np.exp(noise))
    result = Disk2DFitter().fit(FitTask(disk_build(10, 1, 7700), {"disk": (sweep,)}))
    assert_the_budget_adds_up(result)
    assert result.converged
    assert result.rms_log_error < 4e-4
    for name in CONSTANTS:
        true, found = complex(getattr(TRUTH, name)), result.constants[f"disk.{name}"]
        assert abs(found.re - true.real) < 4 * found.u_re, name
        assert abs(found.im - true.imag) < 4 * found.u_im, name
    assert result.constants["disk.c33E"].u_re < 1e-3 * TRUTH.c33E.real
    assert not any("only together" in sentence or "Unusually far" in sentence for sentence in result.says)
    (low,) = (c for name, c in result.derived.items() if "capacitance_at_113.1_kHz" in name)
    true = 1 / (2j * np.pi * 113137.085 * disk.impedance(np.array([113137.085]))[0])
    assert abs(low.re - true.real) < 4 * low.u_re
    from scipy.signal import find_peaks  # imported late: it takes half a second, in every process of a test run

    # between the two bands, without recorded points
    between = np.linspace(0.65e6, 1.55e6, 9001)
    Z = disk.impedance(between)
    for kind, curve in (("fs", (1 / Z).real), ("fp", Z.real)):
        true = between[find_peaks(np.log(curve), prominence=0.02)[0]]
        told = [c for name, c in result.derived.items() if name.startswith(f"disk.{kind}") and c.unit == "Hz"]
        assert len(true) > 5
        for f in true:
            nearest = min(told, key=lambda c: abs(c.re - f))
            assert abs(nearest.re - f) < 4 * nearest.u_re + 60, kind


def test_effects_beside_a_disk_refer_to_the_resonance_of_its_fitted_constants():
    # losses that go as a power of frequency were told at the resonance of the library's ceramic, up to 4 % off
    f = np.linspace(1.6e6, 2.6e6, 101)
    task = FitTask(disk_build(10, 1, 7700), {"disk": (Sweep(f, 1 / (2j * np.pi * f * 6e-10)),)})
    disk, softer = bare_disk(task, "disk2d", round_one=True, frees=True), 0.9
    values = {"area": np.pi * 25e-6, "disk.thickness": 1.01e-3, "disk.density": 7750.0}
    values |= {
        f"disk.{name}.{part}": number * (softer if name[0] == "c" else softer**0.5 if name[:3] != "eps" else 1.0)
        for name in CONSTANTS
        for z in [complex(getattr(TRUTH, name))]
        for part, number in (("re", z.real), ("im", z.imag))
    }
    blocks = (tensor_block("disk"), *(positive(name) for name in ("area", "disk.thickness", "disk.density")))
    coordinates = Coordinates(blocks, values, tuple(f"disk.{name}" for name in COORDINATES))
    at = Descent(Objective([], coordinates, ()), coordinates.x, coordinates.x, 0.0, True, 1)
    _, reduced = reduced_disk(4.0, lambda _: None)
    model = Disk2D("disk", TRUTH, values["area"], 1e-3, 7700.0, reduced)
    plate = plate_of(FittedDisk(disk, model, at, 0.0, 1.0))
    stiffness = softer * TRUTH.thickness.c33D.real
    assert resonance(plate) == pytest.approx(np.sqrt(stiffness / 7750.0) / 2.02e-3, rel=1e-9)
    assert plate.layers[0].eps33S == pytest.approx(TRUTH.eps33S, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (disk_build(100, 0.5, 7700), "covers diameter/thickness"),
        (disk_build(20, 1.9, 7700), "reaches up to"),
        (disk_build(20, 1.9, 7700, more="electrode_diameter_mm = 20.5"), "is 20.5; `disk2d` covers 10 to 20"),
        (disk_build(20, 1.9, 7700, more="electrode_diameter_mm = { value = 19, u = 0.1 }"), "takes it as exact"),
    ],
)
def test_disks_and_recordings_out_of_reach_are_refused(given, says):
    f = np.linspace(5e6, 6e6, 30)
    C = 8e-9 * given.area.re / given.layers[0].values["thickness"].re
    with pytest.raises(FitError, match=says):
        Disk2DFitter().fit(FitTask(given, {"disk": (Sweep(f, 1 / (2j * np.pi * f * C)),)}))


def test_a_material_known_in_thickness_alone_is_expected_to_have_its_own_axial_constants():
    alone, whole = (expected(LayerSpec("disk", "piezo", find(name).values)) for name in ("PZT-5H", "PZT-5A"))
    soft = find("PZT-5H").values
    assert alone["e33"] == pytest.approx(soft["h33"].re * soft["eps33S"].re)
    assert alone["c33E"] == pytest.approx(soft["c33D"].re - soft["h33"].re * alone["e33"])
    # what it shares with other ceramics are the ratios to these
    assert alone["e15"] / alone["e33"] == pytest.approx(whole["e15"] / whole["e33"], rel=0.3)
