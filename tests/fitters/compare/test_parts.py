"""The parts of a comparison, each by itself."""

import numpy as np
import pytest

from pzctl.fitters.compare.many import random_effects
from pzctl.fitters.compare.pair import pair_of
from pzctl.fitters.compare.resonances import Resonances, changed
from pzctl.fitters.compare.two_ports import TwoPort, two_ports
from pzctl.models.sweep import Sweep

F = np.linspace(1e5, 1e7, 50)
Z = 20 + 1 / (2j * np.pi * F * 1e-9)


@pytest.mark.parametrize("effect", sorted({one.effect for one in two_ports() if isinstance(one, TwoPort)} - {"gain"}))
def test_what_is_taken_out_gives_back_what_was_before_it_was_put_in(effect: str) -> None:
    put, taken = (one for one in two_ports() if one.effect == effect and isinstance(one, TwoPort))
    values = {size.name: size.value(0.3) for size in put.sizes}
    seen = put.apply(Z, F, values)
    assert np.max(np.abs(seen / Z - 1)) > 1e-4
    np.testing.assert_allclose(taken.apply(seen, F, values), Z, rtol=1e-8)


def test_passive_elements_make_no_energy() -> None:
    for one in two_ports():
        if isinstance(one, TwoPort) and not one.taken and one.effect != "gain":
            values = {size.name: size.value(0.0) for size in one.sizes}
            assert np.all(one.apply(1j * Z.imag, F, values).real > -1e-9), one.effect


def test_a_pole_that_moves_stays_a_branch_of_resistance_inductance_and_capacitance() -> None:
    def branch(f0: float, q: float, c: float) -> np.ndarray:
        s = 1j * F / 1e6
        return s * c / (1 + s / (f0 * q) + (s / f0) ** 2)

    half = 1 / (2 * 50.0)
    pole = np.array([3e6 * complex(-half, np.sqrt(1 - half**2))])
    residue = np.array([2e-3 * 9e6 / 1e6 * pole[0] / 1e6 / (2j * pole[0].imag / 1e6)]) * 1e6
    np.testing.assert_allclose(Resonances(pole, residue).seen(F)[:, 0], branch(3.0, 50.0, 2e-3), rtol=1e-9)
    moved = Resonances(*changed(pole, residue, np.log(1.02), np.log(0.5), np.log(0.9)))
    np.testing.assert_allclose(moved.seen(F)[:, 0], branch(3.06, 25.0, 1.8e-3), rtol=1e-9)


def test_a_finer_grid_is_interpolated_and_says_with_which_error() -> None:
    f = np.linspace(1e5, 1e7, 400)
    fine = Sweep(f, 20 + 1 / (2j * np.pi * f * 1e-9))
    pair = pair_of([Sweep(F, Z)], [fine])
    np.testing.assert_array_equal(pair.frequency, F)
    assert np.all(np.abs(pair.change) < 5 * pair.noise_after)


def test_both_sides_turned_in_their_files_are_compared_as_they_are() -> None:
    pair = pair_of([Sweep(F, -Z)], [Sweep(F, -Z)])
    assert pair.turned == ("inverted", "inverted")
    assert np.all(pair.before.real > 0)


def test_random_effects_find_the_scatter_beside_the_uncertainty() -> None:
    rng = np.random.default_rng(1)
    u = np.full(400, 0.5)
    mean, u_mean, scatter = random_effects(3 + 2 * rng.normal(size=400) + u * rng.normal(size=400), u)
    assert mean == pytest.approx(3, abs=4 * u_mean)
    assert scatter == pytest.approx(2, rel=0.15)
    assert random_effects(np.array([1.0, 1.1]), np.array([0.2, 0.2]))[2] == 0.0
