"""Dots on the faces of a disk against one dimension, the whole mesh, and themselves."""

from dataclasses import replace

import numpy as np
import pytest
from complex_ceramic import TENSOR

from pzctl.models.base.face_loads import Dot
from pzctl.models.disk2d.basis import split
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.dot import DotBody
from pzctl.models.disk2d.dotted import FreeDisk, PlacedDot
from pzctl.models.disk2d.footprint import loads
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.line_elements import LineElements
from pzctl.models.disk2d.loadable import LoadableDisk, trained_for_loads
from pzctl.models.disk2d.matrices import CONSTANTS, assemble
from pzctl.models.disk2d.reduced import ReducedDisk
from pzctl.models.disk2d.training import trained
from pzctl.models.effects import Device, find_effect
from pzctl.models.stack import VACUUM, CausalConstantQ, Mass, Piezo, Stack

C = np.array([getattr(TENSOR, name) for name in CONSTANTS])
RATIO, T, DENSITY = 2.2, 2e-3, 7700.0
AREA = np.pi * (RATIO * T / 2) ** 2
SOLDER = Dot(fraction=0.06, mass=3.0, impedance=2.4e7, speed=2800.0, q=50.0)
PLATE = TENSOR.thickness
F = np.linspace(0.25e6, 1.4e6, 25)
F.flags.writeable = False


@pytest.fixture(scope="module")
def faces():
    return trained_for_loads(RATIO)


@pytest.fixture(scope="module")
def disk(faces):
    law = CausalConstantQ(0.7e6)
    return Disk2D("disk", TENSOR, AREA, T, DENSITY, trained(RATIO), law, loadable=lambda: faces)


def with_solder(disk, where="face:front", **values):
    nominal = Stack((Piezo("disk", T, DENSITY, PLATE.c33D, PLATE.h33, PLATE.eps33S),), VACUUM, VACUUM, AREA)
    given = {"fraction": 0.06, "mass": 3.0, "impedance": 2.4e7, "dome": 0.24, **values}
    return Device(disk, nominal=nominal).with_effect(find_effect("local-mass"), where, given)


def test_a_rigid_mass_all_over_a_face_that_cannot_move_in_its_plane_is_that_of_one_dimension():
    line, through = LineElements(np.linspace(0, 1, 3), 4), LineElements(np.array([0.0, 1.0]), 12)
    meshes = [FullDisk(assemble(line, through, move_in_plane=False, antisymmetric=odd)) for odd in (False, True)]
    parts = [ReducedDisk.of(full, *split(full, [np.eye(full.size)], (0.0, 0.0))) for full in meshes]
    mass, f = 2.5, np.linspace(0.3e6, 2.5e6, 41)
    free = FreeDisk(LoadableDisk(*parts), Shape(2e-3, T, DENSITY), np.tile(C, (f.size, 1)), f, False)
    heavy = Dot(1.0, mass, 1e12, 2800.0)
    ceramic = Piezo("p", T, DENSITY, PLATE.c33D, PLATE.h33, PLATE.eps33S)
    for where in ("face:front", "face:back"):
        C1 = free.with_dots((PlacedDot(where, heavy),)).capacitance
        Y = Stack((ceramic, Mass("m", mass)), VACUUM, VACUUM, np.pi * 4e-6).impedance(f) * 2j * np.pi * f * C1
        np.testing.assert_allclose(Y, 1, atol=1e-4)
    both = free.with_dots((PlacedDot("face:front", heavy), PlacedDot("face:back", heavy))).capacitance
    loaded = Stack((Mass("b", mass), ceramic, Mass("m", mass)), VACUUM, VACUUM, np.pi * 4e-6).impedance(f)
    np.testing.assert_allclose(2j * np.pi * f * both * loaded, 1, atol=1e-4)


@pytest.mark.long
def test_the_reduced_disk_with_a_dot_equals_the_whole_mesh(faces, disk):
    f, shape = F[::6], disk.shape
    free = FreeDisk(faces, shape, np.tile(C, (f.size, 1)), f, False)
    found = free.with_dots((PlacedDot("face:front", SOLDER),))
    count = found.footprints[0].count
    body = DotBody(SOLDER, SOLDER.radius(AREA), float(f[-1]), count).receptance(f)
    meshes = [FullDisk.of(RATIO, antisymmetric=odd) for odd in (False, True)]
    stressed = [loads(full.face, full.size, np.sqrt(SOLDER.fraction), count) * shape.radius**2 for full in meshes]
    for k, at in enumerate(f.tolist()):
        whole, volt = body[k].copy(), meshes[0].solution(shape, C, at)[:-1]
        for full, own in zip(meshes, stressed, strict=True):
            system = full.system(shape.weights(C), -((2 * np.pi * at) ** 2) * shape.mass)
            scaled = full.scale[:, None] * own
            whole += scaled.T @ full.factor(system)(scaled.astype(complex)) / 2
        moved = stressed[0].T @ volt
        expected = meshes[0].capacitance(shape, C, np.array([at]))[0] - 2 * np.pi * moved @ np.linalg.solve(
            whole, moved
        )
        assert found.capacitance[k] == pytest.approx(expected, rel=1e-4)
    assert whole.shape == (2 * count, 2 * count)


@pytest.mark.long
def test_derivatives_by_sizes_constants_of_each_kind_and_the_dot(disk):
    device = with_solder(disk)
    names = [name for name in device.parameters() if "." not in name or "@" in name or not name.endswith(".im")]
    names = [name for name in names if not name.endswith(("c11E.re", "c44E.re", "e33.re", "e15.re", "eps11S.re"))]
    names.append("disk.eps33S.im")
    Z, J = device.jacobian(F, names)
    scale = {name: abs(value) for name, value in device.parameters().items()}
    for name in CONSTANTS:
        size = abs(complex(getattr(TENSOR, name)))
        scale |= {f"disk.{name}.re": size, f"disk.{name}.im": size}
    for row, name in zip(J, names, strict=True):
        value, step = device.parameters()[name], 1e-4 * scale[name]

        def moved(times, name=name, value=value, step=step):
            return np.log(device.replace({name: value + times * step}).impedance(F) / Z)

        numeric = (8 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / (12 * step)
        assert np.abs(numeric - row).max() < 2e-4 * np.abs(row).max(), name


def test_a_dot_is_passive_on_either_face_and_vanishes_with_its_size(disk):
    f = F[::4]
    front = with_solder(disk).impedance(f)
    assert front.real.min() > 0
    np.testing.assert_allclose(with_solder(disk, "face:back").impedance(f), front, rtol=1e-9)
    assert np.abs(np.log(front / disk.impedance(f))).max() > 0.1
    none = with_solder(disk, fraction=1e-7)
    assert np.abs(np.log(none.impedance(f) / disk.impedance(f))).max() < 1e-3
    # as small as the part of the face that a fit steps from nothing; a larger one has resonances of its own
    _, (slope,) = with_solder(disk, fraction=0.0).jacobian(f, ["local-mass@face:front.fraction"])
    added = [
        replace(disk, dots=(PlacedDot("face:front", replace(SOLDER, fraction=part, dome=0.2, q=50.0)),))
        for part in (1e-8, 2e-8)
    ]
    change = np.diff([one.added_by_dots(f) for one in added], axis=0)[0] / 1e-8
    np.testing.assert_allclose(-change * 2j * np.pi * f * disk.impedance(f), slope, rtol=0.02)


def test_it_is_looked_for_on_one_face_of_a_disk_whose_faces_can_be_loaded(disk):
    effect, nominal = find_effect("local-mass"), with_solder(disk).reference
    assert effect.looked_for_in(disk, nominal) == ("face:front",)
    closed = replace(disk, loadable=None)
    assert effect.looked_for_in(closed, nominal) == ()
    assert effect.looked_for_in(nominal, nominal) == ("face:back", "face:front")
    assert find_effect("cable").looked_for_in(closed, nominal) == ("terminals",)
    assert find_effect("face-load").looked_for_in(disk, nominal) == ()


def test_a_stored_disk_is_the_same(faces, disk):
    again = LoadableDisk.from_arrays(faces.arrays())
    other = replace(disk, loadable=lambda: again, _known=[])
    np.testing.assert_array_equal(with_solder(other).impedance(F), with_solder(disk).impedance(F))
