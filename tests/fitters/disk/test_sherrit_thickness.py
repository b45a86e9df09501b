"""Sherrit's thickness-mode method recovers the constants of a plate, and says when it cannot."""

import numpy as np
import pytest

from pzctl.fitters.disk.sherrit_thickness import SherritThickness
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitError, FitTask

BAND = np.concatenate([np.arange(3.3e6, 4.8e6, 1e3), np.linspace(8e6, 9.5e6, 101)])


@pytest.mark.parametrize(("noise", "re", "im"), [(1e-6, 5e-4, 5e-3), (1e-3, 1e-3, 0.03)])
def test_constants_are_recovered(disk_build, swept, noise, re, im):
    build = disk_build("test ceramic", (16.0, 0.512, 7700.0), (0.0, 0.0, 0.0))
    sweep = swept(stack_of(build, build.steps[0]), BAND, noise)
    result = SherritThickness().fit(FitTask(build, {"disk": (sweep,)}))
    for name in ("c33D", "h33", "eps33S"):
        truth, found = build.layer("disk").values[name].value, result.constants[f"disk.{name}"]
        assert found.re == pytest.approx(truth.real, rel=re), name
        assert found.im == pytest.approx(truth.imag, rel=im), name
        assert abs(found.re - truth.real) < 5 * found.u_re, name
        assert abs(found.im - truth.imag) < 5 * found.u_im, name
    assert result.says[0].startswith("Read: fs 3.804")


def test_sizes_enter_the_uncertainty(disk_build, swept):
    build = disk_build("test ceramic", (16.0, 0.512, 7700.0), (0.0, 0.00512, 0.0))  # thickness to 1 %
    sweep = swept(stack_of(build, build.steps[0]), BAND)
    c33D = SherritThickness().fit(FitTask(build, {"disk": (sweep,)})).constants["disk.c33D"]
    assert c33D.u_re / c33D.re == pytest.approx(0.02, rel=0.15)  # c33D goes as thickness squared


def test_the_grid_of_the_thesis_is_too_coarse_for_a_sharp_ceramic(disk_build, swept):
    build = disk_build("test ceramic", (16.0, 0.512, 7700.0))
    sweep = swept(stack_of(build, build.steps[0]), np.linspace(1e6, 9e6, 801))
    with pytest.raises(FitError, match="points in its linewidth"):
        SherritThickness().fit(FitTask(build, {"disk": (sweep,)}))


def test_a_recording_of_the_radial_mode_is_refused(disk_build, swept):
    build = disk_build("test ceramic", (16.0, 0.512, 7700.0))
    sweep = swept(stack_of(build, build.steps[0]), np.linspace(50e3, 900e3, 801))
    with pytest.raises(FitError, match=r"no thickness resonance in 50-900 kHz: it is expected near 4\.22 MHz"):
        SherritThickness().fit(FitTask(build, {"disk": (sweep,)}))
