"""For any coordinates, the constants are physical and the derivatives are correct."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pzctl.fitters.engine.parameters.coordinates import Coordinates, positive, thickness_constants

DISK = thickness_constants("disk")
anywhere = st.tuples(
    st.floats(23.0, 27.0),  # ln c'
    st.floats(-10.0, 0.0),  # ln 1/Q
    st.floats(-6.0, 6.0),  # h' in 1e9 V/m
    st.floats(-20.0, 20.0),  # angle: any real number
    st.floats(-24.0, -16.0),  # ln eps'
    st.floats(-8.0, 0.0),  # ln tan d
).map(np.array)


@given(anywhere)
def test_thickness_constants_are_passive_everywhere(x: NDArray[np.float64]) -> None:
    c_re, c_im, _, h_im, e_re, e_im = DISK.forward(x)[0]
    beta_im = (1 / complex(e_re, e_im)).imag
    assert c_re > 0
    assert c_im > 0
    assert e_re > 0
    assert beta_im > 0
    assert c_im * beta_im - h_im**2 >= -1e-12 * c_im * beta_im  # Holland's condition


@given(anywhere)
def test_thickness_constants_derivatives(x: NDArray[np.float64]) -> None:
    values, J = DISK.forward(x)
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        numeric = (DISK.forward(x + step)[0] - DISK.forward(x - step)[0]) / 2e-6
        scale = np.maximum(np.abs(J[:, k]), np.abs(values)) + 1e-30
        np.testing.assert_allclose(J[:, k] / scale, numeric / scale, atol=1e-7)


@given(anywhere.filter(lambda x: abs(x[3]) < 1.4))
def test_thickness_constants_round_trip(x: NDArray[np.float64]) -> None:
    values, _ = DISK.forward(x)
    np.testing.assert_allclose(DISK.inverse(values), x, rtol=1e-9, atol=1e-9)


def test_only_free_coordinates_move() -> None:
    start = {"ml1.z": 10e6, "ml1.thickness": 1e-4}
    coordinates = Coordinates((positive("ml1.z"), positive("ml1.thickness")), start, ("ml1.thickness",))
    values, J = coordinates.forward(coordinates.x + np.log(2))
    np.testing.assert_allclose(values["ml1.z"], 10e6)
    np.testing.assert_allclose(values["ml1.thickness"], 2e-4)
    np.testing.assert_allclose(J, [[0.0], [2e-4]])


def test_a_size_of_zero_has_a_coordinate_without_a_warning() -> None:
    size = positive("lead-inductance@terminals.resistance")
    with np.errstate(divide="raise"):
        assert size.forward(size.inverse(np.zeros(1)))[0] == 0
