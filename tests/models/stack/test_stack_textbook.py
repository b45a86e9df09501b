"""The stack compared with closed forms from textbooks."""

import numpy as np
import pytest

from pzctl.models.stack import AIR, VACUUM, Elastic, HalfSpace, Piezo, Stack, StackError

AREA = 2.01e-4
DISK = Piezo(
    "disk", thickness=0.512e-3, density=7700.0, c33D=1.444e11 * (1 + 1j / 80), h33=1.98e9, eps33S=8.09e-9 * (1 - 0.017j)
)
F = np.linspace(0.5e6, 15.5e6, 801)
OMEGA = 2 * np.pi * F


def thickness_vibrator(disk: Piezo) -> np.ndarray:
    """Z of the free plate: 1/(jw C0) [1 - kt^2 tan X / X]."""
    X = OMEGA * disk.thickness / 2 / np.sqrt(disk.c33D / disk.density)
    kt2 = disk.h33**2 * disk.eps33S / disk.c33D
    C0 = disk.eps33S * AREA / disk.thickness
    return (1 - kt2 * np.tan(X) / X) / (1j * OMEGA * C0)


def mason(disk: Piezo, Z1: np.ndarray | complex, Z2: np.ndarray | complex) -> np.ndarray:
    """Z of Mason's three-port with specific acoustic loads, in the textbook's form."""
    v = np.sqrt(disk.c33D / disk.density)
    Za, phase = disk.density * v, OMEGA * disk.thickness / v
    M11, M12 = Za / (1j * np.tan(phase)), Za / (1j * np.sin(phase))
    a, d = M11 + Z1, M11 + Z2
    motional = (disk.h33 / OMEGA) ** 2 * (a + d - 2 * M12) / (a * d - M12**2)
    return (disk.thickness / (1j * OMEGA * disk.eps33S) + motional) / AREA


def assert_same(found: np.ndarray, expected: np.ndarray, tolerance: float = 1e-12) -> None:
    assert np.max(np.abs(found / expected - 1)) < tolerance


def test_a_free_plate_is_the_thickness_vibrator() -> None:
    assert_same((VACUUM | DISK | VACUUM).with_area(AREA).impedance(F), thickness_vibrator(DISK))


def test_a_loaded_plate_is_masons_three_port() -> None:
    stack = (HalfSpace("backing", 5e6) | DISK | HalfSpace("water", 1.48e6)).with_area(AREA)
    assert_same(stack.impedance(F), mason(DISK, 5e6, 1.48e6))


def test_a_half_wave_layer_is_invisible_and_a_quarter_wave_layer_transforms() -> None:
    f = np.array([3e6])
    water = HalfSpace("water", 1.48e6)
    half = Elastic("layer", thickness=2500 / 3e6 / 2, z=4e6, c=2500)
    quarter = Elastic("layer", thickness=2500 / 3e6 / 4, z=4e6, c=2500)

    def Z(*layers: Piezo | Elastic, front: HalfSpace) -> complex:
        return Stack(layers, AIR, front, AREA).impedance(f)[0]

    assert Z(DISK, half, front=water) == pytest.approx(Z(DISK, front=water), rel=1e-12)
    assert Z(DISK, quarter, front=water) == pytest.approx(Z(DISK, front=HalfSpace("x", 4e6**2 / 1.48e6)), rel=1e-12)


def test_a_layer_of_the_loads_own_material_changes_nothing() -> None:
    water = HalfSpace("water", 1.48e6)
    layer = Elastic("water layer", thickness=3e-3, z=1.48e6, c=1480)
    assert_same((AIR | DISK | layer | water).with_area(AREA).impedance(F), mason(DISK, AIR.z, 1.48e6))


def test_a_stack_written_as_a_row_equals_the_stack() -> None:
    glue = Elastic("glue1", thickness=11e-6, z=2.8e6, c=2442, q=13)
    assert (AIR | DISK | glue | VACUUM).with_area(AREA) == Stack((DISK, glue), AIR, VACUUM, AREA)


def test_mistakes_are_named() -> None:
    with pytest.raises(StackError, match="begins and ends with a load"):
        (DISK | AIR).with_area(AREA)
    with pytest.raises(StackError, match="two layers are called 'disk'"):
        (AIR | DISK | DISK | AIR).with_area(AREA)
    with pytest.raises(StackError, match="at least one must be"):
        Stack((Elastic("glue1", 1e-6, 2.8e6, 2442),))
    with pytest.raises(StackError, match=r"layer 'glue1': thickness is -1e-06"):
        Elastic("glue1", -1e-6, 2.8e6, 2442)
    with pytest.raises(StackError, match=r"layer 'glue1': q is nan"):
        Elastic("glue1", 1e-6, 2.8e6, 2442, float("nan"))
    with pytest.raises(StackError, match=r"layer 'disk': h33 is inf"):
        Piezo("disk", 1e-3, 7700, 1.4e11, float("inf"), 8e-9)
    with pytest.raises(KeyError, match=r"no parameter 'disk\.z'"):
        (AIR | DISK | AIR).with_area(AREA).replace({"disk.z": 1.0})
