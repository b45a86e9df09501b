"""Several piezo layers in a build: wiring and polarity against closed forms, fits, diagnosis, what stays open."""

from collections.abc import Callable

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitError, FitResult, FitTask, TaskError
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.layered.nelder_mead import MasonNelderMead
from pzctl.fitters.layered.nlopt_global import NloptGlobal
from pzctl.models.base.arrays import Complexes, Frequencies, Impedances
from pzctl.models.sweep import Sweep

AREA, DENSITY = 200e-6, 7700.0
C33D, H33, EPS33S = 1.5e11 * (1 + 0.012j), 1.95e9 * (1 + 0.002j), 8.4e-9 * (1 - 0.015j)
METAL_Z, METAL_C, METAL_Q = 17e6, 6300.0, 900.0
MASS = 10e-3
LOOK_ALIKES = ("prestress-bolt", "electrode-mass")
"""Effects similar to a bolt."""

PLATE = """
[[layers]]
name = "{name}"
kind = "piezo"
material = {material}
polarity = {polarity}
thickness_mm = {thickness}
density_kg_m3 = 7700
"""
SAME = '{ same_as = "p1" }'


def plates(polarities: tuple[int, ...], connection: str, *, thickness: str = "1.0", tied: bool = True) -> str:
    """The text of a build of glueless plates, all of one ceramic if `tied`."""
    layers = [
        PLATE.format(
            name=f"p{k}",
            material=SAME if tied and k > 1 else '"Pz27"',
            polarity=polarity,
            thickness=thickness if k == 1 else SAME if tied else thickness,
        ).replace("density_kg_m3 = 7700\n", "" if tied and k > 1 else "density_kg_m3 = 7700\n")
        for k, polarity in enumerate(polarities, 1)
    ]
    names = ", ".join(f'"p{k}"' for k in range(1, 1 + len(polarities)))
    return (
        f'name = "stack"\narea_mm2 = 200\n{"".join(layers)}\n[electrical]\nconnection = "{connection}"\n'
        f'[load]\nback = "vacuum"\nfront = "vacuum"\n[[steps]]\nname = "whole"\nlayers = [{names}]\n'
    )


def langevin() -> str:
    """The text of a symmetric sandwich: two plates of opposite polarity, in parallel, between two equal masses."""
    mass = (
        '[[layers]]\nname = "{}"\nkind = "elastic"\nz_MRayl = {{ value = 17.0, u = 0.2 }}\nc_m_s = {{ value = 6350, '
        "u = 60 }}\nq = {{ value = 800, u = 300 }}\nthickness_mm = 10\n"
    )
    text = plates((1, -1), "parallel", thickness="2.0").replace('["p1", "p2"]', '["tail", "p1", "p2", "head"]')
    head, rest = text.split("[[layers]]", 1)
    before, after = rest.split("[electrical]")
    follower = mass.format("head").replace("{ value = 17.0, u = 0.2 }", '{ same_as = "tail" }')
    follower = follower.replace("{ value = 6350, u = 60 }", '{ same_as = "tail" }')
    follower = follower.replace("{ value = 800, u = 300 }", '{ same_as = "tail" }')
    return f"{head}{mass.format('tail')}[[layers]]{before}{follower}[electrical]{after}"


def free_plate(f: Frequencies, thickness: float) -> Impedances:
    """A free plate by its textbook formula (Onoe, Tiersten and Meitzler, JASA 35 (1963) 36)."""
    X = np.pi * f * thickness / np.sqrt(C33D / DENSITY)
    Z: Complexes = (1 - H33**2 * EPS33S / C33D * np.tan(X) / X) * thickness / (2j * np.pi * f * EPS33S * AREA)
    return Z


def half_sandwich(f: Frequencies, thickness: float) -> Impedances:
    """A plate clamped at one face, with a mass at the other.

    u = A sin kx, T = c du/dx - h D; where T = -Z v at the mass: Z_el = [t/eps - h^2 tan kt/(w (Zp - Zm tan kt tan
    km lm))] / (jw area). Its antiresonance is Langevin's equation, tan kt tan km lm = Zp/Zm.
    """
    w = 2 * np.pi * f
    root = np.sqrt(DENSITY * C33D)
    stiff = METAL_Z * METAL_C * (1 + 1j / METAL_Q)
    metal = np.sqrt(METAL_Z / METAL_C * stiff)
    tan_p, tan_m = np.tan(w * thickness * DENSITY / root), np.tan(w * MASS * (METAL_Z / METAL_C) / metal)
    inner = thickness / EPS33S - H33**2 * tan_p / (w * (root - metal * tan_p * tan_m))
    Z: Complexes = inner / (1j * w * AREA)
    return Z


def recorded(f: Frequencies, Z: Impedances, noise: float = 1e-4) -> Sweep:
    rng = np.random.default_rng(3)
    return Sweep(f, Z * np.exp(noise * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))), id="r")


def with_constants(text: str) -> Callable[[Frequencies], Impedances]:
    """The impedance of a build's only step with the constants of the closed forms."""
    build = parse_build(text)
    stack = stack_of(build, build.steps[0])
    values: dict[str, float] = {}
    for layer in build.layers:
        if layer.kind == "piezo":
            constants = {"c33D": C33D, "h33": H33, "eps33S": EPS33S}
            values |= {f"{layer.name}.{name}.re": value.real for name, value in constants.items()}
            values |= {f"{layer.name}.{name}.im": value.imag for name, value in constants.items()}
        else:
            values |= {f"{layer.name}.z": METAL_Z, f"{layer.name}.c": METAL_C, f"{layer.name}.q": METAL_Q}
    return stack.replace(values).impedance


def test_two_alternating_plates_in_parallel_have_half_the_frequency_and_four_times_the_capacitance() -> None:
    f = np.linspace(0.1e6, 3e6, 700)
    Z = with_constants(plates((1, -1), "parallel"))(f)
    np.testing.assert_allclose(Z, free_plate(f, 2e-3) / 4, rtol=1e-10)


def test_a_multilayer_stack_in_parallel_has_the_field_of_its_voltage_in_every_layer() -> None:
    """With many thin layers E, not D, is the same everywhere: Y = jw n A/t (eps + e^2/cE tan X/X).

    X = w L/2 sqrt(rho/cE), e = h eps, cE = c - h^2 eps.
    """
    n, f = 40, np.linspace(5e3, 60e3, 200)
    Z = with_constants(plates(tuple((-1) ** k for k in range(n)), "parallel"))(f)
    e, cE = H33 * EPS33S, C33D - H33**2 * EPS33S
    X = np.pi * f * n * 1e-3 * np.sqrt(DENSITY / cE)
    Y = 2j * np.pi * f * n * AREA / 1e-3 * (EPS33S + e**2 / cE * np.tan(X) / X)
    np.testing.assert_allclose(Z, 1 / Y, rtol=0.03)
    assert np.median(np.abs(Z * Y - 1)) < 1e-3


def test_plates_poled_alike_in_series_are_one_thicker_plate() -> None:
    f = np.linspace(0.1e6, 3e6, 700)
    Z = with_constants(plates((1, 1, 1), "series"))(f)
    np.testing.assert_allclose(Z, free_plate(f, 3e-3), rtol=1e-10)


def test_opposite_polarity_in_series_silences_the_fundamental() -> None:
    """The plates pull against each other: the half-wave of both together has no net voltage (a bimorph's plates)."""
    f = np.array([np.sqrt(C33D.real / DENSITY) / 4e-3])
    capacitor = 2e-3 / (2j * np.pi * f * EPS33S * AREA)
    alike, opposite = (with_constants(plates((1, p), "series"))(f) / capacitor - 1 for p in (1, -1))
    assert np.abs(alike) > 10
    assert np.abs(opposite) < 1


def test_a_langevin_sandwich_is_its_half_twice_and_resonates_by_langevins_equation() -> None:
    f = np.linspace(20e3, 400e3, 900)
    np.testing.assert_allclose(with_constants(langevin())(f), half_sandwich(f, 2e-3) / 2, rtol=1e-9)


def fit_plates(text: str, fitter: Mason | NloptGlobal | MasonNelderMead | None = None) -> FitResult:
    f = np.linspace(0.3e6, 4e6, 301)
    sweep = recorded(f, free_plate(f, 2e-3) / 4)
    return (fitter or Mason()).fit(FitTask(parse_build(text), {"whole": (sweep,)}))


@pytest.mark.parametrize("fitter", [Mason(), NloptGlobal(seconds=20)])
def test_a_stack_of_two_plates_of_one_ceramic_is_fitted_to_its_noise(fitter: Mason | NloptGlobal) -> None:
    result = fit_plates(plates((1, -1), "parallel"), fitter)
    assert result.chi2_per_dof < 1.3
    for name, true in (("c33D", C33D), ("h33", H33), ("eps33S", EPS33S)):
        first, second = result.constants[f"p1.{name}"], result.constants[f"p2.{name}"]
        assert (first.re, first.im) == (second.re, second.im)
        assert first.u_re
        assert first.u_im
        assert abs(first.re - true.real) < 4 * first.u_re
        assert abs(first.im - true.imag) < 4 * first.u_im
    assert not any("p2." in sentence for sentence in result.says)


def test_what_a_symmetric_stack_cannot_tell_apart_is_said_with_the_remedy() -> None:
    result = fit_plates(plates((1, -1), "parallel", tied=False))
    (sentence,) = [says for says in result.says if "cannot tell p1 from p2" in says]
    assert "the mean of " in sentence
    assert 'write material = { same_as = "p1" } for p2' in sentence


@pytest.mark.long
@pytest.mark.parametrize(
    ("polarities", "connection", "right"),
    [((1, 1), "parallel", "parallel, polarity +1 -1"), ((1, 1), "series", "parallel, polarity +1 -1")],
)
def test_a_wrong_wiring_is_named(polarities: tuple[int, ...], connection: str, right: str) -> None:
    f = np.linspace(0.3e6, 4e6, 201)
    sweep = recorded(f, free_plate(f, 2e-3) / 4)
    result = Mason().fit(FitTask(parse_build(plates(polarities, connection)), {"whole": (sweep,)}))
    assert f"with {right} the RMS log error is" in result.says[0]


def test_a_connection_that_does_not_fit_the_capacitance_is_named() -> None:
    f = np.linspace(0.3e6, 4e6, 201)
    text = plates((1, -1, 1), "parallel")
    sweep = recorded(f, with_constants(text)(f))
    task = FitTask(parse_build(text.replace("parallel", "series")), {"whole": (sweep,)})
    with pytest.raises(FitError, match=r"connected the other way it would be .* correct \[electrical\] connection"):
        Mason().fit(task)


@pytest.mark.long
def test_a_langevin_sandwich_is_fitted_and_its_lead_is_found() -> None:
    f = np.linspace(20e3, 400e3, 201)
    Z = half_sandwich(f, 2e-3) / 2
    fitted = Mason().fit(FitTask(parse_build(langevin()), {"whole": (recorded(f, Z),)}))
    assert fitted.chi2_per_dof < 1.3
    assert fitted.constants["head.c"].re == pytest.approx(METAL_C, rel=1e-3)
    lead = recorded(f, Z + 2j * np.pi * f * 2e-7)
    diagnosis = diagnose(
        FitTask(parse_build(langevin()), {"whole": (lead,)}), ("cable", "lead-inductance", "prestress-bolt")
    )
    (found,) = diagnosis.findings
    assert found.effect in {"lead-inductance", "cable"}, "so far below its waves a cable is an inductance"
    assert found.parameters["inductance"].value == pytest.approx(2e-7, rel=0.03)


def test_a_bolt_is_told_from_the_stiffness_of_the_ceramic_by_the_overtones() -> None:
    bolted = langevin() + '[bolt]\nbetween = ["tail", "head"]\nstiffness_N_m = { value = 3e8, u = 1.5e8 }\n'
    f = np.linspace(20e3, 900e3, 801)
    true = parse_build(bolted.replace("value = 3e8", "value = 4e8"))
    sweep = recorded(f, stack_of(true, true.steps[0]).impedance(f))
    result = Mason().fit(FitTask(parse_build(bolted), {"whole": (sweep,)}))
    assert result.chi2_per_dof < 1.3
    stiffness = result.constants["bolt.stiffness"]
    assert stiffness.u_re
    assert stiffness.unit == "N/m"
    assert abs(stiffness.re - 4e8) < 4 * stiffness.u_re
    assert stiffness.u_re < 0.1 * 4e8


@pytest.mark.long
def test_a_bolt_that_the_build_omits_is_found() -> None:
    f = np.linspace(20e3, 600e3, 201)
    true = parse_build(langevin() + '[bolt]\nbetween = ["tail", "head"]\nstiffness_N_m = 4e8\n')
    sweep = recorded(f, stack_of(true, true.steps[0]).impedance(f))
    diagnosis = diagnose(FitTask(parse_build(langevin()), {"whole": (sweep,)}), LOOK_ALIKES)
    (found,) = diagnosis.findings
    assert (found.effect, found.where) == ("prestress-bolt", "interface:tail|head")
    assert "joins tail and head" in found.says


def test_the_staged_baseline_refuses_several_piezo_layers() -> None:
    with pytest.raises(TaskError, match="fits a single piezo layer; build 'stack' has p1, p2: use mason"):
        fit_plates(plates((1, -1), "parallel"), MasonNelderMead())


def test_a_tied_constant_can_neither_be_freed_nor_held_alone() -> None:
    text = plates((1, -1), "parallel")
    with pytest.raises(TaskError, match=r"cannot free 'p2.c33D': it is tied to p1.c33D; free that"):
        Mason().fit(FitTask(parse_build(text), {"whole": (recorded(*_sample()),)}, ("p2.c33D",)))


def _sample() -> tuple[Frequencies, Impedances]:
    f = np.linspace(0.3e6, 4e6, 201)
    return f, free_plate(f, 2e-3) / 4
