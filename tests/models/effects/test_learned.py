"""Learned corrections: they act at their places, their laws are passive, and the simplest equal catalogue effects."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl.models.base.errors import PzctlError
from pzctl.models.effects import Device, find_effect
from pzctl.models.effects.base.modified_loads import FiniteBackingLoad
from pzctl.models.effects.base.scale import resonance
from pzctl.models.effects.learned.corrections import CONSTANTS, Place, Quantity, places
from pzctl.models.effects.learned.laws import Law, laws
from pzctl.models.effects.learned.learned import LearnedLaw, find_law, learned_law
from pzctl.models.effects.learned.smooth_correction import SmoothCorrection, causal_basis
from pzctl.models.stack import AIR, Elastic, HalfSpace, Piezo

DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 0j, 8.09e-9 * (1 - 0.017j))
GLUED = (HalfSpace("backing", 5e6) | DISK | Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0) | AIR).with_area(7.854e-5)
F = np.linspace(1.5e6, 9e6, 101)
BAND = (1.5e6, 9e6)
EVERY_LAW = [(quantity, law) for quantity in ("stiffness", "permittivity", "series") for law in laws(quantity)]


@pytest.mark.parametrize("place", places(GLUED), ids=lambda place: f"{place.where}-{place.quantity}")
def test_a_correction_at_each_place_changes_the_impedance_and_has_a_derivative(place: Place) -> None:
    device = Device(GLUED).with_effect(SmoothCorrection(place, 0.01, BAND, GLUED), place.where)
    name = f"learned@{place.where}.a0"
    Z, (slope,) = device.jacobian(F, [name])
    np.testing.assert_allclose(Z, GLUED.impedance(F), rtol=1e-12)
    moved = device.replace({name: 0.01}).impedance(F)
    np.testing.assert_allclose((moved / Z - 1) / 0.01, slope, atol=0.02 * float(np.max(np.abs(slope))))
    assert np.max(np.abs(slope)) > 1e-5


def test_a_smooth_correction_is_causal_its_real_part_follows_from_its_imaginary_part() -> None:
    basis = causal_basis(*BAND, 4e6, added=False)
    f = np.linspace(0, 4e9, 2**18)
    g = basis.over(f, np.random.default_rng(1).standard_normal(basis.weights.shape[1]))
    response = np.fft.irfft(g - g[-1].real)
    before, after = response[len(response) // 2 :], response[: len(response) // 2]
    assert np.sum(before[: len(before) // 2] ** 2) < 1e-3 * np.sum(after**2), "nothing answers before it is asked"


def test_a_correction_lacks_what_its_function_has_at_the_reference() -> None:
    """Far above the band nothing relaxes any more: what is left of a correction is what was taken off."""
    values, far = {"size": 0.1, "at": 0.7, "spread": 0.9, "skew": 0.8}, np.array([1e12])
    relaxations = [law for law in laws("permittivity") if law.name in ("debye", "cole-cole", "havriliak-negami")]
    for law in relaxations:
        assert law.taken is not None
        assert law.of(far, values)[0] == pytest.approx(-law.taken(values), rel=1e-6)
    assert len(relaxations) == 3
    basis = causal_basis(*BAND, 4e6, added=False)
    a = np.random.default_rng(2).standard_normal(basis.weights.shape[1])
    assert basis.over(np.array([1e18]), a)[0] == pytest.approx(-basis.taken(a), rel=1e-6)


def _values(law: Law, shares: list[float]) -> dict[str, float]:
    limits = {"size": (1e-3, 1.0), "at": (0.1, 10.0), "q": (1.0, 100.0), "delay": (0.2, 20.0)}
    return {
        knob.name: low + share * (high - low)
        for knob, share in zip(law.parameters, shares, strict=False)
        for low, high in [limits.get(knob.name, (knob.lower, knob.upper))]
    }


@pytest.mark.parametrize("case", EVERY_LAW, ids=lambda case: f"{case[0]}-{case[1].name}")
@settings(max_examples=10)
@given(shares=st.lists(st.floats(0, 1), min_size=4, max_size=4))
def test_every_law_is_passive_for_sizes_above_zero(case: tuple[str, Law], shares: list[float]) -> None:
    quantity, law = case
    x = np.geomspace(0.05, 20.0, 60)
    values = _values(law, shares)
    g = law.of(x, values)
    if quantity not in CONSTANTS:
        assert np.all(g.real >= -1e-9 * np.max(np.abs(g)))
        return
    sign = 1 if quantity == "stiffness" else -1
    assert np.all(sign * (g.imag - _less_at_reference(law, values, sign)) >= -1e-9 * np.max(np.abs(g)))


def _less_at_reference(law: Law, values: dict[str, float], sign: int) -> float:
    """Return the imaginary part of the law where it has no loss; the constant itself contains that of the reference."""
    if law.name == "power":
        n = values["exponent"]
        return -sign * values["size"] / n * float(np.sin(np.pi / 2 * n))
    return float(law.of(np.array([1e200 if law.name != "resonance" else 1e60]), values).imag[0])


def test_a_layer_on_a_face_equals_an_electrode_of_its_mass_and_impedance() -> None:
    """Sound crosses a mass per area m of impedance z in the time m/z."""
    mass, impedance = 0.02, 12e6
    learned = learned_law(Place("face:front", "impedance"), "layer", GLUED)
    values = {"size": 2 * np.pi * learned.reference * mass, "transit": mass / impedance}
    expected = Device(GLUED).with_effect(
        find_effect("electrode-mass"), "face:front", {"mass": mass, "impedance": impedance}
    )
    found = Device(GLUED).with_effect(learned, "face:front", values)
    np.testing.assert_allclose(found.impedance(F), expected.impedance(F), rtol=1e-4)  # air loads its outer face


@pytest.mark.parametrize(
    ("quantity", "law", "effect", "parameter"),
    [
        ("series", "inertance", "lead-inductance", "inductance"),
        ("series", "resistance", "series-resistance", "resistance"),
        ("shunt", "inertance", "stray-capacitance", "capacitance"),
    ],
)
def test_the_simplest_laws_at_the_terminals_equal_catalogue_effects(quantity, law, effect, parameter) -> None:
    place = Place("terminals", quantity)
    learned = learned_law(place, law, GLUED)
    size = 0.3 * learned.natural
    shown = learned.shown({"size": size})
    part = shown[parameter][0] if shown else size
    expected = Device(GLUED).with_effect(find_effect(effect), "terminals", {parameter: part}).impedance(F)
    found = Device(GLUED).with_effect(learned, "terminals", {"size": size}).impedance(F)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert learned.reference == resonance(GLUED)


def test_a_thin_layer_of_glue_is_a_compliance_of_constant_phase() -> None:
    """Without the loss of glue, a compliance alone misses a tenth of what it does."""
    where, thickness, loss = "interface:disk|ml1", 2e-7, 0.1
    glue = {"thickness": thickness, "loss": loss}
    bonded = np.log(Device(GLUED).with_effect(find_effect("bond-layer"), where, glue).impedance(F) / GLUED.impedance(F))
    place = Place(where, "compliance")
    lossy, lossless = (learned_law(place, name, GLUED) for name in ("constant-phase", "inertance"))
    size = 2 * np.pi * lossy.reference * thickness / (2.9e6 * 2550.0)
    exponent = 1 - 2 / np.pi * np.arctan(loss)

    def missed(device: Device) -> float:
        change = np.log(device.impedance(F) / GLUED.impedance(F))
        return float(np.linalg.norm(change - bonded) / np.linalg.norm(bonded))

    assert missed(Device(GLUED).with_effect(lossy, where, {"size": size, "exponent": exponent})) < 0.02
    assert missed(Device(GLUED).with_effect(lossless, where, {"size": size})) > 0.05


def test_a_mass_on_a_part_of_a_face_leaves_the_rest_as_it_is() -> None:
    place, share = Place("face:front", "impedance"), 0.03
    part, whole = learned_law(place, "part-inertance", GLUED), learned_law(place, "inertance", GLUED)
    size = 0.5 * part.natural
    loaded = Device(GLUED).with_effect(whole, place.where, {"size": size}).impedance(F)
    found = Device(GLUED).with_effect(part, place.where, {"share": share, "size": size}).impedance(F)
    np.testing.assert_allclose(1 / found, (1 - share) / GLUED.impedance(F) + share / loaded, rtol=1e-12)
    none = Device(GLUED).with_effect(part, place.where, {"share": 0.0, "size": size})
    np.testing.assert_allclose(none.impedance(F), GLUED.impedance(F), rtol=1e-12)


def test_a_gap_in_a_part_of_a_bond_equals_a_void() -> None:
    place, share = Place("interface:disk|ml1", "compliance"), 0.05
    void = {"fraction": share, "rim": 0.0, "hold": 0.3}
    expected = Device(GLUED).with_effect(find_effect("bond-void"), place.where, void)
    found = Device(GLUED).with_effect(learned_law(place, "part-gap", GLUED), place.where, {"share": share})
    np.testing.assert_allclose(found.impedance(F), expected.impedance(F), rtol=1e-3)  # the void ends in air
    assert np.max(np.abs(found.impedance(F) / GLUED.impedance(F) - 1)) > 0.05


@pytest.mark.parametrize(("law", "fades"), [("echo", 0.0), ("fading-echo", 1.0)])
def test_an_echo_inside_a_backing_is_that_of_a_backing_of_finite_length(law: str, fades: float) -> None:
    echo, delay = 0.3, 1.7e-6
    decay = -fades * float(np.log(echo))
    learned = learned_law(Place("face:back", "load"), law, GLUED)
    found = Device(GLUED).with_effect(learned, "face:back", {"size": echo, "delay": delay}).impedance(F)
    finite = FiniteBackingLoad(
        GLUED.back, strength=echo, delay=delay, decay=decay, exponent=0.0, reference=learned.reference, loss=0.0
    )
    np.testing.assert_allclose(found, replace(GLUED, back=finite).impedance(F), rtol=1e-9)
    in_air = replace(GLUED, back=AIR)
    assert Place("face:back", "load") not in places(in_air), "a face in air has no load for an echo to run in"


def test_two_corrections_of_one_interface_act_together() -> None:
    """To first order, both change the device as each alone does."""
    compliance, inertia = (place for place in places(GLUED) if place.quantity in ("compliance", "inertia"))
    Z = GLUED.impedance(F)

    def change(*at: Place) -> np.ndarray:
        device = Device(GLUED)
        for place in at:
            law = learned_law(place, "resistance", GLUED)
            device = device.with_effect(law, place.where, {"size": 1e-5 * law.natural})
        return np.log(device.impedance(F) / Z)

    for first, second in ((compliance, compliance), (compliance, inertia)):
        np.testing.assert_allclose(change(first, second), change(first) + change(second), atol=1e-6)


def test_the_loss_of_a_viscous_solid_is_a_power_law_of_exponent_one() -> None:
    """Its loss is proportional to frequency, and its stiffness does not depend on it (Kelvin and Voigt)."""
    (power,) = (law for law in laws("stiffness") if law.name == "power")
    x = np.geomspace(0.1, 10.0, 30)
    np.testing.assert_allclose(power.of(x, {"size": 0.01, "exponent": 1.0}), 0.01j * (x - 1), atol=1e-12)
    assert power.parameters[1].upper > 1


def test_two_resonances_are_the_sum_of_both_in_numbers_and_in_words() -> None:
    place = Place("layer:disk", "permittivity")
    one, two = (learned_law(place, name, GLUED) for name in ("resonance", "two-resonances"))
    first, second = {"size": 0.01, "at": 3e6, "q": 30.0}, {"size": 0.006, "at": 5e6, "q": 20.0}
    both = first | {f"{name}_2": value for name, value in second.items()}
    total = one.correction(first)(F) + one.correction(second)(F)
    np.testing.assert_allclose(two.correction(both)(F), total, rtol=1e-12)
    units = {knob.name: knob.unit for knob in two.effect_parameters(GLUED, place.where)}
    assert (units["at_2"], units["size_2"]) == ("Hz", "1")
    says = two.sentence(place.where, {name: (value, 0.1 * value, units[name]) for name, value in both.items()})
    assert says.startswith("The permittivity of disk resonates at 3.0(3)e6 Hz with strength 0.0100(10) and Q 30(3) and")


def test_a_relaxation_is_looked_for_within_the_recorded_band() -> None:
    place = Place("layer:disk", "permittivity")
    effect = LearnedLaw(place, find_law(place, "debye"), GLUED, band=BAND)
    (at,) = (knob for knob in effect.effect_parameters(GLUED, place.where) if knob.name == "at")
    assert (at.lower, at.upper) == BAND
    assert BAND[0] < at.null < BAND[1]


def test_a_sum_is_the_sum_of_its_terms_in_numbers_and_in_words() -> None:
    """A contact of 0.3 ohm and 3 nH: a lead of the catalogue."""
    place, values = Place("terminals", "series"), {"size": 0.3, "size_2": 0.08}
    contact = learned_law(place, "resistance+inertance", GLUED)
    inductance = values["size_2"] / (2 * np.pi * contact.reference)
    lead = {"inductance": inductance, "resistance": 0.3}
    expected = Device(GLUED).with_effect(find_effect("lead-inductance"), "terminals", lead).impedance(F)
    found = Device(GLUED).with_effect(contact, "terminals", values).impedance(F)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    bare = Device(GLUED).with_effect(contact, "terminals", {"size": 0.0, "size_2": 0.08}).impedance(F)
    assert not np.allclose(bare, GLUED.impedance(F)), "a first term of no size leaves the others"
    shown = contact.shown(values)
    assert shown["inductance"] == (pytest.approx(inductance), "H")
    sizes = {name: (value, 0.1 * value, "ohm") for name, value in values.items()}
    says = contact.sentence("terminals", sizes | {"inductance": (inductance, 0.1 * inductance, "H")})
    assert "has a resistance of 0.30(3) ohm and an inertance of 0.080(8) ohm (inductance 2.9(3)e-9 H)" in says


@given(shares=st.lists(st.floats(0, 1), min_size=10, max_size=10))
@pytest.mark.parametrize(
    ("quantity", "name"), [("series", "compliance+debye+rise+inertance"), ("permittivity", "debye+debye+debye")]
)
def test_every_sum_is_passive(quantity: Quantity, name: str, shares: list[float]) -> None:
    law = find_law(Place("layer:disk", quantity), name)
    at, size = 0.1 + 10 * np.array(shares[:5]), np.array(shares[5:])
    values = {
        knob.name: float((at if knob.name.startswith("at") else size)[k % 5]) for k, knob in enumerate(law.parameters)
    }
    g = law.of(np.geomspace(0.05, 20.0, 60), values)
    if law.taken is None:
        assert np.all(g.real >= 0)
    else:
        assert np.all((g + law.taken(values)).imag <= 0)


def test_a_learned_law_is_told_in_the_terms_of_a_workshop() -> None:
    face, bond = Place("face:front", "impedance"), Place("interface:disk|ml1", "compliance")
    mass, echo, spring = (learned_law(face, name, GLUED) for name in ("inertance", "echo", "compliance"))
    w = 2 * np.pi * mass.reference
    assert mass.shown({"size": 0.02 * w}) == {"mass": (pytest.approx(0.02), "kg/m2")}
    assert spring.shown({"size": 5e10 / w}) == {"stiffness": (pytest.approx(5e10), "Pa/m")}
    assert learned_law(bond, "inertance", GLUED).shown({"size": 1e-15 * w}) == {
        "compliance": (pytest.approx(1e-15), "m/Pa")
    }
    values = {"size": 1e6, "delay": 1.362e-5, "echo": 0.3}
    assert echo.shown(values) == {"depth_in_water": (pytest.approx(10.1e-3, rel=1e-3), "m")}
    sizes = {name: (value, 0.01 * value, "1") for name, value in values.items()}
    says = echo.sentence("face:front", sizes | {"depth_in_water": (0.0101, 2e-4, "m")})
    assert "(depth in water 0.0101(2) m)" in says


def test_an_unknown_law_is_one_sentence() -> None:
    with pytest.raises(
        PzctlError, match=r"there is no law 'deby' for the permittivity of disk; .*did you mean 'debye'"
    ):
        learned_law(Place("layer:disk", "permittivity"), "deby", GLUED)
    with pytest.raises(PzctlError, match=r"'echo' in the law 'debye\+echo' is no part of a sum; .*resistance"):
        learned_law(Place("terminals", "series"), "debye+echo", GLUED)
    with pytest.raises(PzctlError, match=r"has 6 parts; at most 5 are allowed"):
        learned_law(Place("terminals", "series"), "+".join(["debye"] * 6), GLUED)
