"""Fitter `mason` on devices of an independent simulation, on free plates by a textbook formula, and on bad input."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from open_cases import given

from pzctl.daemon.files.builds.build_file import parse_build, read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.interface import FitError, FitResult, FitTask, Options
from pzctl.fitters.layered.mason import Mason
from pzctl.models.sweep import Sweep

DISK = """
name = "plate"
area_mm2 = 200.0
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = 0.5
density_kg_m3 = 7700
[load]
back = "vacuum"
front = "vacuum"
[[steps]]
name = "disk"
layers = ["disk"]
"""


def plate(
    c33D: complex, kt: complex, eps33S: complex, noise: float = 1e-4, band: tuple[float, float] = (1e6, 15e6)
) -> Sweep:
    """A free plate by its textbook formula (Onoe, Tiersten and Meitzler, JASA 35 (1963) 36), with noise."""
    f = np.linspace(*band, 801)
    X = 2 * np.pi * f * 0.25e-3 / np.sqrt(c33D / 7700.0)
    Z = (1 - kt**2 * np.tan(X) / X) * 0.5e-3 / (2j * np.pi * f * eps33S * 200e-6)
    rng = np.random.default_rng(1)
    return Sweep(f, Z * (1 + noise * (rng.standard_normal(801) + 1j * rng.standard_normal(801))), id="plate")


OTHER_CERAMIC = DISK.replace(
    "density_kg_m3",
    "c33D_1e10_Pa = { value = 15, u = 15 }\neps33S_r = { value = 900, u = 900 }\ndensity_kg_m3",
)


def fit(sweep: Sweep, free: tuple[str, ...] | None = None, build: str = DISK) -> FitResult:
    return Mason().fit(FitTask(parse_build(build), {"disk": (sweep,)}, free))


def case(folder: Path, name: str) -> tuple[FitTask, dict[str, Any]]:
    truth = json.loads((folder / "truth.json").read_text())[name]
    sweeps = {
        step: tuple(read_recording(folder / name / file) for file in files) for step, files in truth["files"].items()
    }
    return FitTask(read_build(folder / name / "build.toml"), sweeps), truth["constants"]


@pytest.mark.parametrize("name", ["null", "glue-null"])
def test_constants_of_an_independent_simulation(cases: Path, name: str) -> None:
    task, truth = case(cases, name)
    result = Mason().fit(task)
    assert 0.85 < result.chi2_per_dof < 1.15
    for constant, true in truth.items():
        found = result.constants[constant]
        pairs = zip((found.re, found.im), (found.u_re, found.u_im), np.atleast_1d(true), strict=False)
        for value, u, right in pairs:
            assert u is not None
            assert abs(value - right) < 3 * u, constant


def test_a_missing_glue_does_not_spoil_the_disk(cases: Path) -> None:
    task, truth = case(cases, "glue-missing")
    result = Mason().fit(task)
    assert any("does not describe" in sentence for sentence in result.says)
    c33D = result.constants["disk.c33D"]
    assert c33D.u_re is not None
    assert abs(c33D.re - truth["disk.c33D"][0]) < 3 * c33D.u_re


@pytest.mark.parametrize(
    ("c33D", "kt", "eps33S"),
    [
        (145e9 * (1 + 1j / 80), 0.47 - 0.002j, 8.1e-9 * (1 - 0.017j)),
        (250e9 * (1 + 1j / 1000), 0.2, 2e-9 * (1 - 0.001j)),
        (90e9 * (1 + 1j / 12), 0.65, 2e-8 * (1 - 0.03j)),
    ],
    ids=["soft", "sharp", "broad"],
)
def test_a_plate_far_from_the_data_sheet(c33D: complex, kt: complex, eps33S: complex) -> None:
    result = fit(plate(c33D, kt, eps33S), build=OTHER_CERAMIC)
    found = result.constants["disk.c33D"]
    assert 0.85 < result.chi2_per_dof < 1.2
    np.testing.assert_allclose([found.re, found.im], [c33D.real, c33D.imag], rtol=0.02)
    np.testing.assert_allclose(result.derived["disk.kt"].re, kt.real if isinstance(kt, complex) else kt, rtol=0.005)


def test_only_freed_constants_change() -> None:
    result = fit(plate(145e9 * (1 + 1j / 80), 0.47, 8.1e-9 * (1 - 0.017j)), free=("disk.c33D", "disk.h33"))
    assert result.constants["disk.c33D"].free
    assert not result.constants["disk.eps33S"].free
    assert result.constants["disk.eps33S"].u_re == 0


@pytest.mark.parametrize("procedure", ["joint", "sequential", "frozen"])
@pytest.mark.long
def test_a_constant_of_a_later_step_can_be_freed_alone(
    cases: Path, procedure: Literal["joint", "sequential", "frozen"]
) -> None:
    task, _ = given(cases, "glue-null", 8)
    for free in (("ml1.z",), ("disk.c33D", "ml1.z")):
        result = Mason().fit(replace(task, free=free, options=Options(procedure=procedure)))
        assert {name for name, constant in result.constants.items() if constant.free} == {*free}


def test_an_unknown_name() -> None:
    with pytest.raises(FitError, match=r"cannot free 'disk.c33E'.*disk.c33D"):
        fit(plate(145e9 * (1 + 1j / 80), 0.47, 8.1e-9 * (1 - 0.017j)), free=("disk.c33E",))


def test_a_band_without_resonance_is_said() -> None:
    flat = plate(145e9 * (1 + 1j / 80), 0.47, 8.1e-9 * (1 - 0.017j), band=(1e5, 1e6))
    with pytest.raises(FitError, match=r"shows no resonance with an antiresonance above it between 0\.1 and 1 MHz"):
        fit(flat)


def test_a_step_of_another_build() -> None:
    sweep = plate(145e9 * (1 + 1j / 80), 0.47, 8.1e-9 * (1 - 0.017j))
    with pytest.raises(FitError, match="step 'ml7' is not in build 'plate', which has disk"):
        Mason().fit(FitTask(parse_build(DISK), {"ml7": (sweep,)}))
