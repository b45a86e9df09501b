from dataclasses import replace

import numpy as np
import pytest
from complex_ceramic import TENSOR
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from passive_coordinates import (
    is_passive,
    radial_coordinates,
    radial_from_coordinates,
    tensor_from_coordinates,
    thickness_coordinates,
    thickness_from_coordinates,
)

from pzctl.models.constants.passivity import PassivityError, passivity_margin, tensor_coordinates
from pzctl.models.constants.piezo_constants import Radial, Thickness
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.materials import MATERIALS, SHERRIT_RADIAL


def anywhere(count):
    return arrays(np.float64, count, elements=st.floats(-1.5, 1.5))


def constants(material, names):
    return [material.values[name].value for name in names.split()]


PIEZO = [m for m in MATERIALS if m.kind == "piezo"]


@pytest.mark.parametrize("material", PIEZO, ids=lambda m: m.name)
def test_the_library_is_passive(material):
    if {"c33D", "h33", "eps33S"} <= set(material.values):
        assert is_passive(Thickness(*constants(material, "c33D h33 eps33S")).law)
    if {"s11E", "s12E", "d31", "eps33T"} <= set(material.values):
        assert is_passive(Radial(*constants(material, "s11E s12E d31 eps33T")).law)
    if "c11E" in material.values:
        names = "c11E c12E c13E c33E c44E e31 e33 e15 eps11S eps33S"
        assert is_passive(Tensor6mm(*constants(material, names)).law)


def test_table_4_7_with_4_3_of_the_thesis_is_not_passive():
    # c'' as printed has the sign of exp(-jwt), eps'' that of exp(+jwt)
    eps = (859.8075 - 9.7584j) * 8.854e-12
    printed = Thickness(1.5139e11 * (1 - 0.0095j), 19.8617e8 + 0.098e8j, eps)
    assert passivity_margin(printed.law) < -0.005


@given(anywhere(6))
def test_thickness_coordinates_always_give_passive_constants(x):
    values, _ = thickness_from_coordinates(x)
    made = Thickness(*values)
    assert is_passive(made.law)
    assert thickness_coordinates(made) == pytest.approx(x, abs=1e-6)


@given(anywhere(8))
def test_radial_coordinates_always_give_passive_constants(x):
    values, _ = radial_from_coordinates(x)
    made = Radial(*values)
    assert is_passive(made.law)
    assert radial_coordinates(made) == pytest.approx(x, abs=1e-6)


@given(anywhere(20))
@example(x=np.full(20, 5e-324))
def test_tensor_coordinates_always_give_passive_constants(x):
    made = tensor_from_coordinates(x)
    assert is_passive(made.law)


@pytest.mark.parametrize("size", ["thickness", "radial"])
@given(seed=st.integers(0, 10**6))
def test_derivatives_by_the_coordinates_are_exact(size, seed):
    forward, count = {"thickness": (thickness_from_coordinates, 6), "radial": (radial_from_coordinates, 8)}[size]
    x = np.random.default_rng(seed).uniform(-1, 1, count)
    _, slopes = forward(x)
    for k in range(count):
        step = np.zeros(count)
        step[k] = 1e-5
        difference = (forward(x + step)[0] - forward(x - step)[0]) / 2e-5
        assert slopes[:, k] == pytest.approx(difference, rel=1e-7, abs=1e-7 * np.abs(slopes).max())


def test_real_constants_round_trip():
    values, _ = radial_from_coordinates(radial_coordinates(SHERRIT_RADIAL))
    assert values == pytest.approx(
        [SHERRIT_RADIAL.s11E, SHERRIT_RADIAL.s12E, SHERRIT_RADIAL.d31, SHERRIT_RADIAL.eps33T]
    )
    assert passivity_margin(TENSOR.law) > 0.001
    back = tensor_from_coordinates(tensor_coordinates(TENSOR))
    assert list(vars(back).values()) == pytest.approx(list(vars(TENSOR).values()), rel=1e-10)


def test_constants_that_make_energy_have_no_coordinates():
    with pytest.raises(PassivityError, match="one of them is not"):
        radial_coordinates(Radial(17e-12 + 1e-13j, -6e-12, -2e-10, 2.7e-8 - 1e-10j))


def test_a_stiffness_without_an_inverse_has_no_coordinates():
    with pytest.raises(PassivityError, match="no inverse"):
        tensor_coordinates(replace(TENSOR, c44E=0j))


def test_a_loss_that_a_fit_has_driven_to_nothing_gets_the_least_one():
    lossless = Tensor6mm(*(complex(getattr(TENSOR, name)).real + 0j for name in CONSTANTS))
    with pytest.raises(PassivityError):
        tensor_coordinates(lossless)
    again = tensor_from_coordinates(tensor_coordinates(lossless, least=1e-7))
    assert 0 < passivity_margin(again.law) < 1e-6
    assert again.c33E.real == pytest.approx(lossless.c33E.real, rel=1e-9)
    np.testing.assert_array_equal(tensor_coordinates(TENSOR, least=1e-7), tensor_coordinates(TENSOR))
