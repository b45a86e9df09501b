"""Each effect's physics compared with independent code: circuits, wave equations, integrals, laws."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, quad_vec, solve_ivp
from scipy.optimize import brentq

from pzctl.models.effects import Conditions, Device, find_effect
from pzctl.models.effects.base.scale import acoustic_impedance, resonance
from pzctl.models.stack import (
    AIR,
    VACUUM,
    CausalConstantQ,
    Elastic,
    HalfSpace,
    Mass,
    Piezo,
    PowerLoss,
    Spring,
    Stack,
    Support,
)

F = np.linspace(1.5e6, 15e6, 60)
W = 2 * np.pi * F
AREA = np.pi * 5e-3**2
DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 1e7j, 8.09e-9 * (1 - 0.017j))
GLUE, ML1 = Elastic("glue1", 10e-6, 2.9e6, 2550.0, 30.0), Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0)
WATER = HalfSpace("water", 1.5e6)
BARE = Stack((DISK,), AIR, AIR, AREA)
GLUED = Stack((DISK, GLUE, ML1), AIR, WATER, AREA)


def added(name: str, where: str, stack: Stack = BARE, conditions: Conditions | None = None, **values: float) -> Device:
    return Device(stack, conditions=conditions or Conditions()).with_effect(find_effect(name), where, values)


def close(Z: np.ndarray, expected: np.ndarray, tolerance: float = 1e-11) -> None:
    assert np.max(np.abs(Z / expected - 1)) < tolerance


def shooting(h, f: float, mass_back: complex = 0.0, mass_front: complex = 0.0, front: float = 0.0, cuts=()) -> complex:
    """Z of a disk with h33(z), by integrating u' = (T + h D)/c, T' = -w^2 rho u, V' = D/eps - h u'."""
    w, D, t = 2 * np.pi * f, 1e-3, DISK.thickness

    def slope(z: float, y: np.ndarray, charge: float) -> list[complex]:
        u, T = y[0], y[1]
        stretch = (T + h(z) * charge) / DISK.c33D
        return [stretch, -(w**2) * DISK.density * u, charge / DISK.eps33S - h(z) * stretch]

    ends = []
    for start, charge in ((1e-9, 0.0), (0.0, D)):
        y = np.array([start, -(w**2) * mass_back * start, 0], complex)
        for a, b in zip((0.0, *cuts), (*cuts, t), strict=True):
            run = solve_ivp(slope, (a, b), y, "DOP853", rtol=1e-11, atol=1e-30, args=(charge,))
            y = run.y[:, -1]
        ends.append(y)
    free, driven = ends  # at the front T = (w^2 m - jw Z) u
    pull = w**2 * mass_front - 1j * w * front
    share = -(driven[1] - pull * driven[0]) / (free[1] - pull * free[0])
    return complex((driven[2] + share * free[2]) / (1j * w * D * AREA))


def test_terminal_effects_are_the_circuits_of_their_names() -> None:
    Z = BARE.impedance(F)
    wire = added("series-resistance", "terminals", resistance=0.3, skin=0.1).impedance(F)
    close(wire, Z + 0.3 + 0.1 * (1 + 1j) * np.sqrt(F / 1e6))
    close(added("stray-capacitance", "terminals", capacitance=3e-12).impedance(F), Z / (1 + 1j * W * 3e-12 * Z))
    close(added("leakage", "terminals", conductance=1e-5).impedance(F), 1 / (1 / Z + 1e-5))


def test_a_cable_equals_a_ladder_of_short_pieces() -> None:
    length, Z0, n = 0.8, 60.0, 20000
    Z = BARE.impedance(F)
    L, C = Z0 / 2e8 * length / n, length / n / (Z0 * 2e8)
    for _ in range(n):
        half = Z + 0.5j * W * L
        Z = half / (1 + 1j * W * C * half) + 0.5j * W * L
    close(added("cable", "terminals", inductance=Z0 * length / 2e8, impedance=Z0).impedance(F), Z, 1e-7)


def test_leads_stray_and_cable_are_in_physical_order() -> None:
    """In parallel with the device, then the wire, then the cable, in whatever order they were found."""
    device = Device(BARE)
    for name, knob, value in (
        ("cable", "inductance", 1.25e-7),
        ("lead-inductance", "inductance", 3e-8),
        ("stray-capacitance", "capacitance", 5e-12),
    ):
        device = device.with_effect(find_effect(name), "terminals", {knob: value})
    inner = 1 / (1 / BARE.impedance(F) + 1j * W * 5e-12) + 1j * W * 3e-8
    T = 1j * np.tan(W / 2e8 * 0.5)
    close(device.impedance(F), 50 * (inner + 50 * T) / (50 + inner * T))


@pytest.mark.parametrize(("front", "where"), [(1.0, "front"), (0.0, "back"), (0.3, "both")])
def test_a_dead_layer_solves_the_wave_equation(front: float, where: str) -> None:
    depth, t = 8e-6, DISK.thickness
    low, high = (1 - front) * depth, t - front * depth
    cuts = tuple(cut for cut in (low, high) if 0 < cut < t)
    stack = Stack((DISK,), VACUUM, VACUUM, AREA)
    Z = added("surface-layer", "layer:disk", stack, back=low, front=front * depth).impedance(F[::4])
    expected = [shooting(lambda z: DISK.h33 if low <= z <= high else 0.0, f, cuts=cuts) for f in F[::4]]
    close(Z, np.array(expected), 2e-7)


def inert(f: float, mass: float, load: float = 0.0) -> complex:
    """Return the mass by which an electrode of 1e9 Rayl and a load (Rayl) behind it act on a face, kg/m2."""
    w, root = 2 * np.pi * f, np.sqrt(1 + 1j / 50.0)
    z, wave = 1e9 * root, np.tan(w * mass / (1e9 * root))
    return z * (load + 1j * z * wave) / (z + 1j * load * wave) / (1j * w)


def test_masses_and_a_liquid_solve_the_wave_equation() -> None:
    stack = Stack((DISK,), VACUUM, VACUUM, AREA)
    device = added("electrode-mass", "face:back", stack, mass=0.05)
    device = device.with_effect(find_effect("electrode-mass"), "face:front", {"mass": 0.08})
    device = device.with_effect(find_effect("face-load"), "face:front", {"resistance": 1.5e6})
    expected = [shooting(lambda z: DISK.h33, f, inert(f, 0.05), inert(f, 0.08, 1.5e6)) for f in F]
    close(device.impedance(F), np.array(expected), 2e-7)
    assert abs(inert(F[-1], 0.08) / 0.08 - 1) < 3e-5, "nearly rigid"


def test_electrodes_are_layers_on_both_faces_of_the_ceramic() -> None:
    z, c = 1.6e7, 2500.0  # what they weigh and their impedance decide, not their speed of sound

    def paste(name: str, mass: float) -> Elastic:
        return Elastic(name, mass * c / z, z, c, 50.0)

    values = {"mass": 0.06, "impedance": z, "other": 0.7}
    for where, back, front in (("face:back", 0.06, 0.042), ("interface:disk|glue1", 0.042, 0.06)):
        printed = Stack((paste("a", back), DISK, paste("b", front), GLUE, ML1), AIR, WATER, AREA)
        close(added("electrode-mass", where, GLUED, **values).impedance(F), printed.impedance(F))
    with_dead = Device(BARE).with_effect(find_effect("surface-layer"), "layer:disk", {"back": 5e-6, "front": 3e-6})
    device = with_dead.with_effect(find_effect("electrode-mass"), "face:front", values)
    other_way = Device(BARE).with_effect(find_effect("surface-layer"), "layer:disk", {"back": 3e-6, "front": 5e-6})
    close(device.impedance(F), other_way.with_effect(find_effect("electrode-mass"), "face:back", values).impedance(F))


def test_a_light_mass_lowers_the_antiresonance_by_sauerbreys_equation() -> None:
    stack = Stack((Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1e-5j), 1.98e9, 8.09e-9),), VACUUM, VACUUM, AREA)
    m = 1e-4 * 7700 * 0.5e-3
    f = np.linspace(4.32e6, 4.34e6, 40001)
    before, after = (
        f[np.argmax(d.impedance(f).real)] for d in (stack, added("electrode-mass", "face:back", stack, mass=m))
    )
    assert after / before - 1 == pytest.approx(-1e-4, rel=0.02)


def test_a_jig_equals_a_support_of_the_same_resistance_and_spring() -> None:
    Z = added("face-load", "face:back", Stack((DISK,), VACUUM, AIR, AREA), resistance=5e4, stiffness=1e12)
    close(Z.impedance(F), Stack((DISK,), Support("jig", 5e4, 1e12), AIR, AREA).impedance(F))


def test_under_a_clip_the_face_moves_against_a_spring_with_loss() -> None:
    """Against the wave equation, in which a spring is a negative mass, and in its limits: no clip, and one on all."""
    stack, K, loss = Stack((DISK,), VACUUM, VACUUM, AREA), 2e14, 0.1
    masses = -K * (1 + 1j * loss) / W**2
    held = [shooting(lambda z: DISK.h33, f, mass_front=m) for f, m in zip(F, masses, strict=True)]
    values = {"stiffness": K, "loss": loss}
    Z = added("clamp", "face:front", stack, fraction=0.2, **values).impedance(F)
    close(Z, 1 / (0.8 / stack.impedance(F) + 0.2 / np.array(held)), 2e-7)
    both = added("clamp", "face:front", stack, fraction=0.5, **values)
    spring = Spring("clip", K, 1 / loss)
    ended = Stack((DISK, spring), VACUUM, HalfSpace("wall", 1e20), AREA).impedance(F)
    close(both.impedance(F), 1 / (0.5 / stack.impedance(F) + 0.5 / ended), 1e-9)


def test_a_clip_causes_a_satellite_above_the_resonance_and_a_dot_one_below() -> None:
    """By Rayleigh's quotient: a spring K on one face of a half-wave resonator raises it by K/(w^2 rho t)."""
    ceramic = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1e-4j), 1e7, 8.09e-9)  # hardly coupled: f_s is f_a
    stack = Stack((ceramic,), VACUUM, VACUUM, AREA)
    f0 = resonance(stack)
    f = f0 * np.linspace(0.98, 1.02, 8001)
    K = 0.01 * (2 * np.pi * f0) ** 2 * ceramic.density * ceramic.thickness
    for name, values, side in (
        ("clamp", {"stiffness": K, "loss": 0.0}, 0.01),
        ("local-mass", {"mass": 0.01 * ceramic.density * ceramic.thickness, "dome": 0.05}, -0.01),
    ):
        change = (1 / added(name, "face:back", stack, fraction=0.1, **values).impedance(f)).real
        change -= 0.9 * (1 / stack.impedance(f)).real
        assert f[np.argmax(change)] / f0 - 1 == pytest.approx(side, rel=0.03)


@pytest.mark.parametrize("exponent", [0.0, 0.5])
def test_a_finite_backing_equals_a_long_layer_with_a_free_rear(exponent: float) -> None:
    """1/Q ~ f^n attenuates as f^(n+1), turns the impedance, and makes sound faster at high frequency."""
    z, c, q, length = 5e6, 2000.0, 40.0, 3e-3
    f0 = np.sqrt(DISK.c33D.real / DISK.density) / (2 * DISK.thickness)
    delay = 2 * length / c
    decay = np.pi * f0 * delay / q
    known = {"strength": float(np.exp(-decay)), "delay": delay, "loss": 1 / q}
    backed = Stack((DISK,), HalfSpace("tungsten", z), AIR, AREA)
    Z = added("finite-backing", "face:back", backed, **known, exponent=exponent).impedance(F)
    loss = (F / f0) ** exponent * 1j / q
    faster = 2 / np.pi * np.log(F / f0) if not exponent else (loss * q / 1j - 1).real / np.tan(np.pi * exponent / 2)
    gamma = 1j * W / c * (1 - (loss + faster / q) / 2)
    ends = z * np.sqrt(1 + loss + faster / q) * np.tanh(gamma * length)
    expected = np.array(
        [
            Stack((DISK,), Support("rear", e.real, *((0, e.imag / w) if e.imag > 0 else (-e.imag * w, 0))), AIR, AREA)
            .impedance(np.array([f]))[0]
            for f, w, e in zip(F, W, ends, strict=True)
        ]
    )  # fmt: skip
    close(Z, expected, 1e-9)


def test_parts_of_the_face_act_in_parallel() -> None:
    Z, free = GLUED.impedance(F), BARE.impedance(F)
    for where in ("interface:disk|glue1", "layer:glue1"):
        close(added("bond-void", where, GLUED, fraction=0.1).impedance(F), 1 / (0.9 / Z + 0.1 / free))
    kept = Stack((DISK, GLUE), AIR, AIR, AREA).impedance(F)
    close(added("bond-void", "interface:glue1|ml1", GLUED, fraction=0.1).impedance(F), 1 / (0.9 / Z + 0.1 / kept))
    x, w = np.polynomial.legendre.leggauss(7)
    heights = tuple(zip(0.4 * (1 + 0.3 * x), w / 2, strict=True))  # kg/m2, and parts of a usual dot's area
    solder = [Elastic("dot", thickness=m / 8500, z=2e7, c=2e7 / 8500, q=20.0) for m, _ in heights]
    for z, loads, near in ((2e7, solder, 1e-11), (1e9, [Mass("dot", m) for m, _ in heights], 1e-4)):
        loaded = [Stack((DISK, GLUE, ML1, load), AIR, WATER, AREA).impedance(F) for load in loads]
        Y = sum(part / one for one, (_, part) in zip(loaded, heights, strict=True))
        seen = added("local-mass", "face:front", GLUED, fraction=0.03, mass=0.4, impedance=z).impedance(F)
        close(seen, 1 / (0.97 / Z + 0.03 * Y), near)


@pytest.mark.parametrize("varied", [False, True])
def test_a_dot_is_the_mean_of_its_heights(varied: bool) -> None:
    def dotted(dome: float, mass: float = 0.1) -> Device:
        device = added("local-mass", "face:front", BARE, fraction=0.03, mass=mass, impedance=2e7, dome=dome)
        varying = find_effect("thickness-variation")
        return device.with_effect(varying, "layer:disk", {"variance": 1e-5, "shape": 1.0}) if varied else device

    even = (np.arange(200) + 0.5) / 100 - 1  # nearly flat ones
    Y = np.mean([1 / dotted(0.05, 0.1 * (1 + 0.4 * height)).impedance(F) for height in even], axis=0)
    close(dotted(0.4).impedance(F), 1 / Y, 3e-4)
    device = dotted(0.4)
    for name in ("local-mass@face:front.dome", *(["thickness-variation@layer:disk.variance"] if varied else [])):
        _, (slope,) = device.jacobian(F, (name,))
        step = 1e-4 * device.parameters()[name]
        up, down = (np.log(device.replace({name: device.parameters()[name] + s * step}).impedance(F)) for s in (1, -1))
        np.testing.assert_allclose((up - down) / (2 * step), slope, atol=2e-4 * np.abs(slope).max())


def test_a_spring_holds_the_rim_of_a_void() -> None:
    void = added("bond-void", "interface:disk|glue1", GLUED, fraction=0.1, rim=0.5, hold=0.4).impedance(F)
    unit = 2 * np.pi * resonance(GLUED) * acoustic_impedance(GLUED)
    sprung = Stack((DISK, Spring("rim", 0.4 * unit, 10.0), GLUE, ML1), AIR, WATER, AREA).impedance(F)
    close(void, 1 / (0.85 / GLUED.impedance(F) + 0.1 / BARE.impedance(F) + 0.05 / sprung))


def test_a_void_at_an_interface_and_one_through_the_layer_may_stand_together() -> None:
    values = {"fraction": 0.1, "rim": 0.5, "hold": 0.4}
    device = added("bond-void", "interface:disk|glue1", GLUED, **values)
    both = device.with_effect(find_effect("bond-void"), "layer:glue1", values).impedance(F)
    assert np.all(both.real > 0)


def test_a_mass_between_disk_and_glue_is_on_the_front_before_the_glueing() -> None:
    before = added("electrode-mass", "interface:disk|glue1", BARE, mass=0.05).impedance(F)
    close(before, added("electrode-mass", "face:front", BARE, mass=0.05).impedance(F))


def test_glue_is_omitted_only_where_there_is_none() -> None:
    bond = find_effect("bond-layer")
    assert bond.looked_for(Stack((DISK, ML1), AIR, WATER, AREA)) == ("interface:disk|ml1",)
    assert not bond.looked_for(GLUED), "more glue beside glue is a thicker line"
    assert bond.places(GLUED) == ("interface:disk|glue1", "interface:glue1|ml1"), "which a build may state"
    foil = Elastic("foil", 15e-6, 4.2e7, 4700.0, 100.0)
    assert bond.looked_for(Stack((DISK, foil), AIR, AIR, AREA)) == ("interface:disk|foil",)


def test_a_void_also_removes_the_layers_beyond_it() -> None:
    device = added("electrode-mass", "face:front", GLUED, mass=0.05)
    device = device.with_effect(find_effect("bond-void"), "interface:disk|glue1", {"fraction": 0.2})
    ink = Elastic("ink", 0.05 * 2000 / 1e9, 1e9, 2000.0, 50.0)
    heavy = Stack((DISK, GLUE, ML1, ink), AIR, WATER, AREA).impedance(F)
    close(device.impedance(F), 1 / (0.8 / heavy + 0.2 / BARE.impedance(F)))


@pytest.mark.parametrize(("w", "shape"), [(0.004, 1.0), (0.02, 1.0), (0.01, 0.6), (0.01, 1.5), (0.01, 6.0)])
def test_strips_equal_the_integral_over_the_thickness(w: float, shape: float) -> None:
    Z = added("thickness-variation", "layer:disk", variance=w**2 / (2 * shape + 1), shape=shape).impedance(F)

    def strip(angle: float) -> np.ndarray:  # x = cos(angle): no density has a pole there
        weight = np.sin(angle) ** (2 * shape - 1)
        Y = 1 / BARE.replace({"disk.thickness": DISK.thickness * (1 + w * np.cos(angle))}).impedance(F)
        return weight * np.append(Y, 1.0)

    mean, _ = quad_vec(strip, 0, np.pi, epsrel=1e-12)
    close(Z, mean[-1] / mean[:-1], 1e-7)


def test_derivatives_by_all_that_divides_the_face_or_the_ceramic_are_differences() -> None:
    device = added("thickness-variation", "layer:disk", GLUED, variance=3e-5, shape=1.7)
    for effect, where, values in (
        ("thickness-variation", "layer:glue1", {"variance": 0.03, "shape": 0.8}),
        ("bond-void", "interface:disk|glue1", {"fraction": 0.2, "rim": 0.4, "hold": 0.3}),
        ("local-mass", "face:back", {"fraction": 0.03, "mass": 0.4, "impedance": 2e7, "dome": 0.5}),
        ("surface-layer", "layer:disk", {"back": 4e-6, "front": 2e-6, "stiffness": 0.9, "permittivity": 1.1}),
    ):
        device = device.with_effect(find_effect(effect), where, values)
    values = device.parameters()
    names = [name for name in values if "@" in name]
    assert set(names) == device.assembly.shaped_by
    f = F[::8]
    _, slopes = device.jacobian(f, names)
    for name, slope in zip(names, slopes, strict=True):
        step = 1e-4 * values[name]
        up, down = (np.log(device.replace({name: values[name] + sign * step}).impedance(f)) for sign in (1, -1))
        np.testing.assert_allclose((up - down) / (2 * step), slope, atol=1e-4 * np.abs(slope).max(), err_msg=name)


def test_dispersion_equals_that_of_the_causal_laws() -> None:
    f0 = np.sqrt(DISK.c33D.real / DISK.density) / (2 * DISK.thickness)

    def lawful(disk: Piezo, **laws) -> Stack:
        return Stack((replace(disk, **laws),), AIR, AIR, AREA)

    sharp = replace(DISK, c33D=DISK.c33D.real * (1 + 1j / 2000))
    for n in (-0.5, 0.3, 1.0):
        Z = added("loss-dispersion", "layer:disk", exponent=n, companion=1.0).impedance(F)
        close(Z, lawful(DISK, c_law=PowerLoss(f0, n)).impedance(F))
        causal = lawful(sharp, c_law=CausalConstantQ(f0))  # the two laws differ by 1/Q^2
        Z = added("loss-dispersion", "layer:disk", causal, exponent=n).impedance(F)
        close(Z, lawful(sharp, c_law=PowerLoss(f0, n)).impedance(F), 2e-3)
    Z = added("dielectric-dispersion", "layer:disk", slope=2 / np.pi * np.arctan(0.017)).impedance(F)
    close(Z, lawful(DISK, eps_law=CausalConstantQ(f0)).impedance(F))


def test_a_dispersive_coupling_is_at_each_frequency_that_of_a_disk_with_other_constants() -> None:
    f0 = np.sqrt(DISK.c33D.real / DISK.density) / (2 * DISK.thickness)
    slope, strength, at = -0.01, 0.04, 0.7
    Z = added(
        "piezoelectric-dispersion", "layer:disk", slope=slope, relaxation=strength, relaxation_frequency=at
    ).impedance(F)
    for f, seen in zip(F[::20], Z[::20], strict=True):
        x = f / f0
        debye = 1 + strength * (1 / (1 + 1j * x / at) - 1 / (1 + 1j / at))
        h33 = DISK.h33 * x**-slope * debye
        kt2 = h33**2 * DISK.eps33S / DISK.c33D
        X = np.pi * f * DISK.thickness / np.sqrt(DISK.c33D / DISK.density)
        C0 = DISK.eps33S * AREA / DISK.thickness
        close(np.array([seen]), np.array([(1 - kt2 * np.tan(X) / X) / (2j * np.pi * f * C0)]), 2e-3)


def test_a_spurious_resonance_is_a_series_circuit_parallel_to_the_device() -> None:
    f_k, q, strength = 3.9e6, 50.0, 2e-3
    C0 = DISK.eps33S.real * AREA / DISK.thickness
    C, w_k = strength * C0, 2 * np.pi * f_k
    L, R = 1 / (w_k**2 * C), 1 / (q * w_k * C)
    Z = added("spurious-resonance", "layer:disk", strength=strength, frequency=f_k, q=q).impedance(F)
    close(Z, 1 / (1 / BARE.impedance(F) + 1 / (R + 1j * W * L + 1 / (1j * W * C))))


def test_the_comb_of_a_finite_disk_has_the_spacing_of_its_diameter() -> None:
    f = np.linspace(3e6, 5e6, 4001)
    ripples = {}
    for diameter in (10e-3, 20e-3):
        stack = Stack((DISK,), AIR, AIR, np.pi * diameter**2 / 4)
        Z = added("lateral-modes", "layer:disk", stack, strength=1e-3, q=400.0, speed=3000.0).impedance(f)
        added_G = (1 / Z - 1 / stack.impedance(f)).real
        peaks = f[1:-1][(added_G[1:-1] > added_G[:-2]) & (added_G[1:-1] > added_G[2:])]
        ripples[diameter] = np.median(np.diff(peaks))
        assert np.all(added_G > 0)
    assert ripples[10e-3] == pytest.approx(3000.0 / 10e-3, rel=0.02)
    assert ripples[20e-3] == pytest.approx(3000.0 / 20e-3, rel=0.02)


def test_a_lagging_sweep_reads_earlier_values() -> None:
    for direction, sign in (("up", -1), ("down", 1)):
        late = added("sweep-lag", "sweep", conditions=Conditions(direction), lag=2000.0, memory=0.0).impedance(F)
        close(late, BARE.impedance(F + sign * 2000.0))
        settling = added("sweep-lag", "sweep", conditions=Conditions(direction), lag=2000.0, memory=1.0).impedance(F)
        Y, _ = quad_vec(lambda u: np.exp(-u) / BARE.impedance(F + sign * u * 2000.0), 0, 40, epsrel=1e-11)  # noqa: B023
        close(settling, 1 / Y, 1e-6)


def test_polarity_inverts_the_impedance_and_its_derivatives() -> None:
    Z, J = BARE.jacobian(F, ["disk.thickness"])
    for inverted, conjugated in ((0, 1), (1, 0), (1, 1)):
        device = added("polarity", "terminals", inverted=inverted, conjugated=conjugated)
        seen, slopes = device.jacobian(F, ["disk.thickness"])
        turn = np.conj if conjugated else np.array
        close(seen, (-1) ** inverted * turn(Z))
        close(slopes, turn(J))


def test_drive_nonlinearity_lowers_the_series_resonance_self_consistently() -> None:
    """Compared with a root finder at each point, from the disk's own field; the antiresonance hardly moves."""
    a, r, level = 2000.0, 0.4, 0.5
    f = np.linspace(3.4e6, 4.6e6, 25)
    Z = added("drive-nonlinearity", "layer:disk", conditions=Conditions(level_V=level), softening=a, loss=r).impedance(
        f
    )

    def at(one: np.ndarray, strain: float) -> tuple[complex, float]:
        c = DISK.c33D * (1 - a * strain * (1 - 1j * r))
        bent = BARE.replace({"disk.c33D.re": c.real, "disk.c33D.im": c.imag})
        z = complex(bent.impedance(one)[0])
        current = np.sqrt(2) * level / abs(z + 25)
        clamped = DISK.thickness / (2j * np.pi * one[0] * DISK.eps33S * AREA)
        return z, current * abs(z - clamped) / (abs(DISK.h33) * DISK.thickness)

    expected = []
    for k in range(f.size):
        one = f[k : k + 1]
        strain = brentq(lambda s, one=one: at(one, s)[1] - s, 0.0, 1e-4, xtol=1e-16)
        expected.append(at(one, strain)[0])
    close(Z, np.array(expected), 1e-8)
    halved = added("drive-nonlinearity", "layer:disk", conditions=Conditions(level_V=1e-6), softening=a).impedance(f)
    close(halved, BARE.impedance(f), 1e-6)


def test_a_drift_is_reversed_by_the_sweep_direction() -> None:
    """It begins with the unchanged device; to first order, up and down together show the whole drift everywhere."""
    Z = BARE.impedance(F)
    up, down = (
        np.log(added("temperature-drift", "sweep", conditions=Conditions(d), relative=1e-5).impedance(F) / Z)
        for d in ("up", "down")
    )
    stiffness = DISK.c33D * (1 + 2e-5)
    drifted = BARE.replace({"disk.c33D.re": stiffness.real, "disk.c33D.im": stiffness.imag})
    whole = np.log(drifted.impedance(F) / Z)
    assert abs(up[0]) < 1e-12
    np.testing.assert_allclose(up + down, whole, rtol=1e-2)
    assert up[-1] == pytest.approx(whole[-1], rel=1e-3)


def test_a_drift_that_is_over_moves_the_device_as_a_whole() -> None:
    late = Conditions(began=40.0)
    seen = added("temperature-drift", "sweep", conditions=late, relative=1e-4, time=0.7).impedance(F)
    stiffness = DISK.c33D * (1 + 2e-4 / (1 - np.exp(-1 / 0.7)))
    close(seen, BARE.replace({"disk.c33D.re": stiffness.real, "disk.c33D.im": stiffness.imag}).impedance(F))


@pytest.mark.parametrize("time", [1e3, 0.6])
def test_a_strong_drift_uses_the_device_at_each_points_time(time: float) -> None:
    f = np.linspace(3.8e6, 4.6e6, 401)
    drifted = added("temperature-drift", "sweep", relative=2e-3, time=time).impedance(f)
    for k in range(0, 401, 50):
        stiffness = DISK.c33D * (1 + 4e-3 * (1 - np.exp(-k / 400 / time)) / (1 - np.exp(-1 / time)))
        then = BARE.replace({"disk.c33D.re": stiffness.real, "disk.c33D.im": stiffness.imag})
        close(drifted[k : k + 1], then.impedance(f[k : k + 1]), 2e-4)


def scattering(frequency: np.ndarray, loss: float, end: float) -> np.ndarray:
    """Return the stiffness of ml1 with scatter, relative to its real part at the resonance, minus its own."""
    device = added("scatter", "layer:ml1", GLUED, loss=loss, end=end)
    layer = next(one for one in device.assembly.stack.layers if one.name == "ml1")
    return layer.law.over(layer.c33, frequency) / ML1.c33.real - complex(1, 1 / ML1.q)


def test_scatter_attenuates_as_the_fourth_power_of_frequency_and_is_causal() -> None:
    """Loss tangent ~ f^3 far below its end; the real part is that of Kramers and Kronig, by a principal value."""
    f0, loss, end = resonance(GLUED), 2e-3, 4.0
    assert scattering(np.array([f0]), loss, end)[0] == pytest.approx(1j * loss, rel=1e-12)
    low = scattering(f0 * np.array([0.1, 0.2]), loss, end).imag
    assert np.log2(low[1] / low[0]) == pytest.approx(3.0, abs=0.02)
    grown = np.imag(scattering(f0 * np.array([0.02]), loss, end))[0] / 0.02**3  # the loss over x^3
    fall = scattering(f0 * np.array([0.02, 0.04]), loss, end).real
    assert (fall[1] - fall[0]) / (0.04**2 - 0.02**2) == pytest.approx(-2 / np.pi * end * grown, rel=0.01)

    def imaginary(x: float) -> float:
        return float(scattering(f0 * np.array([x]), loss, end)[0].imag)

    def real(x: float) -> float:
        near = quad(lambda y: y * imaginary(y) / (y + x), 0, 10, weight="cauchy", wvar=x)[0]
        return -2 / np.pi * (near + quad(lambda y: y * imaginary(y) / (y * y - x * x), 10, np.inf)[0])

    for x in (0.5, 2.0, 5.0):
        expected = real(x) - real(1.0)
        assert scattering(f0 * np.array([x]), loss, end)[0].real == pytest.approx(expected, rel=1e-4)


def test_scatter_is_a_lower_q_at_one_frequency() -> None:
    f0 = np.array([resonance(GLUED)])
    lossy = replace(GLUED, layers=(DISK, GLUE, replace(ML1, q=1 / (1 / ML1.q + 0.01))))
    close(added("scatter", "layer:ml1", GLUED, loss=0.01).impedance(f0), lossy.impedance(f0))
    assert find_effect("scatter").places(GLUED) == ("layer:glue1", "layer:ml1")
