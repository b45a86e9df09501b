"""A ceramic whose constants change through its thickness, against its wave equation and perturbation theory."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pzctl.models.effects import Device, find_effect
from pzctl.models.effects.base.scale import resonance
from pzctl.models.stack import AIR, VACUUM, Bolt, Elastic, GradedPiezo, HalfSpace, Mass, Piezo, Stack, Strips
from pzctl.models.stack.graded import SLICES

DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 1e7j, 8.09e-9 * (1 - 0.017j))
LAYERS = (Elastic("glue1", 10e-6, 2.9e6, 2550.0, 30.0), Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0))
AREA = np.pi * 5e-3**2
BARE = Stack((DISK,), VACUUM, VACUUM, AREA)
GLUED = Stack((DISK, *LAYERS), AIR, HalfSpace("water", 1.5e6), AREA)
F = np.linspace(1.5e6, 15e6, 31)


def graded(stack: Stack = BARE, **sizes: float) -> Device:
    return Device(stack).with_effect(find_effect("temperature-gradient"), "layer:disk", sizes)


def shooting(f: float, back: float, front: float, **sizes: float) -> complex:
    """Z by integrating u' = (T + h D)/c, T' = -w^2 rho u, V' = D/eps - h u'; loads in Rayl."""
    w, D, t = 2 * np.pi * f, 1e-3, DISK.thickness

    def slope(z: float, y: np.ndarray, charge: float) -> list[complex]:
        depth = z / t - 0.5
        c, h = (
            value * (1 + sizes.get(name, 0.0) * depth)
            for name, value in (("stiffness", DISK.c33D), ("coupling", DISK.h33))
        )
        stretch = (y[1] + h * charge) / c
        return [stretch, -(w**2) * DISK.density * y[0], charge / DISK.eps33S - h * stretch]

    ends = []
    for start, charge in ((1e-9, 0.0), (0.0, D)):
        y = np.array([start, 1j * w * back * start, 0], complex)
        ends.append(solve_ivp(slope, (0, t), y, "DOP853", rtol=1e-11, atol=1e-30, args=(charge,)).y[:, -1])
    free, driven = ends
    pull = -1j * w * front
    share = -(driven[1] - pull * driven[0]) / (free[1] - pull * free[0])
    return complex((driven[2] + share * free[2]) / (1j * w * D * AREA))


@pytest.mark.parametrize(
    ("back", "front", "sizes"),
    [
        (0.0, 0.0, {"stiffness": 0.06}),
        (0.0, 1.5e6, {"coupling": 0.1}),
        (5e6, 1.5e6, {"stiffness": -0.05, "coupling": -0.1}),
    ],
)
def test_a_graded_ceramic_solves_its_wave_equation(back: float, front: float, sizes: dict[str, float]) -> None:
    stack = replace(BARE, back=HalfSpace("rear", back), front=HalfSpace("water", front))
    Z, plain = graded(stack, **sizes).impedance(F), stack.impedance(F)
    expected = np.array([shooting(f, back, front, **sizes) for f in F])
    does = np.max(np.abs(expected / plain - 1))
    assert does > 1e-3
    assert np.max(np.abs(Z / expected - 1)) < 2 / SLICES**2 * does


def test_without_a_gradient_the_slices_are_the_plate() -> None:
    for stack in (BARE, GLUED):
        sliced = replace(stack, layers=(GradedPiezo.of(DISK, 0.0, 0.0), *stack.layers[1:]))
        np.testing.assert_allclose(sliced.impedance(F), stack.impedance(F), rtol=1e-11)


def test_the_second_overtone_is_as_strong_as_perturbation_theory_says() -> None:
    """A plate hardly coupled, at 2 f0, with h33 (1 + g (z/t - 1/2)).

    Mode n of a free plate moves as q cos(n pi z/t), a mass rho t/2 per area. Its voltage -integral of h33 u' is -h g q
    for even n, and by reciprocity a charge per area D drives it with the pressure h g D.
    """
    g, h, Q = 0.1, 1e7, 1e4
    ceramic = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / Q), complex(h), 8.09e-9 + 0j)
    stack = Stack((ceramic,), VACUUM, VACUUM, AREA)
    f2 = 2 * resonance(stack)
    w2 = 2 * np.pi * f2
    f = np.array([f2])
    found = graded(stack, coupling=g).impedance(f) - stack.impedance(f)
    # q = h g D/(rho t/2 j w2^2/Q), and D = 1/(jw A) for a unit current
    expected = -((h * g) ** 2) / (ceramic.density * ceramic.thickness / 2 * 1j * w2**2 / Q) / (1j * w2) / AREA
    assert found[0] == pytest.approx(expected, rel=0.01)
    other = graded(stack, coupling=-g).impedance(f) - stack.impedance(f)
    assert other[0] == pytest.approx(found[0], rel=1e-6)


def test_a_wave_that_keeps_its_energy_hides_a_gradient_of_h33_a_quarter_as_steep_as_that_of_the_stiffness() -> None:
    """Each face sends a wave in proportion to h33 (rho c33D)^(-1/4): even overtones show that these differ."""
    ceramic = replace(DISK, c33D=1.444e11 * (1 + 1e-4j), h33=1e7 + 0j)
    stack = replace(BARE, layers=(ceramic,))
    for overtone in (2, 4):
        f = overtone * resonance(stack) * np.linspace(0.9995, 1.0005, 201)
        stiff, hidden = (
            np.max(np.abs(graded(stack, stiffness=0.04, coupling=coupling).impedance(f) - stack.impedance(f)))
            for coupling in (0.0, 0.01)
        )
        assert hidden < 0.01 * stiff


@pytest.mark.parametrize("strips", [False, True])
def test_derivatives_of_a_graded_layer_are_exact(strips: bool) -> None:
    device = graded(GLUED, stiffness=0.05, coupling=0.2)
    if strips:
        device = device.with_effect(find_effect("thickness-variation"), "layer:disk", {"variance": 3e-6})
    names = list(GLUED.parameters())
    _, slopes = device.jacobian(F, names)
    for name, row in zip(names, slopes, strict=True):
        value = device.parameters()[name]
        h = 1e-5 * (value or 1e6)
        ends = [device.replace({name: value + step}).impedance(F) for step in (h, -h)]
        numeric = np.log(ends[0] / ends[1]) / (2 * h)
        assert np.max(np.abs(row - numeric)) < 1e-6 * np.max(np.abs(row)) + 1e-14 / h, name


def test_strips_and_a_bolt_find_the_other_layers_beside_the_slices() -> None:
    layer = GradedPiezo.of(DISK, 0.05, 0.1)
    stack = replace(GLUED, layers=(layer, *LAYERS))
    for name in ("disk", "ml1"):
        thick = Strips(name, np.array([0.99, 1.02]), np.array([0.3, 0.7])).admittance(stack, F)
        t = stack.parameters()[f"{name}.thickness"]
        each = [stack.replace({f"{name}.thickness": t * factor}).impedance(F) for factor in (0.99, 1.02)]
        np.testing.assert_allclose(thick, 0.3 / each[0] + 0.7 / each[1], rtol=1e-10)
    held = Stack((Mass("a", 2.0), DISK, Mass("b", 3.0)), AIR, AIR, AREA, bolt=Bolt("a", "b", 1e8))
    sliced = replace(held, layers=(held.layers[0], GradedPiezo.of(DISK, 0.0, 0.0), held.layers[2]))
    np.testing.assert_allclose(sliced.impedance(F), held.impedance(F), rtol=1e-10)
