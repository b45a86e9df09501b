"""The weighed mass as a datum: mass = area * sum of density * thickness, with its correlations."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import BuildError, build_from_json, build_to_json, parse_build
from pzctl.fitters.disk.bare_disk import bare_disk
from pzctl.fitters.disk.planar_result import disk_priors
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import nominal_parameters, stack_of, weighings_of
from pzctl.fitters.interface import FitResult, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.plugins import load_fitter
from pzctl.models.build import Build, Quantity
from pzctl.models.sweep import Sweep

AREA, THICKNESS, DENSITY = math.pi * 0.008**2, 5.1e-4, 7640.0
BUILD = """
name = "S4"
diameter_mm = { value = 16.0, u = 0.01 }
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.510, u = 0.002 }
[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = { value = 10.3, u = 0.5 }
c_m_s = { value = 2455, u = 150 }
q = { value = 60, u = 30 }
thickness_mm = { value = 0.139, u = 0.002 }
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ml1"
layers = ["disk", "ml1"]
"""


def weighed(mass: float, u: float, step: str = "disk") -> Build:
    return parse_build(BUILD).noted(step, mass=Quantity(mass, u=u, source="balance"))


def recorded(build: Build, step: str = "disk") -> Sweep:
    """A recording of the nominal device with the density below the library's."""
    layers = tuple(
        replace(layer, values={**layer.values, "density": Quantity(DENSITY)}) if layer.kind == "piezo" else layer
        for layer in build.layers
    )
    f = np.linspace(1.5e6, 8e6, 301)
    z = stack_of(replace(build, layers=layers), build.step(step)).impedance(f)
    noise = np.random.default_rng(1).standard_normal((2, f.size))
    return Sweep(f, z * (1 + 5e-4 * (noise[0] + 1j * noise[1])), id=step)


def fitted(build: Build, fitter: str = "mason") -> FitResult:
    return load_fitter(fitter).fit(FitTask(build, {"disk": (recorded(build),)}))


def test_a_mass_decides_the_density_and_halves_the_uncertainty_of_the_stiffness() -> None:
    """Stiffness is proportional to density * thickness**2, so to mass * thickness: thickness enters once, not twice."""
    mass = DENSITY * AREA * THICKNESS
    without, with_mass = fitted(parse_build(BUILD)), fitted(weighed(mass, 2e-4 * mass))
    density = with_mass.constants["disk.density"]
    assert density.u_re is not None
    assert without.constants["disk.density"].u_re is not None
    assert abs(density.re - DENSITY) < 2 * density.u_re
    assert density.u_re / DENSITY == pytest.approx(math.hypot(2 / 510, 2 * 0.01 / 16, 2e-4), rel=0.1)
    assert with_mass.constants["disk.c33D"].u_re / without.constants["disk.c33D"].u_re < 0.5  # type: ignore[operator]
    assert with_mass.budget is not None
    assert with_mass.budget.re["disk.c33D"].dimensions > 0


def test_the_jacobian_of_a_mass_is_its_derivative() -> None:
    build = weighed(1e-3, 1e-6, "ml1")
    (weighing,) = weighings_of(build, ["disk", "ml1"])
    values = nominal_parameters(build)
    for name, slope in weighing.slopes(values).items():
        step = 1e-6 * values[name]
        up, down = (
            weighing.predicted({**values, name: values[name] + step}),
            weighing.predicted({**values, name: values[name] - step}),
        )
        assert (up - down) / (2 * step) == pytest.approx(slope, rel=1e-6), name
    ml1 = 10.3e6 / 2455 * 1.39e-4
    assert weighing.predicted(values) == pytest.approx(AREA * (values["disk.density"] * 5.1e-4 + ml1), rel=1e-6)


def test_the_mass_of_a_glued_stack_ties_its_layers() -> None:
    build = weighed(0.0, 1.0)  # any mass: only its prediction is used below
    task = FitTask(build, {step: (recorded(build, step),) for step in ("disk", "ml1")})
    total = weighings_of(weighed(1.0, 1.0, "ml1"), ["ml1"])[0].predicted(
        {**nominal_parameters(build), "disk.density": DENSITY}
    )
    with_mass = weighed(total, 1e-4 * total, "ml1")
    (weighing,) = weighings_of(with_mass, ["ml1"])
    solution = solve(replace(task, build=with_mass), lambda _: None)
    values, _ = solution.descent.objective.coordinates.forward(solution.descent.x)
    assert weighing.predicted(values) == pytest.approx(total, rel=3e-4)


@pytest.mark.parametrize("fitter", ["radial", "disk"])
def test_the_bare_disk_fitters_use_the_mass(fitter: str) -> None:
    build = weighed(8e-4, 1e-6)
    disk = bare_disk(FitTask(build, {"disk": (recorded(build),)}), fitter, round_one=True, frees=True)
    assert "mass@disk" in [prior.parameter for prior in disk_priors(disk, ())]


def test_a_mass_in_a_build_file_survives_the_journal_and_needs_an_uncertainty() -> None:
    text = BUILD.replace('name = "disk"\nlayers', 'name = "disk"\nmass_g = { value = 0.789, u = 0.001 }\nlayers')
    build = parse_build(text)
    mass = build.steps[0].mass
    assert mass is not None
    assert (mass.re, mass.u) == pytest.approx((0.789e-3, 1e-6))
    assert build_from_json(build_to_json(build)) == build
    with pytest.raises(BuildError, match=r"mass_g .* has no u; write mass_g"):
        parse_build(text.replace("{ value = 0.789, u = 0.001 }", "0.789"))


def test_mason_without_a_mass_is_unchanged() -> None:
    result = Mason().fit(FitTask(parse_build(BUILD), {"disk": (recorded(parse_build(BUILD)),)}))
    assert result.constants["disk.density"].re == pytest.approx(7700, rel=2e-3), "the library's"
