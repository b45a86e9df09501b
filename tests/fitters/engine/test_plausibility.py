"""Recordings that determine nothing are refused, and implausible results are reported."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build, read_build
from pzctl.drivers.recordings import read_recording, write_csv
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.engine.physical_range import beyond_solids
from pzctl.fitters.interface import Constant, FitError, FitResult, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.base.arrays import Complexes, Reals
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.sample import sample

RNG = np.random.default_rng(5)


@pytest.fixture
def good(cases: Path) -> Sweep:
    return read_recording(cases / "null" / "disk.csv")


def fit(cases: Path, sweep: Sweep, area: float = 1.0, *, given: bool = False) -> FitResult:
    """Fit with another area; `given`: with a permittivity that the build file states with a large uncertainty."""
    build = read_build(cases / "null" / "build.toml")
    assert build.diameter is not None
    diameter = replace(build.diameter, re=build.diameter.re * area**0.5)
    build = replace(build, area=replace(build.area, re=build.area.re * area), diameter=diameter)
    if given:
        (disk, *others) = build.layers
        eps = disk.values["eps33S"]
        own = replace(eps, re=eps.re / area, u=0.3 * eps.re / area, source="build.toml")
        build = replace(build, layers=(replace(disk, values={**disk.values, "eps33S": own}), *others))
    return Mason().fit(FitTask(build, {"disk": (sweep,)}))


def noise(f: Reals) -> Complexes:
    return 1 + 1e-3 * (RNG.standard_normal(f.size) + 1j * RNG.standard_normal(f.size))


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (lambda f, Z: -Z, "is inverted: resistance is negative at 100% of its points"),
        (lambda f, Z: Z.conj(), "conjugate it"),
        (lambda f, Z: 0.3 + 2j * np.pi * f * 2e-8, "is it shorted?"),
        (lambda f, Z: 0.3 * noise(f), "this is a short circuit"),
        (lambda f, Z: noise(f) / (2j * np.pi * f * 2e-13), "this is an open circuit"),
        (lambda f, Z: noise(f) * (1 - 0.01j) / (2j * np.pi * f * 2e-9), "shows no resonance"),
        (lambda f, Z: 8 * Z, "diameter or thickness of the build file"),
    ],
    ids=["inverted", "conjugated", "wire", "short", "open", "capacitor", "size"],
)
def test_a_degenerate_recording(
    cases: Path, good: Sweep, made: Callable[[Reals, Complexes], Complexes], sentence: str
) -> None:
    sweep = Sweep(good.frequency, made(good.frequency, good.impedance), id="odd.csv")
    with pytest.raises(FitError) as caught:
        fit(cases, sweep)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_recording_with_an_id_is_named_by_its_file(cases: Path, good: Sweep, tmp_path: Path) -> None:
    made = replace(good, impedance=8 * good.impedance, id="01a2218b-418a-76d3-a88b-4788abee238d")
    write_csv(made, tmp_path / "exported.csv")
    with pytest.raises(FitError, match=r"^exported.csv: the median \|Z\| is"):
        fit(cases, read_recording(tmp_path / "exported.csv"))


def test_a_recording_of_a_daemon_is_called_by_its_step(cases: Path, good: Sweep) -> None:
    number = "01a2130e-6517-7ab4-9508-b84b61639377"
    with pytest.raises(FitError, match=rf"^recording {number} of step 'disk': the median .* another unit, "):
        fit(cases, Sweep(good.frequency, 1e3 * good.impedance, id=number))


def test_too_few_points_in_a_linewidth(cases: Path, good: Sweep) -> None:
    few, fewer = (Sweep(good.frequency[::n], good.impedance[::n], id="few.csv") for n in (4, 16))
    assert any("points lie in the linewidth" in sentence for sentence in fit(cases, few).says)
    with pytest.raises(FitError, match="the resonance is lost between them: sweep it every"):
        fit(cases, fewer)


def named(sentence: str) -> float:
    return float(sentence.partition("a diameter of ")[2].partition(" mm")[0])


@pytest.mark.parametrize("area", [0.72, 1.52])
def test_a_doubtful_diameter_is_reported_with_the_correct_one(cases: Path, good: Sweep, area: float) -> None:
    (said,) = [sentence for sentence in fit(cases, good, area).says if "a diameter of" in sentence]
    assert named(said) == pytest.approx(right_diameter(cases), rel=0.05)
    assert not any("a diameter of" in sentence for sentence in fit(cases, good).says)


@pytest.mark.parametrize("area", [0.33, 3.0])
def test_the_diameter_of_another_disk_is_refused_unless_the_permittivity_is_given(
    cases: Path, good: Sweep, area: float
) -> None:
    with pytest.raises(FitError, match="which no disk of it has: a diameter of") as caught:
        fit(cases, good, area)
    assert named(str(caught.value)) == pytest.approx(right_diameter(cases), rel=0.05)
    (said,) = [sentence for sentence in fit(cases, good, area, given=True).says if "a diameter of" in sentence]
    assert named(said) == pytest.approx(right_diameter(cases), rel=0.05)


def right_diameter(cases: Path) -> float:
    right = read_build(cases / "null" / "build.toml").diameter
    assert right is not None
    return 1e3 * right.re


EPOXY = 'material = "epoxy"'
GLUED = """
name = "S1"
diameter_mm = 16
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.512, u = 0.001 }
[[layers]]
name = "glue1"
kind = "elastic"
material = "epoxy"
thickness_mm = { value = 0.01, u = 0.005 }
[[layers]]
name = "ml1"
kind = "elastic"
material = "epoxy"
thickness_mm = { value = 0.14, u = 0.002 }
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ml1"
layers = ["disk", "glue1", "ml1"]
"""


def fit_glued(change: Callable[[Complexes, Complexes], tuple[float, Complexes]], build: str = GLUED) -> FitResult:
    """Fit disk and first layer of the simulated bench; `change` returns factors by f for both curves, and ml1's."""
    f, rng = np.linspace(1e6, 12e6, 200), np.random.default_rng(3)
    noise = 1 + 3e-5 * (rng.standard_normal((2, f.size)) + 1j * rng.standard_normal((2, f.size)))
    disk, glued = (sample(0).stack(step).impedance(f) * n for step, n in zip(("disk", "ml1"), noise, strict=True))
    factor, glued = change(disk, glued)
    return Mason().fit(FitTask(parse_build(build), {"disk": (Sweep(f, disk),), "ml1": (Sweep(factor * f, glued),)}))


def test_a_layer_of_another_material_is_reported() -> None:
    result = fit_glued(lambda _, glued: (1.0, glued))
    assert result.chi2_per_dof < 1.3
    assert result.constants["ml1.z"].re == pytest.approx(sample(0).truth()["ml1.z"]["re"], rel=0.2)
    (said,) = [sentence for sentence in result.says if "another material" in sentence]
    assert said.startswith("ml1.z is ")
    assert "u from the 2.42e+06 of epoxy" in said


@pytest.mark.long
def test_a_diverged_fit_states_its_cause_and_stays_physical() -> None:
    result = fit_glued(lambda _, glued: (1.3, glued))
    says = " ".join(result.says)
    assert "The fit ran away: ml1." in says
    assert "does not describe step 'ml1'" in says
    assert "overtones" not in says, "the bare disk is described to its noise: its diameter is not the cause"
    for name in ("glue1.q", "ml1.q"):
        assert result.constants[name].re >= 0.5


def test_a_layer_that_was_not_glued_on_is_reported() -> None:
    assert any(
        "'ml1' is not on the device" in s for s in fit_glued(lambda disk, _: (1.0, disk * noise(disk.real))).says
    )


@pytest.mark.parametrize(
    ("given", "written", "says"),
    [
        (EPOXY, "z_MRayl = 2.8e6\nc_m_s = 2450\nq = 13", "z is 2.8e+06 MRayl; materials have 0.00041 to 100 MRayl"),
        (EPOXY, "z_MRayl = 2.8\nc_m_s = 2.45\nq = 13", "c is 2.45 m/s; materials have 340 to 10000 m/s"),
        ("value = 0.01,", "value = 10,", "glue1.thickness is 10 mm; a line of glue has up to 0.2 mm"),
    ],
)
def test_a_value_in_the_unit_of_another_is_named(given: str, written: str, says: str) -> None:
    try:
        said = fit_glued(lambda _, glued: (1.0, glued), GLUED.replace(given, written, 1)).says
    except FitError as error:
        said = (str(error),)
    assert any(says in sentence for sentence in said)


def test_a_velocity_that_no_solid_has_is_reported_where_the_fit_found_it() -> None:
    glue = parse_build(GLUED).layer("glue1")
    found = {"glue1.z": Constant(2.8e6, 0, 1e3, None, "Rayl")}
    usual, strange = (found | {"glue1.c": Constant(c, 0, 1, None, "m/s")} for c in (2450, 379))
    (says,) = beyond_solids(glue, strange)
    assert says.startswith("glue1.c is 379 m/s; solids have 680 to 13000 m/s")
    assert not list(beyond_solids(glue, usual))


def test_visible_radial_overtones_are_named_with_the_fitter_for_them(recordings: Path) -> None:
    sweep = read_recording(recordings / "disk-20x2" / "thickness-mode.csv")
    only = GLUED.partition('[[layers]]\nname = "glue1"')[0].replace("0.512", "2.013").replace("16", "20")
    tail = '[load]\nback = "air"\nfront = "air"\n[[steps]]\nname = "disk"\nlayers = ["disk"]\n'
    build = parse_build(only + tail)
    hints = [s for s in Mason().fit(FitTask(build, {"disk": (sweep,)})).says if "overtones" in s]
    assert "`--fitter disk2d`" in hints[0]
    resistor = stack_of(build, build.step("disk")).impedance(sweep.frequency) + 20
    says = Mason().fit(FitTask(build, {"disk": (Sweep(sweep.frequency, resistor),)})).says
    assert any("does not describe" in s for s in says)
    assert not any("overtones" in s for s in says), "a misfit without further resonances has another cause"
