"""The lab world compared with known results for plates, lines, sheets, filters and noise; properties of its plants."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pzctl.models.stack import Elastic, HalfSpace, Piezo
from pzctl.sim.blind_cases.lab.devices.device import _spread, admittance
from pzctl.sim.blind_cases.lab.devices.flaws import NOTHING, FixtureResidue, Flaws
from pzctl.sim.blind_cases.lab.devices.random_specimen import random_specimen
from pzctl.sim.blind_cases.lab.devices.specimen import AIR, LabDevice, lossy
from pzctl.sim.blind_cases.lab.devices.terminals import at_analyzer
from pzctl.sim.blind_cases.lab.draw import FAMILIES, LabSession, draw_case
from pzctl.sim.blind_cases.lab.files import make_case
from pzctl.sim.blind_cases.lab.planting import families, layered
from pzctl.sim.blind_cases.lab.planting.imperfections import imperfections
from pzctl.sim.blind_cases.lab.planting.plant import LabScenario, LabWorld, Plant
from pzctl.sim.blind_cases.lab.planting.visible import ACCURACY, FINDABLE_GAIN, View
from pzctl.sim.blind_cases.lab.recording import ErringAnalyzer, LabSweep, shown
from pzctl.sim.blind_cases.lab.session import plan

OUTSIDE_KINDS = 24


def specimen_of(seed: int, steps: int = 1, backed: bool = False) -> LabDevice:
    return random_specimen(np.random.default_rng(seed), "x", steps, backed, ceramic_only=True)


def grid(s: LabDevice, points: int = 401) -> np.ndarray:
    return np.linspace(0.12, 3.4, points) * s.ceramic.f0


def impedance(s: LabDevice, flaws: Flaws = NOTHING, step: str = "disk", f: np.ndarray | None = None) -> np.ndarray:
    f = grid(s) if f is None else f
    return shown(s, flaws, LabSweep(step, f, seconds=100.0), FixtureResidue())


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_without_flaws_it_equals_the_models_stack(steps: int) -> None:
    s = specimen_of(3, steps, backed=True)
    ceramic = s.ceramic
    row = HalfSpace("back", s.back) | Piezo(
        "disk",
        thickness=ceramic.thickness,
        density=ceramic.density,
        c33D=ceramic.c33D,
        h33=ceramic.h33,
        eps33S=ceramic.eps33S,
    )
    for layer in s.layers:
        row = row | Elastic(layer.name, thickness=layer.thickness, z=layer.z, c=layer.c, q=layer.q)
    theirs = (row | HalfSpace("air", AIR)).with_area(s.area).impedance(grid(s))
    ours = impedance(s, step=s.steps[-1])
    # a lossy layer has a complex z or a complex c; its stiffness is the same
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


def plants() -> list[tuple[Plant, LabDevice]]:
    rng, found = np.random.default_rng(5), list[tuple[Plant, LabDevice]]()
    for _, family in FAMILIES:
        bonded = family in (layered.bond, layered.void, layered.ageing)
        s = specimen_of(8 if bonded else 2, 2 if bonded else 1, backed=family is layered.backing)
        found.append((family(rng, s), s))
    found += [(families.outside(rng, specimen_of(2)), specimen_of(2)) for _ in range(OUTSIDE_KINDS)]
    found += [(plant, specimen_of(8, 2)) for plant in imperfections(rng, specimen_of(8, 2))]
    return found


def recorded(plant: Plant, s: LabDevice, scale: float, points: int = 401) -> np.ndarray:
    world = LabScenario(LabWorld(s), (replace(plant, scale=scale),)).world(plant.steps[-1])
    sweep = LabSweep(
        plant.steps[-1], grid(s, points) if not world.flaws.lateral else grid(s, points)[30:190], seconds=100.0
    )
    return shown(world.specimen, world.flaws, sweep, world.fixture)


@pytest.mark.parametrize(("plant", "s"), plants(), ids=lambda one: getattr(one, "effect", ""))
def test_plants_are_passive_and_vanish_with_their_size(plant: Plant, s: LabDevice) -> None:
    z = recorded(plant, s, 1.0)
    honest = plant.effect not in ("polarity", "temperature-drift") and plant.shape.get("kind") not in (
        *("interference", "mixing", "loose contact"),
    )
    if honest:
        assert np.all(z.real > 0)
    if plant.least < plant.most:
        bare = recorded(plant, s, 0.0)
        whole, little, least = (np.abs(np.log(recorded(plant, s, k) / bare)).max() for k in (1.0, 1e-4, 1e-6))
        assert whole > 1e-7
        at_zero = plant.effect in (
            "bond-layer",
            "finite-backing",
            "loss-dispersion",
        )  # its loss makes it another device
        assert at_zero or least <= little
        assert at_zero or least < 2e-3 * whole + 1e-9


def test_a_short_cable_equals_the_textbooks_line() -> None:
    s = specimen_of(2)
    f = grid(s)
    Y = admittance(f, s, NOTHING, "disk")
    wiring = replace(NOTHING.wiring, delay=4e-9, cable_ohm=75.0)
    turn = np.tan(2 * np.pi * f * 4e-9)
    textbook = 75.0 * (1 / Y + 75j * turn) / (75.0 + 1j / Y * turn)
    np.testing.assert_allclose(at_analyzer(f, Y, wiring, FixtureResidue(), s.ceramic.f0), textbook, rtol=1e-6)


def test_the_resistance_of_an_electrode_equals_its_joule_heat() -> None:
    s, ohm, b = specimen_of(2), 1e-6, 0.1
    f = grid(s)
    plain, fed = (1 / admittance(f, s, flaws, "disk") for flaws in (NOTHING, Flaws(sheet=(ohm, b))))
    # 1 - r^2 of the current flows outwards at r: R = integral of ohm (1 - r^2)^2 / (2 pi r)
    heat = ohm / (2 * np.pi) * (-np.log(b) - (1 - b**2) + (1 - b**4) / 4)
    far = np.abs(plain) < 1e3
    np.testing.assert_allclose((fed - plain)[far].real, heat, rtol=1e-2)


@pytest.mark.parametrize("n", [-0.25, 0.1, 0.35])
def test_causal_loss_is_a_power_of_jw_and_so_analytic(n: float) -> None:
    x = np.geomspace(0.1, 4, 9)
    c = lossy(x, 1e11 * (1 + 0.0125j), n, causal=True)
    analytic = 1 + 0.0125 * ((1j * x) ** n / np.sin(n * np.pi / 2) - 1 / np.tan(n * np.pi / 2))
    np.testing.assert_allclose(c, 1e11 * analytic, rtol=1e-12)
    near = lossy(x, 1e11 * (1 + 0.0125j), 1e-5, causal=True)
    np.testing.assert_allclose(lossy(x, 1e11 * (1 + 0.0125j), 0.0, causal=True), near, rtol=1e-6)


@pytest.mark.parametrize("shape", ["gauss", "triangle", "skew"])
def test_a_spread_of_thickness_has_the_stated_mean_and_deviation(shape: str) -> None:
    factors, weights = _spread(specimen_of(2), Flaws(spread=(("disk", 0.01, shape),)))
    x, w = factors["disk"][:, 0] - 1, np.asarray(weights)[:, 0]
    assert w @ x == pytest.approx(0, abs=1e-12)
    assert np.sqrt(w @ x**2) == pytest.approx(0.01, rel=1e-9)


def test_a_detector_with_two_poles_lags_by_twice_its_time_constant() -> None:
    s = specimen_of(4)
    f = np.linspace(0.8, 1.2, 801) * s.ceramic.f0
    sweep = LabSweep("disk", f, seconds=100.0)
    lag_Hz = 2 * 0.002 * (f[-1] - f[0]) / 100
    late = 1 / shown(s, Flaws(settling=0.002), sweep, FixtureResidue())
    earlier = 1 / shown(s, NOTHING, replace(sweep, frequency=f - lag_Hz), FixtureResidue())
    np.testing.assert_allclose(late[9:], earlier[9:], rtol=1e-3)


def test_noise_has_the_size_and_correlation_of_the_analyzer() -> None:
    analyzer = ErringAnalyzer((1e6, 2e6), noise=3e-4, colour=0.7)
    z = np.full(20001, 100 + 0j)
    error = analyzer.noisy(z, np.random.default_rng(1)) / 100 - 1
    assert np.std(error.real) == pytest.approx(3e-4, rel=0.05)
    assert np.corrcoef(error.real[1:], error.real[:-1])[0, 1] == pytest.approx(0.7, abs=0.03)


@pytest.fixture(scope="module")
def drawn() -> list[LabSession]:
    """Cases of four kinds."""
    return [draw_case(seed, index) for seed, index in ((7, 0), (7, 3), (7, 4), (3, 1))]


def test_analyzers_err_within_their_specification(drawn: list[LabSession]) -> None:
    for case in drawn:
        analyzer = replace(case.analyzer, steps=())
        f = np.geomspace(*analyzer.band, 2001)
        error = np.log(analyzer.error(f, np.full(f.size, 1 + 0j)))
        assert np.sqrt(np.mean(error.real**2)) < 1.02e-3
        assert np.sqrt(np.mean(error.imag**2)) < 1.02e-3


def test_constants_absorb_electrodes_but_not_a_lead_and_the_analyzer_absorbs_a_gain() -> None:
    s = specimen_of(2)
    rng = np.random.default_rng(0)
    sweep = plan(rng, s, ())[0]
    f = np.linspace(0.6, 1.4, 801) * s.ceramic.f0
    sweep = replace(sweep, frequency=f)
    analyzer = ErringAnalyzer((float(f[0]), float(f[-1])))

    def gain(world: LabWorld, k: float) -> LabWorld:
        return world.with_ceramic(eps33S=world.specimen.ceramic.eps33S * (1 + 1e-3 * k))

    hidden, lead = layered.mass(rng, s), families.lead(rng, s)
    for plant, least, most in (
        (hidden, 0.0, 0.02),
        (lead, 0.1, 1.0),
        (Plant("gain", ("any",), s.steps, gain), 0.0, 0.01),
    ):
        scenario = LabScenario(LabWorld(s), (plant,))
        world, bare = scenario.world("disk"), scenario.scaled(0, 0.0).world("disk")
        shift = np.log(
            shown(world.specimen, world.flaws, sweep, FixtureResidue()) / shown(s, bare.flaws, sweep, FixtureResidue())
        )
        left = View(scenario, (sweep,), analyzer).seen(0).moves
        assert least <= left / np.sqrt(np.mean(np.abs(shift) ** 2)) <= most


def test_a_capacitance_that_shifts_a_resonance_by_many_widths_is_absorbed_by_the_constants() -> None:
    s = specimen_of(2)
    sweep = replace(plan(np.random.default_rng(0), s, ())[0], frequency=np.linspace(0.3, 2.4, 201) * s.ceramic.f0)

    def beside(world: LabWorld, k: float) -> LabWorld:
        return world.wired(capacitance=0.08 * k * s.C0)

    scenario = LabScenario(LabWorld(s), (Plant("stray-capacitance", ("terminals",), s.steps, beside),))
    analyzer = ErringAnalyzer((float(sweep.frequency[0]), float(sweep.frequency[-1])))
    assert View(scenario, (sweep,), analyzer).seen(0).gain < FINDABLE_GAIN


def test_the_plant_with_the_largest_change_dominates_and_roles_follow(drawn: list[LabSession]) -> None:
    for case in drawn:
        effects = [k for k, plant in enumerate(case.scenario.plants) if not plant.minor]
        leading = [k for k in range(len(case.seen)) if case.role(k) == "dominating"]
        assert len(leading) <= 1
        for k in leading:
            assert case.seen[k].moves >= max(case.seen[other].moves for other in effects or [k])
            assert case.seen[k].moves >= 3 * ACCURACY
    assert {case.kind for case in drawn} == {"one", "instrument", "imperfect", "outside"}


@pytest.mark.long
def test_cases_are_reproducible_and_do_not_reveal_their_plants(tmp_path: Path) -> None:
    named: list[dict[str, Any]] = []
    for seed, index in ((7, 3), (3, 1)):
        first, again = (make_case(tmp_path / name, seed, index) for name in ("a", "b"))
        assert first == again
        named.append(first)
        folder = tmp_path / "a" / first["name"]
        for path in folder.iterdir():
            assert path.read_bytes() == (tmp_path / "b" / first["name"] / path.name).read_bytes()
        text = (folder / "build.toml").read_text()
        assert not any(one["effect"] in text for one in [*first["findings"], *first["also"]])
    assert make_case(tmp_path / "c", 11, 3) != named[0]
