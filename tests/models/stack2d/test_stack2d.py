"""The glued stack in two dimensions against one dimension, two other discretisations, and itself."""

from dataclasses import replace

import numpy as np
import pytest
from built_disk import BuiltDisk
from complex_ceramic import TENSOR
from exact_derivatives import assert_exact_by_fourth_order
from stack_skfem import FeLayer, SkfemStack

from pzctl.models.base.face_loads import Dot, OpenBond
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.stack import CausalConstantQ, Elastic, HalfSpace, Piezo, Stack
from pzctl.models.stack.loss_laws import StackError
from pzctl.models.stack2d.layers2d import Ceramic2D, Isotropic
from pzctl.models.stack2d.stack_model import Stack2D, full_section, section_error, with_reduced_section
from pzctl.models.stack2d.waves import Waves

T, DENSITY = 2e-3, 7700.0
DISK = Ceramic2D("disk", TENSOR, T, DENSITY)
GLUE = Isotropic("glue1", 40e-6, 2.8e6, 2442.0, 13.0, 0.38)
MATCHING = Isotropic("ml1", 0.55e-3, 10.3e6, 2455.0, 60.0, 0.33)
F = np.linspace(0.2e6, 1.4e6, 7)


def stack(*layers, radius=6e-3, finer=0, highest=1.5e6):
    return Stack2D(layers, np.pi * radius**2, full_section(layers, highest, finer), 413.0, 413.0)


def difference(one, other):
    return np.abs(np.log(one / other)).max()


def test_a_bare_disk_equals_the_mesh_of_the_disk():
    disk = replace(stack(DISK, radius=3e-3), back=0.0, front=0.0)
    assert difference(disk.impedance(F), BuiltDisk(TENSOR, 3e-3, T, DENSITY).impedance(F)) < 2e-5


def test_a_glued_stack_equals_general_finite_elements():
    glued = replace(stack(DISK, GLUE, MATCHING, finer=4), back=0.0, front=0.0)
    ten = tuple(complex(getattr(TENSOR, name)) for name in CONSTANTS)
    layers = [FeLayer(T, DENSITY, ten, 6)]
    for one, cells in ((GLUE, 1), (MATCHING, 3)):
        layers.append(FeLayer.isotropic(one.thickness, one.z, one.c, one.q, one.poisson, cells))
    other = SkfemStack(6e-3, layers, per_thickness=6).impedance(F[1::2])
    assert difference(glued.impedance(F[1::2]), other) < 1e-3
    assert difference(stack(DISK).impedance(F[1::2]), other) > 0.1


def test_a_pocket_of_air_in_the_glue_equals_general_finite_elements():
    glued = replace(stack(DISK, GLUE, MATCHING), back=0.0, front=0.0)
    opened = glued.with_load("interface:disk|glue1", OpenBond(0.3**2, "glue1"))
    layers = [FeLayer(T, DENSITY, tuple(complex(getattr(TENSOR, name)) for name in CONSTANTS), 6)]
    for one, cells in ((GLUE, 1), (MATCHING, 4)):
        layers.append(FeLayer.isotropic(one.thickness, one.z, one.c, one.q, one.poisson, cells))
    other = SkfemStack(6e-3, layers, per_thickness=6, opening=(1, 0.3 * 6e-3)).impedance(F[1::2])
    assert difference(opened.impedance(F[1::2]), other) < 4e-3
    assert difference(glued.impedance(F[1::2]), other) > 0.5


def test_a_tiny_opening_changes_nothing():
    glued = stack(DISK, GLUE, MATCHING)
    for where in glued.faces_for(OpenBond):
        assert difference(glued.with_load(where, OpenBond(1e-6)).impedance(F), glued.impedance(F)) < 1e-5


def test_a_wide_stack_tends_to_one_dimension_as_the_inverse_of_its_diameter():
    own = TENSOR.thickness
    layers = [Piezo("disk", T, DENSITY, own.c33D, own.h33, own.eps33S)]
    layers += [Elastic(one.name, one.thickness, one.z, one.c, one.q) for one in (GLUE, MATCHING)]
    plate = Stack(tuple(layers), HalfSpace("back", 3e5), HalfSpace("front", 1.5e6))
    left = []
    for radius in (1.0, 10.0):
        wide = replace(stack(DISK, GLUE, MATCHING, radius=radius), back=3e5, front=1.5e6)
        left.append(difference(wide.impedance(F) * wide.area, plate.impedance(F)))
    assert left[0] < 0.02
    assert left[1] < 0.11 * left[0]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["constant", "causal", "open"])
def test_derivatives_are_exact(kind):
    layers = (GLUE, DISK, MATCHING)
    if kind == "causal":
        layers = tuple(replace(one, law=CausalConstantQ(0.7e6)) for one in layers)
    built = replace(stack(*layers, radius=4e-3), back=2e5, front=1.5e6)
    if kind == "open":
        built = built.with_load("interface:disk|ml1", OpenBond(0.1))
    names = list(built.parameters())[:: 3 if kind == "open" else 1]
    assert_exact_by_fourth_order(built, F, names, 0.01)


def test_a_reduced_section_serves_and_says_how_well():
    built = stack(DISK, GLUE, MATCHING)
    fewer, error = with_reduced_section(built, [(0.2e6, 1.4e6)])
    assert fewer.section.size < built.section.size
    assert error < 3e-4
    assert difference(fewer.impedance(F), stack(DISK, GLUE, MATCHING, finer=4).impedance(F)) < 5 * error
    softer = fewer.replace({"disk.c11E.re": 0.9 * TENSOR.c11E.real, "ml1.poisson": 0.38})
    assert section_error(softer, F) < 1e-3
    bare, error = with_reduced_section(stack(DISK), [(0.2e6, 1.4e6)])
    assert bare.section.size < 0.5 * stack(DISK).section.size  # it moves symmetrically
    assert error < 3e-5


def test_slopes_by_the_size_of_an_opening_and_by_a_law():
    glued = stack(DISK, GLUE, MATCHING)
    at = "interface:disk|glue1"
    here, there = (glued.with_load(at, OpenBond(part)) for part in (0.1, 0.1001))
    change = np.log(there.impedance(F) / here.impedance(F))
    np.testing.assert_allclose(here.moved_by_loads(F, there), change, atol=0.02 * np.abs(change).max())
    assert np.abs(glued.moved_by_loads(F, here)).max() > 0.05
    softer = glued.with_law("disk", "elastic", lambda _: CausalConstantQ(1e6))
    change = np.log(softer.impedance(F) / glued.impedance(F))
    np.testing.assert_allclose(glued.moved_by_laws(F, softer), change, atol=0.1 * np.abs(change).max())


def test_what_is_no_stack_is_refused():
    with pytest.raises(StackError, match="2 of its layers are piezoelectric; exactly one"):
        full_section((DISK, replace(DISK, name="other")), 1e6)
    with pytest.raises(StackError, match=r"Poisson's ratio is 0.5; -1 to 0.5"):
        replace(GLUE, poisson=0.5)
    with pytest.raises(StackError, match=r"loads are -1 and 413 Rayl"):
        replace(stack(DISK), back=-1.0)
    with pytest.raises(StackError, match="a Dot at 'face:front' is not in this model"):
        stack(DISK).with_load("face:front", Dot(0.1, 0.1, 1e7, 3e3))
    with pytest.raises(match="not all finite"):
        Waves.of(stack(DISK).section, stack(DISK).sizes, np.full((1, 13), np.nan + 0j), F[:1])
