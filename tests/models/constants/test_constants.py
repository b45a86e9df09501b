import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.models.constants.constitutive import ConstitutiveLaw, convert
from pzctl.models.constants.piezo_constants import EPS0, Radial, Thickness, clamped_permittivity
from pzctl.models.constants.tensor import Tensor6mm, TensorError
from pzctl.models.materials import SHERRIT_RADIAL, find

FORMS = ("strain_E", "stress_E", "strain_D", "stress_D")
ROUNDING = 1e-12


def lossy(low, high, sign):
    """A real size and a loss angle: c (1 + j/Q) for sign +1, s or eps (1 - j tan d) for sign -1."""
    return st.builds(lambda re, loss: complex(re, sign * re * loss), st.floats(low, high), st.floats(0, 0.2))


thickness = st.builds(Thickness.from_coupling, lossy(1e10, 3e11, 1), lossy(0.01, 0.8, -1), lossy(4e-11, 5e-8, -1))
radial = st.builds(
    Radial.from_planar, lossy(1e10, 3e11, 1), lossy(0.05, 0.5, -1), lossy(0.01, 0.8, -1), lossy(4e-11, 5e-8, -1)
)


def close(one, other):
    return all(abs(getattr(one, k) - getattr(other, k)) <= ROUNDING * abs(getattr(one, k)) for k in vars(one))


@given(thickness)
def test_thickness_round_trips_through_every_form(t):
    assert close(t, Thickness.from_e_form(t.c33E, t.e33, t.eps33S))
    assert close(t, Thickness.from_d_form(t.s33E, t.d33, t.eps33X))
    assert close(t, Thickness.from_g_form(t.s33D, t.g33, t.eps33X))
    assert close(t, Thickness.from_coupling(t.c33D, t.kt, t.eps33S))


@given(radial)
def test_radial_round_trips_through_every_form(r):
    assert close(r, Radial.from_planar(r.c11p, r.sigma_p, r.kp, r.eps33T))
    assert close(r, Radial.from_sherrit(r.c11p, r.sigma_p, r.kp_IEEE, r.eps33p))
    assert close(r, Radial.from_e_form(r.c11p, r.c12p, r.e31p, r.eps33p))
    assert close(r, Radial.from_g_form(r.s11D, r.s12D, r.g31, r.eps33T))
    assert close(r, Radial.from_h_form(r.c11pD, r.c12pD, r.h31p, r.eps33p))


@given(radial)
def test_the_two_planar_couplings_differ(r):
    assert r.kp_IEEE**2 == pytest.approx((1 + r.sigma_p) / 2 * r.kp**2 / (1 - r.kp**2), rel=1e-10)
    assert r.eps33p == pytest.approx(r.eps33T * (1 - r.kp**2), rel=1e-10)


# The scalars above and the matrices below are two derivations of the same physics.
@given(thickness)
def test_thickness_scalars_are_the_one_by_one_law(t):
    expected = {
        "strain_E": (t.c33E, t.e33, t.eps33S),
        "stress_E": (t.s33E, t.d33, t.eps33X),
        "strain_D": (t.c33D, t.h33, t.eps33S),
        "stress_D": (t.s33D, t.g33, t.eps33X),
    }
    for form, numbers in expected.items():
        law = convert(t.law, form)
        assert [law.elastic[0, 0], law.piezo[0, 0], law.dielectric[0, 0]] == pytest.approx(numbers, rel=1e-11)


@given(radial)
def test_radial_scalars_are_the_planar_law(r):
    expected = {
        "strain_E": (r.c11p, r.c12p, r.e31p, r.eps33p),
        "strain_D": (r.c11pD, r.c12pD, r.h31p, r.eps33p),
        "stress_D": (r.s11D, r.s12D, r.g31, r.eps33T),
    }
    for form, numbers in expected.items():
        law = convert(r.law, form)
        found = [law.elastic[0, 0], law.elastic[0, 1], law.piezo[0, 0], law.dielectric[0, 0]]
        assert found == pytest.approx(numbers, rel=1e-9)


def full_tensor(draw_losses):
    c = [147e9, 105e9, 93.7e9, 113e9, 23e9]
    e, eps = [-3.09, 16.0, 11.64], [1130 * EPS0, 914 * EPS0]
    signs = [1] * 5 + [-1] * 5
    return Tensor6mm(*(v * (1 + 1j * s * x) for v, s, x in zip(c + e + eps, signs, draw_losses, strict=True)))


@given(st.lists(st.floats(0, 0.1), min_size=10, max_size=10), st.permutations(FORMS))
def test_tensor_round_trips_through_all_forms(losses, order):
    tensor = full_tensor(losses)
    law = tensor.law
    for form in order:
        law = convert(law, form)
    assert close(tensor, Tensor6mm.from_law(law))


@given(st.lists(st.floats(0, 0.1), min_size=10, max_size=10))
def test_tensor_matrices_are_consistent(losses):
    t = full_tensor(losses)
    for left, right in (
        (t.cE @ t.sE, np.eye(6)),
        (t.cD @ t.sD, np.eye(6)),
        (t.d, t.e @ t.sE),
        (t.e, t.epsS @ t.h),
        (t.d, t.epsT @ t.g),
        (t.h, t.g @ t.cD),
        (t.epsT - t.epsS, t.d @ t.e.T),
        (t.cD - t.cE, t.e.T @ t.h),
        (t.sE - t.sD, t.d.T @ t.g),
    ):
        assert np.abs(left - right).max() <= 1e-11 * np.abs(right).max()


@given(st.lists(st.floats(0, 0.1), min_size=10, max_size=10))
def test_clamped_permittivity_carries_both_couplings_exactly(losses):
    t = full_tensor(losses)
    assert clamped_permittivity(t.radial.eps33T, t.radial.kp, t.thickness.kt) == pytest.approx(t.eps33S, rel=1e-10)


def test_the_formula_of_the_thesis_omits_the_planar_coupling():
    t = full_tensor([0.0] * 10)
    assert (t.radial.eps33T * (1 - t.thickness.kt**2)).real / EPS0 == pytest.approx(1403, abs=1)
    assert clamped_permittivity(t.radial.eps33T, t.radial.kp, t.thickness.kt).real / EPS0 == pytest.approx(914)


def test_published_couplings_of_sherrits_sample():
    assert SHERRIT_RADIAL.kp_IEEE.real == pytest.approx(0.5945, abs=1e-4)
    assert SHERRIT_RADIAL.kp.real == pytest.approx(0.5827, abs=1e-4)
    assert SHERRIT_RADIAL.sigma_p == pytest.approx(0.3753 * (1 - 0.00664j), abs=1e-4)


def test_quality_and_loss_tangent_follow_from_constants():
    pz27 = find("Pz27").values
    t = Thickness(*(pz27[name].value for name in ("c33D", "h33", "eps33S")))
    assert (t.Qm, t.tan_delta) == pytest.approx((80, 0.017))
    assert math.isinf(Thickness(1e11, 1e9, 1e-8).Qm)
    assert t.speed(7700).real == pytest.approx(4331, rel=1e-3)


def test_a_law_of_another_symmetry_is_refused():
    law = full_tensor([0.0] * 10).law
    skew = law.elastic.copy()
    skew[0, 0] *= 1.01
    with pytest.raises(TensorError, match=r"stiffness matrix departs from the symmetry 6mm by 0\.0"):
        Tensor6mm.from_law(ConstitutiveLaw("strain_E", skew, law.piezo, law.dielectric))
