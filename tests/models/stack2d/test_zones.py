"""Electrodes and layers that end before the rim: against general finite elements, limits, derivatives, reduction."""

from dataclasses import replace

import numpy as np
import pytest
from complex_ceramic import TENSOR
from exact_derivatives import assert_exact_by_fourth_order
from stack_skfem import FeLayer, SkfemStack

from pzctl.models.base.face_loads import OpenBond
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.stack.loss_laws import StackError
from pzctl.models.stack2d.layers2d import Ceramic2D, Isotropic
from pzctl.models.stack2d.stack_model import Stack2D, full_section, with_reduced_section

T, DENSITY, RADIUS = 2e-3, 7700.0, 6e-3
DISK = Ceramic2D("disk", TENSOR, T, DENSITY)
GLUE = Isotropic("glue1", 40e-6, 2.8e6, 2442.0, 13.0, 0.38)
MATCHING = Isotropic("ml1", 0.55e-3, 10.3e6, 2455.0, 60.0, 0.33)
SHORT = replace(DISK, electrode=0.9), replace(GLUE, reach=0.8), replace(MATCHING, reach=0.7)
F = np.linspace(0.2e6, 1.4e6, 7)


def stack(*layers, finer=0):
    return Stack2D(layers, np.pi * RADIUS**2, full_section(layers, 1.5e6, finer))


def difference(one, other):
    return np.abs(np.log(one / other)).max()


@pytest.mark.long
def test_layers_and_electrodes_that_end_one_by_one_equal_general_finite_elements():
    at = F[1::4]
    layers = [FeLayer(T, DENSITY, tuple(complex(getattr(TENSOR, name)) for name in CONSTANTS), 4)]
    for one, cells in ((GLUE, 1), (MATCHING, 2)):
        layers.append(FeLayer.isotropic(one.thickness, one.z, one.c, one.q, one.poisson, cells))
    edges = {k: one.reach * RADIUS for k, one in enumerate(SHORT) if k > 0}
    other = SkfemStack(RADIUS, layers, per_thickness=8, ends=edges, electrode=0.9 * RADIUS).impedance(at)
    assert difference(stack(*SHORT).impedance(at), other) < 2e-3
    assert difference(stack(DISK, *SHORT[1:]).impedance(at), other) > 0.1
    assert difference(stack(SHORT[0], GLUE, MATCHING).impedance(at), other) > 0.1


def test_a_gap_in_the_glue_at_the_rim_equals_general_finite_elements():
    at = F[1::4]
    layers = [FeLayer(T, DENSITY, tuple(complex(getattr(TENSOR, name)) for name in CONSTANTS), 4)]
    for one, cells in ((GLUE, 1), (MATCHING, 2)):
        layers.append(FeLayer.isotropic(one.thickness, one.z, one.c, one.q, one.poisson, cells))
    other = SkfemStack(RADIUS, layers, per_thickness=6, ends={1: 0.8 * RADIUS}).impedance(at)
    assert difference(stack(DISK, SHORT[1], MATCHING).impedance(at), other) < 1e-3
    assert difference(stack(DISK, GLUE, MATCHING).impedance(at), other) > 0.1


def test_what_ends_almost_at_the_rim_or_at_the_axis_changes_nothing():
    near = 1 - 1e-7
    whole = stack(DISK, GLUE, MATCHING, finer=4).impedance(F)
    short = replace(DISK, electrode=near), replace(GLUE, reach=near), replace(MATCHING, reach=near)
    assert difference(stack(*short).impedance(F), whole) < 1e-3
    tiny = replace(GLUE, reach=1e-4), replace(MATCHING, reach=1e-4)
    assert difference(stack(DISK, *tiny).impedance(F), stack(DISK).impedance(F)) < 1e-5


@pytest.mark.long
def test_derivatives_are_exact():
    built = replace(stack(*SHORT), back=2e5, front=1.5e6)
    names = list(built.parameters())[::5]
    assert_exact_by_fourth_order(built, F, names, 1.0)


@pytest.mark.parametrize(("layers", "part"), [(SHORT[:1], 0.3), ((DISK, *SHORT[1:]), 0.7)])
def test_reduced_parts_serve_and_say_how_well(layers, part):
    built = stack(*layers)
    fewer, error = with_reduced_section(built, [(0.2e6, 1.4e6)])
    assert fewer.section.size < part * built.section.size
    assert error < 3e-4
    assert difference(fewer.impedance(F), stack(*layers, finer=4).impedance(F)) < 1e-3
    name = "disk.e33.re"
    _, J = fewer.jacobian(F, [name])
    value = fewer.parameters()[name]
    step = 1e-4 * value
    there, back = (fewer.replace({name: value + change}).impedance(F) for change in (step, -step))
    numeric = np.log(there / back) / (2 * step)
    np.testing.assert_allclose(J[0], numeric, atol=1e-4 * np.abs(numeric).max())


def test_what_cannot_end_is_refused():
    with pytest.raises(StackError, match=r"layer 'ml1' has 1\.2 of the radius of the stack; more than 0 and at most 1"):
        replace(MATCHING, reach=1.2)
    with pytest.raises(StackError, match=r"layer 'disk': its electrode has 0 of the radius"):
        replace(DISK, electrode=0.0)
    assert stack(*SHORT).faces_for(OpenBond) == ()
