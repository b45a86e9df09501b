"""Fitter stack2d: a known glued stack, its coordinates, and refusals; glued steps on a disk that is known."""

from dataclasses import replace

import numpy as np
import pytest
from budget_sums import assert_the_budget_adds_up
from complex_ceramic import TENSOR

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.disk.two_d.tensor_coordinates import COORDINATES
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.recording import Posterior, Recording
from pzctl.fitters.interface import FitError, FitTask, TaskError
from pzctl.fitters.layered.two_d.glued_on_disk import KnownDisk, glued_on
from pzctl.fitters.layered.two_d.plate_block import plate_block
from pzctl.fitters.layered.two_d.stack2d import Stack2DFitter
from pzctl.fitters.layered.two_d.stack_problem import (
    nominal,
    part_of_area,
    problem_of,
    stack_coordinates,
    stack_of,
    stack_priors,
    tensor_values,
)
from pzctl.fitters.layered.two_d.stack_start import one_dimensional
from pzctl.models.build import EffectSpec, Quantity
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.stack.loss_laws import CONSTANT, CausalConstantQ
from pzctl.models.stack2d.layers2d import Ceramic2D, Isotropic
from pzctl.models.stack2d.stack_model import Stack2D, full_section
from pzctl.models.sweep import Sweep

BUILD = """
name = "S"
diameter_mm = 6.0
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27 Bergen"
thickness_mm = { value = 1.0, u = 0.002 }
density_kg_m3 = 7700
[[layers]]
name = "glue1"
kind = "elastic"
material = "epoxy"
thickness_mm = { value = 0.020, u = 0.005 }
[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = { value = 10.3, u = 0.5 }
c_m_s = { value = 2455, u = 150 }
q = { value = 60, u = 30 }
poisson = { value = 0.33, u = 0.03 }
thickness_mm = { value = 0.3, u = 0.004 }
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
DISK = Ceramic2D("disk", replace(TENSOR, c11E=1.02 * TENSOR.c11E, c33E=0.98 * TENSOR.c33E), 1.001e-3, 7700.0)
GLUE = Isotropic("glue1", 18e-6, 2.5e6, 2250.0, 11.0, 0.37)
MATCHING = Isotropic("ml1", 0.302e-3, 10.5e6, 2420.0, 50.0, 0.32)
F = np.linspace(0.4e6, 2.2e6, 31)


def recorded(*layers, seed=0, hole=0.0):
    """Return two sweeps of a stack, which tell its noise."""
    area = np.pi * (3e-3**2 - hole**2)
    stack = Stack2D(layers, area, full_section(layers, F[-1], 2), 413.0, 413.0, hole=hole)
    Z, rng = stack.impedance(F), np.random.default_rng(seed)
    noise = 2e-4 * (rng.normal(size=(2, F.size)) + 1j * rng.normal(size=(2, F.size)))
    return tuple(Sweep(F, Z * np.exp(one)) for one in noise)


@pytest.fixture(scope="module")
def sweeps():
    return {"disk": recorded(DISK), "ml1": recorded(DISK, GLUE, MATCHING, seed=1)}


@pytest.mark.long
def test_a_known_stack_is_recovered(sweeps):
    result = Stack2DFitter().fit(FitTask(parse_build(BUILD, "build.toml"), sweeps))
    assert result.converged
    assert result.rms_log_error < 4e-4
    assert result.steps == ("disk", "ml1")
    for name in CONSTANTS:
        true, found = complex(getattr(DISK.constants, name)), result.constants[f"disk.{name}"]
        assert abs(found.re - true.real) < 4 * found.u_re, name
        assert abs(found.im - true.imag) < 4 * found.u_im, name
    for layer in (GLUE, MATCHING):
        for key, true in layer.parameters().items():
            found = result.constants[f"{layer.name}.{key}"]
            assert abs(found.re - true) < 4 * found.u_re, f"{layer.name}.{key}"
    assert result.constants["ml1.c"].u_re < 0.005 * MATCHING.c  # the prior's is 0.06
    plate = DISK.constants.thickness
    assert result.constants["disk.c33D"].re == pytest.approx(plate.c33D.real, rel=5e-3)
    assert result.derived["disk.kt"].re == pytest.approx(plate.kt.real, rel=2e-3)
    assert "disk.kp" in result.derived
    assert any("losses that are the same at all frequencies" in text for text in result.says)
    assert not any("does not describe" in text for text in result.says)


def test_causal_constants_are_told_at_the_thickness_resonance():
    plate = DISK.constants.thickness
    resonance = float(np.sqrt(plate.c33D.real / DISK.density)) / (2 * DISK.thickness)
    causal = {"disk": recorded(replace(DISK, law=CausalConstantQ(resonance)))}
    result = Stack2DFitter().fit(FitTask(parse_build(BUILD, "build.toml"), causal))
    assert_the_budget_adds_up(result)
    (said,) = (text for text in result.says if text.startswith("Constants at"))
    assert float(said.split()[2]) == pytest.approx(resonance / 1e3, rel=1e-3)
    for name in CONSTANTS:
        true, found = complex(getattr(DISK.constants, name)), result.constants[f"disk.{name}"]
        assert abs(found.re - true.real) < 3 * found.u_re, name


@pytest.mark.long
def test_a_disk_whose_electrodes_end_before_the_rim_is_recovered():
    true = replace(DISK.constants, c11E=1.01 * DISK.constants.c11E, e31=1.04 * DISK.constants.e31)
    sweeps = {"disk": recorded(replace(DISK, constants=true, electrode=0.9))}
    build = parse_build(
        BUILD.replace("thickness_mm = { value = 1.0,", "electrode_diameter_mm = 5.4\nthickness_mm = { value = 1.0,", 1),
        "build.toml",
    )
    result = Stack2DFitter().fit(FitTask(build, sweeps))
    assert result.rms_log_error < 4e-4
    for name in CONSTANTS:
        found = result.constants[f"disk.{name}"]
        assert abs(found.re - complex(getattr(true, name)).real) < 4 * found.u_re, name
    assert result.constants["disk.eps33S"].u_re < 0.002 * result.constants["disk.eps33S"].re


def test_glue_and_layer_that_end_before_the_rim_are_modelled(sweeps):
    text = BUILD.replace('material = "epoxy"', 'material = "epoxy"\ndiameter_mm = 5.4').replace(
        "z_MRayl", "diameter_mm = 5.1\nz_MRayl"
    )
    problem = problem_of(FitTask(parse_build(text, "build.toml"), sweeps))
    values = nominal(problem, TENSOR)
    glued, bare = (stack_of(problem, step, values, CONSTANT) for step in ("ml1", "disk"))
    assert [layer.reach for layer in glued.layers] == pytest.approx([1.0, 0.9, 0.85])
    assert glued.section.reaches == pytest.approx((0.85, 0.9, 1.0))
    assert bare.section.size < 50  # it ends nowhere


@pytest.mark.long
def test_a_ring_is_recovered_and_diagnosed():
    build = parse_build(BUILD.replace("diameter_mm = 6.0", "diameter_mm = 6.0\nhole_diameter_mm = 2.4"), "build.toml")
    task = FitTask(build, {"disk": recorded(DISK, hole=1.2e-3)})
    result = Stack2DFitter().fit(task)
    assert result.converged
    assert result.rms_log_error < 4e-4
    for name in CONSTANTS:
        true, found = complex(getattr(DISK.constants, name)), result.constants[f"disk.{name}"]
        assert abs(found.re - true.real) < 4 * found.u_re, name
        assert abs(found.im - true.imag) < 4 * found.u_im, name
    assert diagnose(task, ("lead-inductance",), fitter=Stack2DFitter()).verdict == "no-mismatch"


@pytest.mark.long
def test_a_glued_ring_is_recovered():
    build = parse_build(BUILD.replace("diameter_mm = 6.0", "diameter_mm = 6.0\nhole_diameter_mm = 2.4"), "build.toml")
    sweeps = {"disk": recorded(DISK, hole=1.2e-3), "ml1": recorded(DISK, GLUE, MATCHING, seed=1, hole=1.2e-3)}
    result = Stack2DFitter().fit(FitTask(build, sweeps))
    assert result.rms_log_error < 5e-4
    for layer in (GLUE, MATCHING):
        for key, true in layer.parameters().items():
            found = result.constants[f"{layer.name}.{key}"]
            assert abs(found.re - true) < 4 * found.u_re, f"{layer.name}.{key}"
    assert result.constants["ml1.c"].u_re < 0.001 * MATCHING.c  # the prior's is 0.06


def test_electrodes_and_layers_of_a_ring_end_outside_its_hole(sweeps):
    def problem(electrode):
        text = BUILD.replace("diameter_mm = 6.0", "diameter_mm = 6.0\nhole_diameter_mm = 4.0")
        text = text.replace("density", f"electrode_diameter_mm = {electrode}\ndensity", 1)
        return problem_of(FitTask(parse_build(text, "build.toml"), sweeps))

    assert part_of_area(problem(5).build) == pytest.approx((25 - 16) / (36 - 16))
    with pytest.raises(TaskError, match=r"electrode_diameter_mm of 'disk' is 4; more than 4, the hole's, is needed"):
        problem(4)


LEAD = """
[[effects]]
effect = "lead-inductance"
where = "terminals"
inductance_H = { value = 1e-6, u = 1e-6 }
resistance_ohm = 0
skin_ohm = 0
capacitance_F = 0
"""


@pytest.mark.long
def test_a_lead_that_the_build_states_is_fitted_with_the_stack(sweeps):
    wire = 2e-6
    led = tuple(replace(one, impedance=one.impedance + 2j * np.pi * F * wire) for one in sweeps["disk"])
    result = Stack2DFitter().fit(FitTask(parse_build(BUILD + LEAD, "build.toml"), {"disk": led}))
    assert result.rms_log_error < 4e-4
    lead = result.constants["lead-inductance@terminals.inductance"]
    assert (lead.unit, lead.re) == ("H", pytest.approx(wire, rel=0.02))
    inside = LEAD.replace("lead-inductance", "electrode-mass").replace("terminals", "face:front")
    inside = inside.split("inductance_H")[0] + "mass_kg_m2 = 0.01\n"
    with pytest.raises(
        TaskError, match=r"stack2d cannot model the effects of build 'S' \(electrode-mass at face:front"
    ):
        problem_of(FitTask(parse_build(BUILD + inside, "build.toml"), {"disk": led}))


def test_the_plate_block_has_exact_derivatives():
    block = plate_block("disk")
    values = np.array([tensor_values("disk", TENSOR)[name] for name in block.parameters])
    x = block.inverse(values)
    made, J = block.forward(x)
    np.testing.assert_allclose(made, values, rtol=1e-9)
    for k, step in enumerate(1e-6 * np.eye(x.size)):
        slope = (block.forward(x + step)[0] - block.forward(x - step)[0]) / 2e-6
        size = np.abs(values).reshape(-1, 2).max(axis=1).repeat(2)
        np.testing.assert_allclose(J[:, k] / size, slope / size, rtol=1e-5, atol=1e-8)


def test_the_objective_has_exact_derivatives(sweeps):
    problem = problem_of(FitTask(parse_build(BUILD, "build.toml"), sweeps))
    values = nominal(problem, TENSOR)
    coordinates = stack_coordinates(problem, ["disk", "ml1"], values)
    assert {"glue1.poisson", "ml1.poisson", "disk.tensor.axial5", "ml1.c"} <= set(coordinates.free)
    assert not any(name.startswith("disk.c33D") for name in coordinates.free)
    model = stack_of(problem, "ml1", values, CONSTANT)
    few = replace(sweeps["ml1"][0], frequency=F[::12], impedance=sweeps["ml1"][0].impedance[::12])
    recording = Recording("ml1", few, model, np.full(few.frequency.size, 1.0))
    objective = Objective([recording], coordinates, stack_priors(problem, ["disk", "ml1"]))
    x = coordinates.x
    J = objective.jacobian(x)
    for k, step in enumerate(1e-4 * np.eye(x.size)):
        slope = (objective.residual(x + step) - objective.residual(x - step)) / 2e-4
        np.testing.assert_allclose(
            J[:, k], slope, atol=2e-4 * max(1.0, np.abs(slope).max()), err_msg=coordinates.free[k]
        )


def test_where_one_dimension_fails_the_fit_starts_from_the_build():
    f = np.linspace(0.05e6, 0.2e6, 30)
    flat = {"disk": (Sweep(f, 1 / (2j * np.pi * f * 2e-10)),)}
    problem = problem_of(FitTask(parse_build(BUILD, "build.toml"), flat))
    assert one_dimensional(problem, lambda _: None)["ml1.z"] == 10.3e6


TAIL = """[electrical]
connection = "series"
[[layers]]
name = "tail"
kind = "piezo"
material = "Pz27"
thickness_mm = 1
"""


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("diameter_mm = 6.0", "area_mm2 = 28.3", "covers round stacks; build 'S' gives an area"),
        ("[load]", f"{TAIL}[load]", "covers one piezoelectric layer; build 'S' has disk, tail"),
        (
            "density_kg_m3 = 7700",
            "electrode_diameter_mm = 2.5",
            r"electrode_diameter_mm of 'disk' is 2.5; `stack2d` covers 3 to 6, the disk's diameter",
        ),
        ("z_MRayl", "diameter_mm = 7\nz_MRayl", r"diameter_mm of 'ml1' is 7; `stack2d` covers 0 to 6, the disk's"),
        (
            "diameter_mm = 6.0",
            "diameter_mm = 6.0\nhole_diameter_mm = { value = 2, u = 0.1 }",
            "hole_diameter_mm has an uncertainty; `stack2d` takes it as exact",
        ),
        (
            "z_MRayl",
            "diameter_mm = { value = 5.5, u = 0.1 }\nz_MRayl",
            "diameter_mm of 'ml1' has an uncertainty; `stack2d` takes it as exact",
        ),
        (
            "density_kg_m3 = 7700",
            "c33D_GPa = { re = 144, u = 3, min = 130, max = 160 }",
            r"cannot bound 'disk.c33D': `stack2d` moves it",
        ),
    ],
)
def test_builds_that_the_model_lacks_are_refused(sweeps, old, new, says):
    assert old in BUILD
    with pytest.raises(TaskError, match=says):
        problem_of(FitTask(parse_build(BUILD.replace(old, new), "build.toml"), {"disk": sweeps["disk"]}))


@pytest.mark.parametrize(
    ("free", "says"),
    [
        (("ml1.z",), "`stack2d` frees all ten constants together; 'disk.c11E' is not among those to free"),
        ((*(f"disk.{name}" for name in CONSTANTS), "disk.h33"), "`stack2d` has it from the ten constants of 'disk'"),
        ((*(f"disk.{name}" for name in CONSTANTS), "ml1.x"), "cannot free 'ml1.x'"),
    ],
)
def test_constants_that_cannot_be_freed_are_named(sweeps, free, says):
    problem = problem_of(FitTask(parse_build(BUILD, "build.toml"), sweeps, free=free))
    with pytest.raises(TaskError, match=says):
        stack_coordinates(problem, ["disk", "ml1"], nominal(problem, TENSOR))


def test_recordings_above_its_reach_are_refused():
    f = np.linspace(5e6, 6e6, 30)
    with pytest.raises(FitError, match=r"`stack2d` reaches up to 3400 kHz for a disk of this thickness"):
        Stack2DFitter().fit(
            FitTask(parse_build(BUILD, "build.toml"), {"disk": (Sweep(f, 1 / (2j * np.pi * f * 1e-9)),)})
        )


def known_disk():
    """Return the disk of the recordings, known to 1e-4, with a lead and a law of losses that change nothing."""
    values = {**tensor_values("disk", DISK.constants), "disk.thickness": 1.001e-3, "disk.density": 7700.0}
    block = plate_block("disk")
    x = block.inverse(np.array([values[name] for name in block.parameters]))
    told = Posterior(tuple(f"disk.{name}" for name in COORDINATES), x, np.eye(x.size) / 1e-4)
    lead = {"inductance": 1e-12, "resistance": 0.0, "skin": 0.0, "capacitance": 0.0}
    law = {"exponent": 0.0, "companion": 0.0}
    beside = tuple(
        EffectSpec(name, where, {key: Quantity(value) for key, value in sizes.items()})
        for name, where, sizes in (("lead-inductance", "terminals", lead), ("loss-dispersion", "layer:disk", law))
    )
    return KnownDisk({**values, "area": np.pi * 3e-3**2}, CONSTANT, told, beside)


def glued(sweeps):
    task = FitTask(parse_build(BUILD, "build.toml"), {"disk": recorded(DISK), "ml1": sweeps})
    return glued_on(known_disk(), task, lambda _: None)


def test_layers_are_found_on_a_known_disk():
    sweeps = recorded(DISK, GLUE, MATCHING, seed=1)
    found = glued(tuple(replace(one, frequency=one.frequency[::2], impedance=one.impedance[::2]) for one in sweeps))
    assert not found.seeds
    objective = found.descent.objective
    values, _ = objective.coordinates.forward(found.descent.x)
    for layer, name in ((GLUE, "glue1"), (MATCHING, "ml1")):
        assert values[f"{name}.thickness"] / values[f"{name}.c"] == pytest.approx(layer.thickness / layer.c, rel=0.05)
    assert values["ml1.z"] == pytest.approx(MATCHING.z, rel=0.02)
