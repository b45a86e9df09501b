"""Unit tests of the parts of a comparison."""

import numpy as np
import pytest

from pzctl.fitters.compare.known_changes.device_changes import NewResonance, device_changes
from pzctl.fitters.compare.known_changes.two_ports import TwoPort, coil, two_ports
from pzctl.fitters.compare.levels.amplitude_law import bent
from pzctl.fitters.compare.many import random_effects
from pzctl.fitters.compare.pair import pair_of
from pzctl.fitters.compare.resonances import Resonances, changed, fitted_poles, resonances_of
from pzctl.models.sweep import Sweep

F = np.linspace(1e5, 1e7, 50)
Z = 20 + 1 / (2j * np.pi * F * 1e-9)


@pytest.mark.parametrize("effect", sorted({one.effect for one in two_ports() if isinstance(one, TwoPort)} - {"gain"}))
def test_removing_an_inserted_element_restores_the_original(effect: str) -> None:
    put, taken = (one for one in two_ports() if one.effect == effect and isinstance(one, TwoPort))
    values = {size.name: size.value(0.3) for size in put.sizes}
    seen = put.apply(Z, F, values)
    assert np.max(np.abs(seen / Z - 1)) > 1e-4
    np.testing.assert_allclose(taken.apply(seen, F, values), Z, rtol=1e-8)


def test_passive_elements_do_not_generate_energy() -> None:
    for one in two_ports():
        if isinstance(one, TwoPort) and not one.taken and one.effect != "gain":
            values = {size.name: size.value(0.0) for size in one.sizes}
            assert np.all(one.apply(1j * Z.imag, F, values).real > -1e-9), one.effect


def test_a_resistance_is_no_lead_and_no_coil() -> None:
    for effect in ("lead-inductance", "series-coil"):
        one = next(one for one in two_ports() if one.effect == effect)
        assert isinstance(one, TwoPort)
        assert one.possible is not None
        values = {size.name: size.value(0.0) for size in one.sizes} | {"inductance": 1e-7}
        assert one.possible(F, values | {"resistance": 1.0})
        assert not one.possible(F, values | {"resistance": 10.0}), "2 pi 10 MHz 0.1 uH is 6 ohm"


def test_an_inductance_of_many_metres_of_wire_is_a_coil() -> None:
    lead = next(one for one in two_ports() if one.effect == "lead-inductance")
    assert isinstance(lead, TwoPort)
    assert lead.possible is not None
    assert [lead.possible(F, {"inductance": L, "resistance": 0.1}) for L in (1e-6, 7e-6)] == [True, False]


def test_a_cable_has_the_impedance_of_cables() -> None:
    cable = next(one for one in two_ports() if one.effect == "cable")
    assert isinstance(cable, TwoPort)
    assert cable.possible is not None
    assert [cable.possible(F, {"impedance": ohm}) for ohm in (7.0, 50.0, 300.0)] == [False, True, True]


def test_a_coil_has_its_inductance_in_the_middle_of_the_band_whatever_its_core() -> None:
    middle = float(np.sqrt(F[0] * F[-1]))
    values = {"inductance": 1e-5, "own capacitance": 0.0, "resistance": 0.1, "skin": 0.2}
    for core in ({"core": 0.0, "core loss": 0.0, "core part": 1.0}, {"core": 0.1, "core loss": 0.2, "core part": 0.5}):
        f = np.array([F[0], middle, F[-1]])
        assert coil(f, values | core)[1].imag / (2 * np.pi * middle) == pytest.approx(1e-5, rel=1e-9)


def test_a_bent_resonance_has_the_amplitude_that_bends_it() -> None:
    f, q = np.linspace(0.9e6, 1.05e6, 400), 80.0
    pole = 1e6 * (-1 / (2 * q) + 1j * np.sqrt(1 - 1 / (4 * q**2)))
    linear = Resonances(np.array([pole]), np.array([1e3 * pole / (1j * pole.imag)]))
    softening, loss, exponent = 5e-3, 0.4, 1.3
    (bare,) = (branch[:, 0] for branch in bent(linear, f, (0.0, 0.0, 1.0), (1.0, 0.0))[:1])
    (bowed,) = (branch[:, 0] for branch in bent(linear, f, (softening, loss, exponent), (1.0, 0.0))[:1])
    amplitude = np.abs(bowed) / f / np.max(np.abs(bare) / f)
    reactance = abs(pole) ** 2 / (2 * abs(linear.residues[0])) / f
    change = loss / np.abs(linear.residues[0] / pole.real) + 2j * softening * reactance
    np.testing.assert_allclose(1 / bowed, 1 / bare + change * amplitude**exponent, rtol=1e-7)


def test_a_shifted_pole_remains_an_rlc_branch() -> None:
    def branch(f0: float, q: float, c: float) -> np.ndarray:
        s = 1j * F / 1e6
        return s * c / (1 + s / (f0 * q) + (s / f0) ** 2)

    half = 1 / (2 * 50.0)
    pole = np.array([3e6 * complex(-half, np.sqrt(1 - half**2))])
    residue = np.array([2e-3 * 9e6 / 1e6 * pole[0] / 1e6 / (2j * pole[0].imag / 1e6)]) * 1e6
    np.testing.assert_allclose(Resonances(pole, residue).seen(F)[:, 0], branch(3.0, 50.0, 2e-3), rtol=1e-9)
    moved = Resonances(*changed(pole, residue, np.log(1.02), np.log(0.5), np.log(0.9)))
    np.testing.assert_allclose(moved.seen(F)[:, 0], branch(3.06, 25.0, 1.8e-3), rtol=1e-9)


@pytest.mark.parametrize("q", [50.0, 0.4])
def test_a_new_resonance_is_a_branch_of_inductance_capacitance_and_resistance(q: float) -> None:
    pair = pair_of([Sweep(F, Z)], [Sweep(F, Z)])
    new = next(
        one
        for one in device_changes(pair, Resonances(np.zeros(0, complex), np.zeros(0, complex)))
        if isinstance(one, NewResonance)
    )
    after, _ = new.act(Z, new.resonances, F, {"frequency": 3e6, "Q": q, "strength": 2.0})
    L = 1 / (2 * np.pi * 3e6 * 2.0 * new.scale)
    branch = 2j * np.pi * F * L + 1 / (2j * np.pi * F / ((2 * np.pi * 3e6) ** 2 * L)) + 2 * np.pi * 3e6 * L / q
    np.testing.assert_allclose(1 / after - 1 / Z, 1 / branch, rtol=1e-9)


def test_interpolation_to_a_finer_grid_states_its_error() -> None:
    f = np.linspace(1e5, 1e7, 400)
    fine = Sweep(f, 20 + 1 / (2j * np.pi * f * 1e-9))
    pair = pair_of([Sweep(F, Z)], [fine])
    np.testing.assert_array_equal(pair.frequency, F)
    assert np.all(np.abs(pair.change) < 5 * pair.noise_after)


def sharp(f: np.ndarray, q: float) -> np.ndarray:
    """Return the impedance in ohm of 1 nF with a resonance at 1 MHz."""
    return 1 / (2j * np.pi * f * (1e-9 + 5e-11 / (1 - (f / 1e6) ** 2 + 1j * f / 1e6 / q)))


def test_a_resonance_between_the_points_is_interpolated_as_a_pole() -> None:
    f, g = np.linspace(0.7e6, 1.3e6, 201), np.linspace(0.72e6, 1.28e6, 161)
    pair = pair_of([Sweep(f, sharp(f, 500.0))], [Sweep(g, sharp(g, 500.0))])
    assert pair.frequency.size == g.size
    assert np.max(np.abs(pair.change)) < 1e-3, "its width is two thirds of a step"


@pytest.mark.parametrize(("q", "resolved"), [(200.0, True), (600.0, False)])
def test_only_a_resonance_as_wide_as_a_step_is_taken_to_change_by_itself(q: float, resolved: bool) -> None:
    f = np.linspace(0.7e6, 1.3e6, 201)
    sweep = Sweep(f, sharp(f, q))
    pair = pair_of([sweep], [sweep])
    own = resonances_of(fitted_poles(f, pair.before, pair.noise_before), f, pair.before)
    assert own.q == pytest.approx([q], rel=0.01)
    assert ("one-resonance" in [one.effect for one in device_changes(pair, own)]) == resolved


def test_changes_have_the_names_and_places_of_the_design() -> None:
    f = np.linspace(0.7e6, 1.3e6, 201)
    pair = pair_of([Sweep(f, sharp(f, 200.0))], [Sweep(f, sharp(f, 200.0))])
    own = resonances_of(fitted_poles(f, pair.before, pair.noise_before), f, pair.before)
    terminals = ("shunt-inductance", "series-capacitance", "gain", "lead-inductance", "cable", "polarity")
    device = ("frequency-shift", "damping-change", "coupling-change", "new-resonance")
    assert {(name, "terminals") for name in terminals} <= {(one.effect, one.where) for one in two_ports()}
    assert {(name, "layer:device") for name in device} <= {(one.effect, one.where) for one in device_changes(pair, own)}


def test_two_inverted_recordings_are_compared_unchanged() -> None:
    pair = pair_of([Sweep(F, -Z)], [Sweep(F, -Z)])
    assert pair.turned == ("inverted", "inverted")
    assert np.all(pair.before.real > 0)


def test_random_effects_separate_scatter_from_uncertainty() -> None:
    rng = np.random.default_rng(1)
    u = np.full(400, 0.5)
    mean, u_mean, scatter = random_effects(3 + 2 * rng.normal(size=400) + u * rng.normal(size=400), u)
    assert mean == pytest.approx(3, abs=4 * u_mean)
    assert scatter == pytest.approx(2, rel=0.15)
    assert random_effects(np.array([1.0, 1.1]), np.array([0.2, 0.2]))[2] == 0.0
