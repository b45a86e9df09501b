"""Fitter `radial` on a real disk, on disks with known constants, and on unsuitable recordings."""

from dataclasses import replace

import numpy as np
import pytest
from budget_sums import assert_the_budget_adds_up

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL
from pzctl.models.stack import CausalConstantQ

REFERENCE = 197.26e3  # the first resonance, to which the fitter refers the constants
BAND = np.arange(120e3, 650e3, 1e3)
KNOWN = """s11E_1e-12_m2_N = { re = 17.5, im = -0.3, u = 1.0 }
s12E_1e-12_m2_N = { re = -6.2, im = 0.15, u = 0.5 }
d31_pC_N = { re = -220, im = 5, u = 10 }
eps33T_r = { re = 3000, im = -60, u = 150 }"""


def thick_disk(build, alpha=0.70, d33f=1.2e-10):
    """A disk of finite thickness with causal losses."""
    layer, law = build.layer("disk").values, CausalConstantQ(REFERENCE)
    thin = RadialDisk.of("disk", SHERRIT_RADIAL, build.area.re, layer["thickness"].re, layer["density"].re)
    arm = replace(thin.arm, alpha=alpha, d33f=d33f, laws=dict.fromkeys(("s11E", "s12E", "d31"), law))
    return replace(thin, arm=arm, eps_law=law)


def test_both_radial_modes_of_a_real_disk(disk_build, recordings):
    sweeps = tuple(read_recording(recordings / "disk-35x2" / f"radial-mode-{k}.csv") for k in (1, 2))
    results = [
        RadialLeastSquares().fit(
            FitTask(disk_build(material, (35.0, 2.0, 7743.0), (0.01, 0.005, 10.0)), {"disk": sweeps})
        )
        for material in ("PZT-5A", "Pz27")
    ]
    for result in results:
        per_part = result.rms_log_error / np.sqrt(2)  # of Re and Im together; the thin-disk model leaves 1.08 %
        assert per_part < 0.0045
        assert any(line.startswith("Passivity check passed: ") for line in result.says)
        assert any("does not describe this recording to its noise" in line for line in result.says)
    # the prior does not decide the answer
    for name in ("s11E", "s12E", "d31", "kp", "sigma_p"):
        one, two = (result.constants[f"disk.{name}"] for result in results)
        assert abs(one.re - two.re) < 2 * one.u_re, name


def test_constants_are_recovered_within_their_uncertainty(disk_build, swept):
    build = disk_build("PZT-5A", (10.0, 0.5, 7800.0), (0.0, 0.0, 0.0), KNOWN)
    result = RadialLeastSquares().fit(FitTask(build, {"disk": (swept(thick_disk(build), BAND, 2e-4),)}))
    assert 0.8 < result.chi2_per_dof < 1.2
    for name in ("s11E", "s12E", "d31", "eps33T"):
        truth, found = getattr(SHERRIT_RADIAL, name), result.constants[f"disk.{name}"]
        assert abs(found.re - truth.real) < 4 * found.u_re < 0.002 * abs(truth.real), name
        assert abs(found.im - truth.imag) < 4 * found.u_im, name
    assert result.constants["disk.alpha"].re == pytest.approx(0.70, abs=0.01)
    assert_the_budget_adds_up(result)
    assert result.budget is not None
    # the resonances tell density times compliance, so that what one is off by the other is, too
    compliance, density = result.constants["disk.s11E"].re, result.budget.tolerances["disk.density"]
    assert result.budget.re["disk.s11E"].largest[0] == "disk.density"
    assert result.budget.re["disk.s11E"].assumptions == pytest.approx(density / 7800.0 * compliance, rel=0.1)


def test_one_mode_is_enough_where_poissons_ratio_is_known(disk_build, swept):
    build = disk_build("PZT-5A", (10.0, 0.5, 7800.0), (0.0, 0.0, 0.0), KNOWN)
    sweep = swept(thick_disk(build), np.arange(120e3, 350e3, 500.0))
    found = RadialLeastSquares().fit(FitTask(build, {"disk": (sweep,)})).constants
    for name in ("s11E", "s12E"):
        assert abs(found[f"disk.{name}"].re - getattr(SHERRIT_RADIAL, name).real) < 3 * found[f"disk.{name}"].u_re
    unknown = disk_build("PZT-5A", (10.0, 0.5, 7800.0), (0.0, 0.0, 0.0), "s12E_1e-12_m2_N = -6.2")
    with pytest.raises(FitError, match="does not determine Poisson's ratio alone"):
        RadialLeastSquares().fit(FitTask(unknown, {"disk": (sweep,)}))


def test_held_constants_keep_their_values(disk_build, swept):
    build = disk_build("PZT-5A", (10.0, 0.5, 7800.0), (0.0, 0.0, 0.0), KNOWN)
    task = FitTask(
        build, {"disk": (swept(thick_disk(build), BAND),)}, ("disk.s11E", "disk.s12E", "disk.d31", "disk.eps33T")
    )
    alpha = RadialLeastSquares().fit(task).constants["disk.alpha"]
    assert (alpha.free, alpha.u_re) == (False, 0.0)
    with pytest.raises(FitError, match=r"cannot free 'disk\.c33D': `radial` has area, disk\.alpha"):
        RadialLeastSquares().fit(replace(task, free=("disk.c33D",)))


def test_a_recording_of_the_thickness_mode_is_refused(disk_build, swept):
    build = disk_build("PZT-5A", (10.0, 0.5, 7800.0))
    sweep = swept(thick_disk(build), np.linspace(1e6, 2e6, 401))
    with pytest.raises(FitError, match=r"no radial resonance in 1000-2000 kHz: the first is expected near .* 10 mm"):
        RadialLeastSquares().fit(FitTask(build, {"disk": (sweep,)}))


def test_radial_modes_and_a_wrong_diameter_are_said_not_fitted(disk_build, swept):
    sweep = swept(thick_disk(disk_build("PZT-5A", (10.0, 0.5, 7800.0))), BAND)
    with pytest.raises(
        FitError, match=r"ends at 0\.649 MHz, far below the thickness resonance .* use the fitter `radial`"
    ):
        Mason().fit(FitTask(disk_build("PZT-5A", (10.0, 0.5, 7800.0)), {"disk": (sweep,)}))
    # the overtone lies where the first mode of a much smaller disk would be
    small = disk_build("PZT-5A", (5.5, 0.5, 7800.0), more="eps33S_r = 1300")
    with pytest.raises(FitError, match=r"first is expected near 3.. kHz .* 5\.5 mm: a diameter of (9\.|10).* explain"):
        RadialLeastSquares().fit(FitTask(small, {"disk": (sweep,)}))
    with pytest.raises(FitError, match=r"s11E comes out at 0\.5. times .* 10\.. mm instead of 14 mm would explain it"):
        RadialLeastSquares().fit(FitTask(disk_build("PZT-5A", (14.0, 0.5, 7800.0)), {"disk": (sweep,)}))
    answer = RadialLeastSquares().fit(FitTask(disk_build("PZT-5A", (12.4, 0.5, 7800.0)), {"disk": (sweep,)}))
    assert any("instead of 12.4 mm would explain it" in line for line in answer.says)
