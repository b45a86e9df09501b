"""Ceramic that is dead under the faces of a disk, compared with one dimension and with itself."""

import numpy as np
import pytest
from complex_ceramic import TENSOR
from exact_derivatives import assert_exact

from pzctl.models.base.face_loads import DeadLayer
from pzctl.models.disk2d.basis import split
from pzctl.models.disk2d.capacitance import solved
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.faces import Faces
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.line_elements import LineElements
from pzctl.models.disk2d.matrices import CONSTANTS, assemble
from pzctl.models.disk2d.odd_training import trained_odd
from pzctl.models.disk2d.reduced import ReducedDisk
from pzctl.models.disk2d.training import trained
from pzctl.models.effects import Device, find_effect
from pzctl.models.effects.base.scale import equivalent_plate
from pzctl.models.stack import VACUUM, CausalConstantQ, Piezo, Stack

C = np.array([getattr(TENSOR, name) for name in CONSTANTS])
RATIO, T, DENSITY = 3.0, 2e-3, 7700.0


@pytest.mark.parametrize("back", [0.0, 4e-6, 1e-5])
def test_where_nothing_moves_in_the_plane_it_is_that_of_one_dimension(back):
    line, through, front = LineElements(np.linspace(0, 1, 3), 4), LineElements(np.array([0.0, 1.0]), 12), 1e-5
    meshes = [FullDisk(assemble(line, through, move_in_plane=False, antisymmetric=odd)) for odd in (False, True)]
    even, odd = (ReducedDisk.of(full, *split(full, [np.eye(full.size)], (0.0, 0.0))) for full in meshes)
    f, faces = np.linspace(0.3e6, 2.5e6, 45), Faces().with_load(DeadLayer(front, back, 0.9, 1.2))
    found = solved(even, Shape(2e-3, T, DENSITY), np.tile(C, (f.size, 1)), f, faces=faces, odd=lambda: odd)
    plate = TENSOR.thickness

    def device(front, back):
        depths = {"under": back, "live": T - front - back, "over": front}
        stiff, field, eps = (dict.fromkeys(depths, one) for one in (0.9 * plate.c33D, 0j, 1.2 * plate.eps33S))
        stiff["live"], field["live"], eps["live"] = plate.c33D, plate.h33, plate.eps33S
        layers = [Piezo(name, t, DENSITY, stiff[name], field[name], eps[name]) for name, t in depths.items() if t > 0]
        return Stack(tuple(layers), VACUUM, VACUUM, np.pi * 4e-6, connection="series").impedance(f)

    expected = device(front, back)
    left = np.log(2j * np.pi * f * found.capacitance * expected)
    assert np.abs(left).max() < 0.02 * np.abs(np.log(device(0, 0) / expected)).max()


def test_derivatives_with_dead_layers_are_exact():
    odd, reduced = trained_odd(RATIO), trained(RATIO)
    area = np.pi * (RATIO * T / 2) ** 2
    bare = Disk2D("disk", TENSOR, area, T, DENSITY, reduced, CausalConstantQ(1e6), odd=lambda: odd)
    f, effect, plate = np.linspace(0.3e6, 1.3e6, 7), find_effect("surface-layer"), equivalent_plate("disk", 1e-9, 1e6)
    assert effect.looked_for_in(bare, plate) == ("layer:disk",)
    own = [f"surface-layer@layer:disk.{name}" for name in ("front", "back", "stiffness", "permittivity")]
    absent = Device(bare, nominal=plate).with_effect(effect, "layer:disk")
    by_front, by_back, *of_nothing = absent.jacobian(f, own)[1]
    np.testing.assert_allclose(by_front, by_back)
    assert not np.any(of_nothing)
    little = np.log(absent.replace({own[0]: 1e-8}).impedance(f) / bare.impedance(f)) / 1e-8
    assert np.abs(little - by_front).max() < 1e-3 * np.abs(by_front).max()
    device = absent.replace(dict(zip(own, (1.2e-5, 3e-6, 0.9, 1.2), strict=True)))
    assert_exact(device, f, [*bare.parameters(), *own], 5e-3)
