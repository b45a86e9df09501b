"""Fitter `disk`: both modes' constants come back from one recording, within their uncertainties."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.fitters.disk.disk_fitter import DiskFitter
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.engine.parameters.overrides import Amendments, amended
from pzctl.fitters.interface import FitError, FitTask
from pzctl.models.constants.piezo_constants import Radial, Thickness, clamped_permittivity
from pzctl.models.disk.round_disk import BothModes
from pzctl.models.stack import CausalConstantQ

RADIAL_REFERENCE, THICKNESS_REFERENCE = 124.75e3, 4.22e6
BANDS = (np.arange(80e3, 600e3, 1e3), np.linspace(2e6, 9e6, 701))


@pytest.fixture
def build(disk_build):
    return disk_build("test ceramic", (16.0, 0.512, 7700.0), (0.0, 0.0, 0.0))


def both_modes(build):
    v = build.layer("disk").values
    radial = Radial(*(v[name].value for name in ("s11E", "s12E", "d31", "eps33T")))
    stack = stack_of(build, build.steps[0])
    law = CausalConstantQ(THICKNESS_REFERENCE)
    plate = replace(stack.layers[0], c_law=law, h_law=law, eps_law=law)
    disk = BothModes.of(replace(stack, layers=(plate,)), "disk", radial)
    laws = dict.fromkeys(("s11E", "s12E", "d31"), CausalConstantQ(RADIAL_REFERENCE))
    return replace(disk, arm=replace(disk.arm, alpha=0.69, d33f=1.35e-10, laws=laws))


def test_constants_of_both_modes_are_recovered(build, swept):
    model = both_modes(build)
    sweeps = tuple(swept(model, band, 2e-4, seed=k) for k, band in enumerate(BANDS))
    result = DiskFitter().fit(FitTask(build, {"disk": sweeps}))
    assert 0.8 < result.chi2_per_dof < 1.2
    v = build.layer("disk").values
    # the fitter's reference frequencies differ by up to 1 %: by the loss's dispersion, 1e-4 of a constant
    for name in ("c33D", "h33", "eps33S", "s11E", "s12E", "d31"):
        truth, found = v[name].value, result.constants[f"disk.{name}"]
        assert found.re == pytest.approx(truth.real, rel=1e-3), name
        assert found.im == pytest.approx(truth.imag, abs=3e-4 * abs(truth)), name
    found = result.constants | result.derived
    eps33S = clamped_permittivity(found["disk.eps33T"].re, found["disk.kp"].re, found["disk.kt"].re)
    low = Thickness(*(v[name].value for name in ("c33D", "h33", "eps33S"))).eps33S.real
    assert eps33S / low == pytest.approx(1 + 2 / np.pi * 0.0116 * np.log(4.22e6 / 124.75e3), rel=5e-3)
    assert any(line.startswith("Passivity check passed: ") for line in result.says)


def test_one_mode_alone_is_refused(build, swept):
    model = both_modes(build)
    with pytest.raises(FitError, match="no thickness resonance in 80-599 kHz"):
        DiskFitter().fit(FitTask(build, {"disk": (swept(model, BANDS[0]),)}))
    with pytest.raises(FitError, match="no radial resonance in 2000-9000 kHz"):
        DiskFitter().fit(FitTask(build, {"disk": (swept(model, BANDS[1]),)}))


@pytest.mark.parametrize(("material", "off"), [("test ceramic", 0.06), ("PIC255", -0.12), ("NCE51", 0.15)])
def test_sizes_that_are_all_uncertain_stay_near_their_values(disk_build, swept, material, off):
    """Sizes scale every constant by a power; losses that an intermediate step makes negative recover."""
    told = disk_build(material, (16.0, 0.512, 7700.0), (0.05, 0.01, 100.0))
    truth = disk_build(material, (16.04, 0.505, 7790.0), (0.0, 0.0, 0.0))
    model = both_modes(truth)
    parts = {name: value for name, value in model.parameters().items() if name.endswith(("s11E.re", "c33D.re"))}
    model = model.replace({name: (1 + off) * value for name, value in parts.items()})
    result = DiskFitter().fit(FitTask(told, {"disk": (swept(model, np.linspace(50e3, 8e6, 1601), 2e-4),)}))
    assert result.converged
    assert result.chi2_per_dof < 1.2
    assert result.evaluations < 110
    true = model.parameters()
    for name in ("c33D", "h33", "eps33S", "s11E", "s12E", "d31"):
        found = result.constants[f"disk.{name}"]
        assert abs(found.re - true[f"disk.{name}.re"]) < 4 * found.u_re, name


def test_held_and_bounded_constants(build, swept):
    sweeps = {"disk": tuple(swept(both_modes(build), band, 2e-4, seed=k) for k, band in enumerate(BANDS))}
    c33D, density = build.layer("disk").values["c33D"], build.layer("disk").values["density"]
    known = amended(build, Amendments(prior=(("disk.density", density.re, 80.0),), hold=("disk.c33D",)))
    held = DiskFitter().fit(FitTask(known, sweeps)).constants
    assert complex(held["disk.c33D"].re, held["disk.c33D"].im) == pytest.approx(c33D.value)
    assert held["disk.density"].u_re < 8  # fp determines the density where stiffness and thickness are known
    low = (("disk.c33D", 0.9 * c33D.re, 1.1 * c33D.re),)
    assert DiskFitter().fit(FitTask(amended(build, Amendments(bound=low)), sweeps)).constants["disk.c33D"].free
    with pytest.raises(FitError, match=r"cannot bound 'disk\.s11E': `disk` moves it together"):
        DiskFitter().fit(FitTask(amended(build, Amendments(bound=(("disk.s11E", 1e-11, 2e-11),))), sweeps))


def test_a_resonance_between_two_points_is_said_as_that(build, swept):
    few = swept(both_modes(build), np.linspace(50e3, 9e6, 60))
    with pytest.raises(FitError, match="the resonance is lost between them: sweep it every"):
        DiskFitter().fit(FitTask(build, {"disk": (few,)}))
