"""Springs, masses and thin layers; several piezoelectric layers; loads and loss laws in their limits."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.models.stack import (
    AIR,
    VACUUM,
    AnyLoad,
    CausalConstantQ,
    Elastic,
    HalfSpace,
    Mass,
    Piezo,
    Piston,
    PowerLoss,
    Spring,
    Stack,
    StackError,
    Support,
    viscous,
)
from pzctl.models.stack.radiation import piston, piston_slope

F = np.linspace(0.5e6, 15.5e6, 401)
DISK = Piezo(
    "disk", thickness=0.512e-3, density=7700.0, c33D=1.444e11 * (1 + 1j / 80), h33=1.98e9, eps33S=8.09e-9 * (1 - 0.017j)
)
WATER = HalfSpace("water", 1.48e6)


def named(layer: Piezo, name: str, **changes: float) -> Piezo:
    fields = {key: getattr(layer, key) for key in ("thickness", "density", "c33D", "h33", "eps33S", "polarity")}
    return Piezo(name, **(fields | changes))


def worst(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(found / expected - 1)))


def test_to_third_order_a_thin_layer_is_a_spring_between_half_masses() -> None:
    def error(t: float) -> float:
        glue = Elastic("glue", t, 2.8e6, 2442.0, 13.0)
        half, spring = glue.density * t / 2, Spring("s", 2.8e6 * 2442.0 / t, 13.0)
        lumped = (AIR | DISK | Mass("m1", half) | spring | Mass("m2", half) | WATER).with_area(1.0)
        return worst(lumped.impedance(F), (AIR | DISK | glue | WATER).with_area(1.0).impedance(F))

    assert error(1e-6) < 4e-6
    assert error(2e-6) / error(1e-6) == pytest.approx(8, rel=0.1)


def test_a_disk_cut_in_two_equals_the_disk() -> None:
    halves = named(DISK, "a", thickness=0.2e-3), named(DISK, "b", thickness=0.312e-3)
    assert worst(Stack(halves, WATER, AIR).impedance(F), Stack((DISK,), WATER, AIR).impedance(F)) < 1e-12


def test_two_like_layers_in_parallel_have_a_quarter_of_the_impedance_in_series() -> None:
    layers = named(DISK, "a"), Spring("joint", 1e15, 20.0), named(DISK, "b")
    series = Stack(layers, WATER, WATER).impedance(F)
    assert worst(4 * Stack(layers, WATER, WATER, connection="parallel").impedance(F), series) < 1e-12


def test_opposite_polarity_leaves_the_even_resonance_only() -> None:
    """Two halves of opposite polarity: the plate's odd half waves are not driven, its full wave is."""
    halves = named(DISK, "a", thickness=0.25e-3), named(DISK, "b", thickness=0.25e-3, polarity=-1)
    f = np.linspace(2e6, 12e6, 2001)
    R = (
        Stack(halves, VACUUM, VACUUM).impedance(f).real * f
    )  # peaks where the plate's thickness is a whole number of half waves
    speed = np.sqrt(DISK.c33D.real / DISK.density)
    assert f[np.argmax(R)] == pytest.approx(2 * speed / (2 * 0.5e-3), rel=0.01)


def test_passive_layers_equal_a_cascade_of_lines_in_scikit_rf() -> None:
    layers = [
        Elastic("a", 11e-6, 2.8e6, 2442.0, 13.0),
        Elastic("b", 1.4e-4, 1e7, 2455.0, 60.0),
        Elastic("c", 1e-3, 3e6, 2000, 9),
    ]
    import skrf  # imported late: it takes half a second, in each process of a test run
    from skrf.media import DefinedGammaZ0

    frequency = skrf.Frequency.from_f(F, unit="Hz")
    chain = None
    for layer in layers:
        root = np.sqrt(1 + 1j / layer.q)
        gamma = 2j * np.pi * F / layer.c / root
        line = DefinedGammaZ0(frequency, z0=layer.z * root, gamma=gamma).line(layer.thickness, "m")
        line.renormalize(1e6)
        chain = line if chain is None else chain**line
    reflection = (WATER.z - 1e6) / (WATER.z + 1e6)
    S = chain.s
    seen = S[:, 0, 0] + S[:, 0, 1] * S[:, 1, 0] * reflection / (1 - S[:, 1, 1] * reflection)
    load = AnyLoad("cascade", lambda f: 1e6 * (1 + seen) / (1 - seen))
    expected = Stack((DISK,), AIR, load).impedance(F)
    assert worst(Stack((DISK, *layers), AIR, WATER).impedance(F), expected) < 1e-11


def test_an_infinite_layer_is_a_half_space() -> None:
    backing = Elastic("backing", 0.2, 6e6, 1900.0, 8.0)
    Zc = 6e6 * np.sqrt(1 + 1j / 8)
    expected = Stack((DISK,), AnyLoad("backing", lambda f: np.full(f.shape, Zc)), WATER).impedance(F)
    assert worst(Stack((backing, DISK), AIR, WATER).impedance(F), expected) < 1e-12


def test_a_support_equals_springs_and_masses() -> None:
    stack = Stack((DISK,), VACUUM, Support("jig", 2e4, 0.0, 0.03))
    assert worst(stack.impedance(F), Stack((DISK, Mass("m", 0.03)), VACUUM, HalfSpace("r", 2e4)).impedance(F)) < 1e-13
    soft = Stack((DISK,), VACUUM, Support("jig", stiffness=1e12))  # a spring to a fixed support
    assert (
        worst(soft.impedance(F), Stack((DISK, Spring("s", 1e12)), VACUUM, HalfSpace("wall", 1e20)).impedance(F)) < 1e-7
    )


@given(st.floats(-4, 4).map(lambda e: 10.0**e))
def test_piston_radiation_equals_rayleighs(x: float) -> None:
    with mp.workdps(40):
        found, slope = piston(np.array([x]))[0], piston_slope(np.array([x]))[0]

        def exact(t: mp.mpf) -> mp.mpc:
            return mp.mpc(1 - 2 * mp.besselj(1, t) / t, 2 * mp.struveh(1, t) / t)

        turn = mp.diff(exact, mp.mpf(x))
        assert abs(found - complex(exact(mp.mpf(x)))) < 1e-13 * abs(found)
        assert abs(found.real - float(exact(mp.mpf(x)).real)) < 1e-12 * found.real
        assert abs(slope - complex(turn)) < 1e-11 * abs(slope) + 1e-13 * abs(found) / x


@pytest.mark.parametrize(
    "load", [Piston("water", 1.48e6, 1480.0, 0.2e-3), Support("jig", 3e4, 2e12, 0.02, 0.1)], ids=lambda load: load.name
)
def test_derivatives_by_a_loads_parameters(load: Piston | Support) -> None:
    stack = Stack((DISK,), AIR, load)
    names = [f"front.{key}" for key in load.parameters()]
    Z, J = stack.jacobian(F, names)
    for name, row in zip(names, J, strict=True):
        h = stack.parameters()[name] * 1e-5
        up, down = (stack.replace({name: stack.parameters()[name] + side}).impedance(F) for side in (h, -h))
        assert np.max(np.abs(row - (up - down) / (2 * h) / Z)) < 1e-7 * np.max(np.abs(row))


def test_a_load_function_that_gives_nonsense_is_named() -> None:
    with pytest.raises(StackError, match="load 'mine': its function gave shape"):
        Stack((DISK,), AIR, AnyLoad("mine", lambda f: f[:-1] * 1j)).impedance(F)


def test_loss_laws_agree_in_their_common_limits() -> None:
    M = 1e10 * (1 + 1j / 80)
    f = np.array([0.125e6, 1e6, 3e6])
    causal = CausalConstantQ(1e6).over(M, f)
    assert np.allclose(np.angle(causal), np.angle(M), rtol=1e-13)
    assert causal[2].real / causal[1].real - 1 == pytest.approx(0.0088, abs=5e-5)  # physics.md: Q = 80, f to 3 f
    assert np.allclose(PowerLoss(1e6, 0.0).over(M, f), causal, rtol=4e-4)  # second order in 1/Q
    assert np.allclose(viscous(1e6).over(M, f), M.real + 1j * M.imag * f / 1e6, rtol=1e-12)
    for law in (CausalConstantQ(1e6), PowerLoss(1e6, 0.0), PowerLoss(1e6, 0.4), PowerLoss(1e6, -0.3)):
        assert law.over(M, f)[1] == pytest.approx(M, rel=1e-14)
    assert np.allclose(PowerLoss(1e6, 1e-9).over(M, f), PowerLoss(1e6, 0.0).over(M, f), rtol=1e-9)


@pytest.mark.parametrize("law", [CausalConstantQ(1e6), PowerLoss(1e6, 0.4)])
def test_the_sign_of_h33_is_the_polarity_whatever_the_law(law: CausalConstantQ | PowerLoss) -> None:
    disk = Piezo("disk", 0.5e-3, 7700.0, 1.4e11 * (1 + 0.01j), 1.9e9 * (1 + 0.02j), 8e-9 * (1 - 0.02j), h_law=law)
    other = Piezo("disk", 0.5e-3, 7700.0, disk.c33D, -disk.h33, disk.eps33S, h_law=law)
    Z, J = Stack((disk,), WATER, AIR).jacobian(F, ["disk.h33.re", "disk.h33.im"])
    assert worst(Stack((other,), WATER, AIR).impedance(F), Z) < 1e-14
    assert worst(-Stack((other,), WATER, AIR).jacobian(F, ["disk.h33.re", "disk.h33.im"])[1], J) < 1e-12
