"""Effects that are looked for only if they are named: each against a device that has them in another way."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.models.effects import Conditions, Device, catalogue, find_effect, outside_effects
from pzctl.models.effects.base.scale import resonance
from pzctl.models.stack import AIR, Elastic, HalfSpace, Piezo, Stack
from pzctl.models.stack.radiation import Piston

DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 0j, 8.09e-9 * (1 - 0.017j))
GLUE = Elastic("glue1", 10e-6, 2.9e6, 2550.0, 30.0)
ML1 = Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0)
WATER = HalfSpace("water", 1.48e6)
AREA = 7.854e-5
GLUED = Stack((DISK, GLUE, ML1), AIR, AIR, AREA)
WET = Stack((DISK,), AIR, WATER, AREA)
F = np.linspace(1.5e6, 9e6, 101)


def seen(name: str, where: str, stack: Stack, level: float = 0.5, **values: float) -> np.ndarray:
    device = Device(stack, conditions=Conditions(level_V=level))
    return device.with_effect(find_effect(name), where, values).impedance(F)


def test_they_are_in_the_catalogue_but_no_diagnosis_tries_them_unnamed() -> None:
    named = {effect.name for effect in catalogue() if effect.only_named}
    assert {"fixture-residual", "analyzer-error", "vessel-echo", "partial-layer", "curing"} <= named
    assert not named & {effect.name for effect in outside_effects()}


def test_a_fixtures_residual_is_a_lead_behind_a_stray_capacitance() -> None:
    parts = {"inductance": 3e-9, "resistance": 0.02, "capacitance": 4e-13}
    stray = Device(GLUED).with_effect(find_effect("stray-capacitance"), "terminals", {"capacitance": 4e-13})
    lead = stray.with_effect(find_effect("lead-inductance"), "terminals", {"inductance": 3e-9, "resistance": 0.02})
    np.testing.assert_allclose(seen("fixture-residual", "terminals", GLUED, **parts), lead.impedance(F), rtol=1e-9)
    bare = GLUED.impedance(F)
    np.testing.assert_allclose(seen("fixture-residual", "terminals", GLUED, resistance=-0.05), bare - 0.05, rtol=1e-12)


def test_a_forgotten_port_extension_is_a_line_of_50_ohm_at_the_device() -> None:
    """Against a ladder of short pieces, and for one much shorter than the wavelength against the sum of these."""
    delay, pieces, jw = 2e-9, 20000, 2j * np.pi * F
    Z = GLUED.impedance(F)
    for _ in range(pieces):
        half = Z + jw * 50 * delay / pieces / 2
        Z = half / (1 + half * jw * delay / pieces / 50) + jw * 50 * delay / pieces / 2
    Z = Z / (1 + 1e-5 * Z) + 0.1
    found = seen("fixture-residual", "terminals", GLUED, delay=delay, conductance=1e-5, resistance=0.1)
    np.testing.assert_allclose(found, Z, rtol=1e-7)
    short = 1e-11
    lumped = seen("fixture-residual", "terminals", GLUED, inductance=50 * short, capacitance=short / 50)
    line = seen("fixture-residual", "terminals", GLUED, delay=short)
    change = np.max(np.abs(line / GLUED.impedance(F) - 1))
    assert np.max(np.abs(line / lumped - 1)) < 0.01 * change


def test_an_analyzers_error_is_the_same_part_of_any_impedance() -> None:
    for stack in (GLUED, WET):
        wrong = seen("analyzer-error", "sweep", stack, gain=0.01, phase=0.02) / stack.impedance(F)
        np.testing.assert_allclose(np.log(wrong), 0.01 + 0.02j * F / resonance(stack), rtol=1e-9)


def test_an_echo_of_a_vessel_is_that_of_a_layer_of_water_before_a_wall() -> None:
    strength, depth = 0.3, 10.1e-3
    wall = HalfSpace("wall", WATER.z * (1 - strength) / (1 + strength))
    layer = Elastic("water", depth, WATER.z, 1483.0, 1e9)
    found = seen("vessel-echo", "face:front", WET, strength=strength, delay=2 * depth / 1483.0)
    np.testing.assert_allclose(found, Stack((DISK, layer), AIR, wall, AREA).impedance(F), rtol=1e-6)
    says = find_effect("vessel-echo").sentence("face:front", {"delay": (2 * depth / 1483.0, 1.4e-7, "s")})
    assert says.endswith("In water, it would be 10.10(10) mm away.")
    assert find_effect("vessel-echo").places(GLUED) == ()


def test_a_narrow_front_radiates_as_a_piston() -> None:
    radius, c = 1e-3, 1483.0
    expected = replace(WET, front=Piston("water", WATER.z, c, radius)).impedance(F)
    narrowness = c / (4 * np.pi * radius * resonance(WET))
    found = seen("piston-radiation", "face:front", WET, narrowness=narrowness)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("where", ["layer:ml1", "layer:glue1"])
def test_beside_a_layer_the_face_vibrates_as_without(where: str) -> None:
    kept = GLUED.layers[: [layer.name for layer in GLUED.layers].index(where.removeprefix("layer:"))]
    bare = replace(GLUED, layers=kept)
    expected = 0.9 / GLUED.impedance(F) + 0.1 / bare.impedance(F)
    np.testing.assert_allclose(1 / seen("partial-layer", where, GLUED, fraction=0.1), expected, rtol=1e-9)
    assert find_effect("partial-layer").places(GLUED) == ("layer:glue1", "layer:ml1")
    plate = Device(Stack((DISK,), AIR, AIR, AREA))  # the step before the layer was glued on has none
    found = plate.with_effect(find_effect("partial-layer"), where, {"fraction": 0.1}).impedance(F)
    np.testing.assert_allclose(found, plate.impedance(F), rtol=1e-12)


def test_a_void_closes_with_the_level() -> None:
    where = "interface:disk|glue1"
    for level in (0.1, 1.0):
        now = seen("closing-void", where, GLUED, level, fraction=0.1, closing=2.0)
        void = seen("bond-void", where, GLUED, fraction=0.1 * np.exp(-2.0 * level), rim=0.0)
        np.testing.assert_allclose(now, void, rtol=1e-12)


def test_cured_glue_has_another_stiffness_and_loss_at_the_same_density() -> None:
    harder = replace(GLUE, z=GLUE.z * np.sqrt(1.44), c=GLUE.c * np.sqrt(1.44), q=GLUE.q / 0.5)
    expected = replace(GLUED, layers=(DISK, harder, ML1)).impedance(F)
    np.testing.assert_allclose(seen("curing", "layer:glue1", GLUED, stiffness=0.44, loss=-0.5), expected, rtol=1e-12)


def test_glue_is_thicker_in_its_meniscus() -> None:
    thicker = replace(GLUED, layers=(DISK, replace(GLUE, thickness=50e-6), ML1))
    expected = 0.95 / GLUED.impedance(F) + 0.05 / thicker.impedance(F)
    found = seen("glue-meniscus", "layer:glue1", GLUED, fraction=0.05, thickness=40e-6)
    np.testing.assert_allclose(1 / found, expected, rtol=1e-9)
    assert find_effect("glue-meniscus").places(GLUED) == ("layer:glue1",)


def test_permittivity_rises_with_the_field_and_loses_as_rayleigh_says() -> None:
    """Far below the resonance the source reaches the device whole, and the field is the voltage over the thickness."""
    f, a, level = np.array([1e4]), 1e-6, 1.0
    field = np.sqrt(2) * level / DISK.thickness
    device = Device(Stack((DISK,), AIR, AIR, AREA), conditions=Conditions(level_V=level))
    found = device.with_effect(find_effect("field-nonlinearity"), "layer:disk", {"permittivity": a}).impedance(f)
    eps = DISK.eps33S * (1 + a * field * (1 - 4j / (3 * np.pi)))
    expected = Stack((replace(DISK, eps33S=eps),), AIR, AIR, AREA).impedance(f)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    low = replace(device, conditions=Conditions(level_V=0.01))
    calm = low.with_effect(find_effect("field-nonlinearity"), "layer:disk", {"permittivity": a}).impedance(f)
    assert abs(calm / low.impedance(f) - 1) < 0.02 * abs(found / device.impedance(f) - 1)
