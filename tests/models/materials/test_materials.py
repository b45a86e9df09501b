import numpy as np
import pytest

from pzctl.models.constants.piezo_constants import EPS0, Radial, Thickness
from pzctl.models.materials import MATERIALS, MaterialError, find
from pzctl.models.materials.temperature import WATER_SPEED


def thickness_of(material):
    return Thickness(*(material.values[name].value for name in ("c33D", "h33", "eps33S")))


def radial_of(material):
    return Radial(*(material.values[name].value for name in ("s11E", "s12E", "d31", "eps33T")))


def test_pz27_equals_the_data_sheet_of_the_thesis():
    pz27 = find("pz-27")
    assert pz27.name == "Pz27"
    assert pz27.values["eps33S"].re == pytest.approx(913.73 * EPS0)
    assert thickness_of(pz27).kt.real == pytest.approx(0.4695, abs=2e-4)
    assert thickness_of(pz27).Qm == pytest.approx(80)
    assert radial_of(pz27).sigma_p.real == pytest.approx(0.3892, abs=5e-5)
    assert radial_of(pz27).kp.real == pytest.approx(0.59, abs=0.005)


# kt, kp, sigma_p as stated by the sources or derived from them
@pytest.mark.parametrize(
    ("name", "kt", "kp", "sigma"),
    [("Pz27 Bergen", 0.469, 0.585, 0.361), ("PIC255", 0.487, 0.664, 0.418)],
)
def test_couplings_of_full_sets(name, kt, kp, sigma):
    material = find(name)
    assert thickness_of(material).kt.real == pytest.approx(kt, abs=1e-3)
    assert radial_of(material).kp.real == pytest.approx(kp, abs=1e-3)
    assert radial_of(material).sigma_p.real == pytest.approx(sigma, abs=1e-3)


def test_sherrits_sample_has_both_couplings():
    sample = radial_of(find("Sherrit radial"))
    assert sample.kp.real == pytest.approx(0.5827, abs=2e-4)
    assert sample.kp_IEEE.real == pytest.approx(0.5945, abs=2e-4)
    assert sample.c11p == pytest.approx(6.829e10 * (1 + 0.01614j), rel=5e-4)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: m.name)
def test_every_value_has_a_source_and_is_passive(material):
    for name, value in material.values.items():
        assert value.source, name
        assert "recalled" not in value.source, name
        assert np.isfinite([value.re, value.im, value.u, value.u_im]).all()
        if name.startswith("c") and material.kind == "piezo":
            assert value.re > 0
            assert value.im >= 0
        if name.startswith("eps"):
            assert value.im <= 0
    if "q" in material.values:
        v = material.values
        assert v["z"].re == pytest.approx(v["density"].re * v["c"].re, rel=1e-9)


def test_an_unknown_name_gets_its_neighbours():
    with pytest.raises(MaterialError, match=r"'PZ72' is not known: did you mean Pz27.*pzctl materials"):
        find("PZ72")
    with pytest.raises(MaterialError, match=r"'nope' is not known: `pzctl materials` lists them all"):
        find("nope")


# Ranges of kt and kp that makers of each Navy type print (American Piezo Ceramics, CTS)
@pytest.mark.parametrize(
    ("name", "kt", "kp"),
    [
        ("PZT-4", (0.48, 0.52), (0.58, 0.60)),
        ("PZT-8", (0.46, 0.49), (0.50, 0.58)),
        ("PZT-5A Erturk", (0.48, 0.51), (0.60, 0.65)),
        ("PZT-5H Erturk", (0.50, 0.55), (0.63, 0.75)),
    ],
)
def test_complete_sets_have_the_couplings_of_their_type(name, kt, kp):
    material = find(name)
    assert kt[0] <= thickness_of(material).kt.real <= kt[1]
    assert kp[0] - 0.02 <= radial_of(material).kp.real <= kp[1]


def test_a_rotated_cut_of_lithium_niobate_is_the_usual_transducer_plate():
    plate = find("LiNbO3 36Y")
    mode = thickness_of(plate)
    assert mode.kt.real == pytest.approx(0.49, abs=0.015)
    assert mode.speed(plate.values["density"].re).real == pytest.approx(7340, rel=0.01)


def test_the_z_cut_follows_from_three_constants():
    assert thickness_of(find("LiNbO3 Z")).c33D.real == pytest.approx(227.9e9 + 1.77**2 / (26.3 * EPS0))
    assert thickness_of(find("LiNbO3 Z")).h33.real == pytest.approx(1.77 / (26.3 * EPS0))


def test_pz26_gives_back_the_other_half_of_its_data_sheet():
    """The sheet prints stiffness, compliance, coupling and both permittivities; any two of them determine the rest."""
    pz26 = find("Pz26")
    printed = {"c33D": 158e9, "s11E": 13.0e-12, "s12E": -4.35e-12, "d31": -128e-12, "eps33T": 1330 * EPS0}
    for name, value in printed.items():
        assert pz26.values[name].re == pytest.approx(value, rel=0.011), name
    assert thickness_of(pz26).kt.real == pytest.approx(0.471, rel=0.005)
    assert radial_of(pz26).kp.real == pytest.approx(0.568, rel=0.01)


def test_pmn_pt_couples_as_published():
    assert thickness_of(find("PMN-33PT")).kt.real == pytest.approx(0.64, rel=0.02)


def test_temperature_coefficients_have_uncertainty_and_source():
    with_slopes = [material for material in MATERIALS if material.temperature]
    assert {"water", "air", "PIC255", "PIC155", "LiNbO3 36Y", "LiNbO3 Z"} == {one.name for one in with_slopes}
    for material in with_slopes:
        for name, slope in material.temperature.items():
            assert name in material.values
            assert 0 < slope.u < abs(slope.re) < 0.01
            assert slope.source
    water = find("water")
    assert WATER_SPEED(20) == pytest.approx(water.values["c"].re, rel=1e-4)
    assert water.temperature["c"].re == pytest.approx((WATER_SPEED(26) / WATER_SPEED(24) - 1) / 2, rel=2e-3)


def test_lithium_niobate_softens_along_its_axis_as_its_constants_say():
    """Z-cut: c33D = c33E + e33^2/eps33S, so that its slope is the mean of theirs by their shares."""
    c33E, e33, eps33 = 227.90e9, 1.77, 26.3 * EPS0
    share = e33**2 / eps33 / (c33E + e33**2 / eps33)
    expected = (1 - share) * -1.53e-4 + share * (2 * 8.87e-4 - 6.27e-4)
    assert find("LiNbO3 Z").temperature["c33D"].re == pytest.approx(expected, rel=1e-4)
