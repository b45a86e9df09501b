"""Sherrit's radial method: the constants of table A.1 from their own spectrum, passivity, and refusals."""

import numpy as np
import pytest

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.sherrit_radial import SherritRadial
from pzctl.fitters.interface import FitError, FitTask
from pzctl.models.constants.piezo_constants import Radial
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL

BAND = np.arange(100e3, 700e3, 200.0)  # 200 Hz spacing


def spectrum(build, constants=SHERRIT_RADIAL):
    layer = build.layer("disk").values
    return RadialDisk.of("disk", constants, build.area.re, layer["thickness"].re, layer["density"].re)


@pytest.fixture
def build(disk_build):
    return disk_build("PZT-5A", (10.0, 0.5, 7800.0), (0.0, 0.0, 0.0))


def test_table_a1_is_recovered_at_200_hz(build, swept):
    result = SherritRadial().fit(FitTask(build, {"disk": (swept(spectrum(build), BAND),)}))
    for name in ("s11E", "s12E", "d31", "eps33T"):
        truth, found = getattr(SHERRIT_RADIAL, name), result.constants[f"disk.{name}"]
        assert found.re == pytest.approx(truth.real, rel=0.002), name
        assert found.im == pytest.approx(truth.imag, rel=0.02), name
        assert abs(found.re - truth.real) < 3 * found.u_re, name
    assert result.constants["disk.kp"].re == pytest.approx(0.5827, abs=1e-3)
    assert result.derived["disk.kp_IEEE"].re == pytest.approx(0.5945, abs=1e-3)
    assert any(line.startswith("Passivity check passed: ") for line in result.says)
    assert any("Points per linewidth: fs1" in line for line in result.says)  # 15: said, not refused


def test_bands_may_be_in_several_files(build, swept):
    model = spectrum(build)
    bands = (np.arange(60e3, 80e3, 500.0), np.arange(170e3, 260e3, 100.0), np.arange(470e3, 550e3, 200.0))
    sweeps = tuple(swept(model, band, seed=k) for k, band in enumerate(bands))
    found = SherritRadial().fit(FitTask(build, {"disk": sweeps})).constants["disk.s11E"]
    assert found.re == pytest.approx(SHERRIT_RADIAL.s11E.real, rel=0.002)


def test_constants_that_are_not_passive_are_reported(build, swept):
    S = SHERRIT_RADIAL
    active = Radial(S.s11E, S.s12E.real * (1 + 0.055j), S.d31, S.eps33T)  # Im(s11E - s12E) > 0, as in the thesis
    result = SherritRadial().fit(FitTask(build, {"disk": (swept(spectrum(build, active), BAND),)}))
    assert any(line.startswith("Passivity check FAILED") for line in result.says)


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [
        (1e6, 15e6, "no radial resonance in 1000-15000 kHz: the first is expected near"),
        (100e3, 400.1e3, "no second radial resonance in 100-400 kHz: it is expected near 512.* Poisson's ratio alone"),
    ],
)
def test_a_recording_without_the_modes_is_refused(build, swept, low, high, says):
    with pytest.raises(FitError, match=says):
        SherritRadial().fit(FitTask(build, {"disk": (swept(spectrum(build), np.arange(low, high, 400.0)),)}))


def test_a_wrong_diameter_is_noticed(disk_build, build, swept):
    wrong = disk_build("PZT-5A", (25.0, 0.5, 7800.0))
    with pytest.raises(FitError, match=r"expected near .* kHz for a diameter of 25 mm"):
        SherritRadial().fit(FitTask(wrong, {"disk": (swept(spectrum(build), np.arange(150e3, 700e3, 200.0)),)}))


def test_glued_layers_are_refused(build, swept):
    sweep = swept(spectrum(build), BAND)
    with pytest.raises(FitError, match="step 'ml1' is not in build"):
        SherritRadial().fit(FitTask(build, {"ml1": (sweep,)}))


def test_a_real_recording_with_too_wide_a_spacing_is_refused(disk_build, recordings):
    build = disk_build("PZT-5A", (35.0, 2.0, 7743.0))
    sweeps = tuple(read_recording(recordings / "disk-35x2" / f"radial-mode-{k}.csv") for k in (1, 2))
    with pytest.raises(FitError, match=r"antiresonance at 69\.03 kHz has 4\.6 points in its linewidth"):
        SherritRadial().fit(FitTask(build, {"disk": sweeps}))
