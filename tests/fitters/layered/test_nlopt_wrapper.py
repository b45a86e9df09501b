"""The wrapper hides the pitfalls of NLopt."""

import numpy as np
import pytest

from pzctl.fitters.interface import FitError
from pzctl.fitters.layered.nlopt_wrapper import Algorithm, Box, search

ALGORITHMS: tuple[Algorithm, ...] = ("CRS2_LM", "ESCH", "DIRECT_L", "MLSL+LBFGS")
BOX = Box(("a", "b"), np.array([-3.0, -3.0]), np.array([3.0, 3.0]), np.array([1.0, 2.0]))


def slope(x):
    """Himmelblau's function: four minima of depth zero."""
    a, b = x[0] ** 2 + x[1] - 11, x[0] + x[1] ** 2 - 7
    return a**2 + b**2, np.array([4 * a * x[0] + 2 * b, 2 * a + 4 * b * x[1]])


def cost(x):
    return slope(x)[0]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_every_algorithm_stays_within_bounds_and_is_reproducible(algorithm):
    box = Box(BOX.names, BOX.low, np.array([5.0, 5.0]), BOX.start)
    found = [search(algorithm, cost, slope, box, 4000, 30.0, seed=3) for _ in range(2)]
    assert found[0].value < 0.1
    assert np.all((box.low <= found[0].x) & (found[0].x <= box.high))
    np.testing.assert_array_equal(found[0].x, found[1].x)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_error_in_the_objective_is_passed_through(algorithm):
    calls = []

    def broken(x):
        calls.append(x)
        if len(calls) > 5:
            raise KeyError("ml1.z")
        return slope(x)

    with pytest.raises(KeyError, match=r"ml1\.z"):
        search(algorithm, lambda x: broken(x)[0], broken, BOX, 1000, 30.0, seed=1)
    assert len(calls) == 6  # nothing was evaluated afterwards


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_undefined_regions_of_the_objective_are_avoided(algorithm):
    def holed(x):
        value, gradient = slope(x)
        return (np.nan, gradient) if x[0] < 0 else (value, gradient)

    found = search(algorithm, lambda x: holed(x)[0], holed, BOX, 3000, 30.0, seed=1)
    assert found.x[0] >= 0
    assert found.value < 1.0


def test_a_perfect_answer_is_not_a_failure():
    # the minimum is reached exactly, where NLopt may end with "round-off limited" and no answer
    found = search("MLSL+LBFGS", lambda x: abs(x[0]), lambda x: (float(x @ x), 2 * x), BOX, 500, 10.0, seed=1)
    assert found.value < 1e-12


def test_bad_bounds_and_hopeless_objectives_are_said():
    outside = Box(("disk.c33D", "b"), BOX.low, BOX.high, np.array([4.0, 0.0]))
    with pytest.raises(FitError, match=r"disk\.c33D starts at 4; its bounds are -3 to 3"):
        search("CRS2_LM", cost, slope, outside, 100, 10.0, seed=1)
    with pytest.raises(FitError, match="no number anywhere inside the bounds"):
        search("CRS2_LM", lambda _: np.nan, lambda x: (np.nan, x), BOX, 100, 10.0, seed=1)
