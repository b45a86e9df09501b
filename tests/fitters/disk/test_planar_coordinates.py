"""For any coordinates, radial constants are those of a stable and passive material, and derivatives are correct."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pzctl.fitters.disk.disk_coordinates import both_modes_constants
from pzctl.fitters.disk.radial_coordinates import radial_constants_block
from pzctl.fitters.engine.parameters.coordinates import Block
from pzctl.models.constants.passivity import passivity_margin
from pzctl.models.constants.piezo_constants import Radial, Thickness

RADIAL, BOTH = radial_constants_block("disk"), both_modes_constants("disk")
ANYWHERE = (-5.0, 5.0)
radial_x = st.tuples(
    st.floats(-27, -23), st.floats(-9, 0), st.floats(*ANYWHERE), st.floats(*ANYWHERE), st.floats(-3, 3),
    st.floats(*ANYWHERE), st.floats(-20, -16), st.floats(-9, 0),
).map(np.array)  # fmt: skip
both_x = st.tuples(
    st.floats(24.5, 26.5), st.floats(-7, -1), st.floats(0.5, 3), st.floats(-1.4, 1.4), st.floats(-20, -18),
    st.floats(-7, -1), st.floats(25, 27), st.floats(-7, -1), st.floats(24, 26), st.floats(-7, -1), st.floats(-5, 5),
    st.floats(-1.4, 1.4),
).map(np.array)  # fmt: skip


_NORMAL = 1e-290
"""Below this size, the difference of two neighbouring constants is a subnormal number without accurate digits."""


def constants(values: NDArray[np.float64]) -> list[complex]:
    return [complex(re, im) for re, im in values.reshape(-1, 2)]


def check_slopes(block: Block, x: NDArray[np.float64], s11E: int) -> None:
    """Index of `s11E` among the constants; s12E is next, a difference of numbers of that size."""
    values, J = block.forward(x)
    sizes = np.abs(constants(values))
    sizes[s11E + 1] = max(sizes[s11E], sizes[s11E + 1])
    for k in range(x.size):
        step = np.zeros(x.size)
        step[k] = 1e-5
        numeric = (block.forward(x + step)[0] - block.forward(x - step)[0]) / 2e-5
        size = np.repeat(sizes, 2) + np.abs(J[:, k]) + _NORMAL
        np.testing.assert_allclose(J[:, k] / size, numeric / size, atol=2e-7)


@given(radial_x)
def test_radial_constants_are_stable_and_passive(x: NDArray[np.float64]) -> None:
    found = Radial(*constants(RADIAL.forward(x)[0]))
    assert found.s11E.real > abs(found.s12E.real)
    assert 2 * found.d31.real**2 < found.eps33T.real * (found.s11E + found.s12E).real * (1 + 1e-12)
    assert passivity_margin(found.law) >= -1e-9


@given(radial_x)
def test_derivatives_of_radial_constants(x: NDArray[np.float64]) -> None:
    check_slopes(RADIAL, x, 0)


@given(both_x)
def test_constants_of_both_modes_are_passive(x: NDArray[np.float64]) -> None:
    c33D, h33, eps33S, s11E, s12E, d31 = constants(BOTH.forward(x)[0])
    assert passivity_margin(Thickness(c33D, h33, eps33S).law) >= -1e-9
    eps33p = 1 / (1 / eps33S - h33**2 / c33D)
    if s11E.real > abs(s12E.real) and eps33p.real > 0:  # stable as well
        found = Radial(s11E, s12E, d31, eps33p + 2 * d31**2 / (s11E + s12E))
        assert passivity_margin(found.law) >= -1e-7


@given(both_x)
def test_derivatives_of_constants_of_both_modes(x: NDArray[np.float64]) -> None:
    check_slopes(BOTH, x, 3)


@pytest.mark.parametrize(
    ("block", "x"),
    [
        (RADIAL, [-25.0, -4.0, 0.3, 0.4, 0.8, 0.5, -18.0, -4.0]),
        (BOTH, [25.7, -4.5, 2.0, 0.3, -18.6, -4.2, 25.2, -4.4, 24.6, -4.3, -10.0, 0.4]),
    ],
)
def test_coordinates_round_trip(block: Block, x: list[float]) -> None:
    np.testing.assert_allclose(block.inverse(block.forward(np.array(x))[0]), x, atol=1e-9)
