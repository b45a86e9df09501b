"""A hole through the middle of all layers: against general finite elements, a textbook formula, limits, derivatives."""

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

T, DENSITY, RADIUS, HOLE = 2e-3, 7700.0, 6e-3, 2.5e-3
DISK = Ceramic2D("disk", TENSOR, T, DENSITY)
GLUE = Isotropic("glue1", 40e-6, 2.8e6, 2442.0, 13.0, 0.38)
MATCHING = Isotropic("ml1", 0.55e-3, 10.3e6, 2455.0, 60.0, 0.33)
SHORT = replace(DISK, electrode=0.9), replace(GLUE, reach=0.8), replace(MATCHING, reach=0.7)
F = np.linspace(0.2e6, 1.4e6, 7)


def ring(*layers, hole=HOLE, radius=RADIUS, finer=0):
    return Stack2D(layers, np.pi * (radius**2 - hole**2), full_section(layers, 1.5e6, finer), hole=hole)


def difference(one, other):
    return np.abs(np.log(one / other)).max()


@pytest.mark.parametrize(
    ("layers", "ends", "tolerance"),
    [
        ((DISK,), {}, 5e-4),
        ((DISK, GLUE, MATCHING), {}, 4e-3),
        pytest.param(SHORT, {"electrode": 0.9 * RADIUS}, 2e-3, marks=pytest.mark.long),
    ],
)
def test_a_ring_equals_general_finite_elements(layers, ends, tolerance):
    at = F[1::2]
    of = [FeLayer(T, DENSITY, tuple(complex(getattr(TENSOR, name)) for name in CONSTANTS), 6)]
    for one, cells in zip(layers[1:], (1, 4), strict=False):
        of.append(FeLayer.isotropic(one.thickness, one.z, one.c, one.q, one.poisson, cells))
    edges = {k: one.reach * RADIUS for k, one in enumerate(layers) if one.reach < 1}
    other = SkfemStack(RADIUS, of, per_thickness=6, ends=edges, hole=HOLE, **ends).impedance(at)
    assert difference(ring(*layers).impedance(at), other) < tolerance
    assert difference(ring(*layers, hole=0.0).impedance(at), other) > 0.3


def test_a_thin_ring_breathes_as_the_textbook_says():
    c = replace(TENSOR, **{name: getattr(TENSOR, name).real for name in CONSTANTS})
    own = replace(c, **{name: getattr(c, name) * (1 + 1e-4j) for name in CONSTANTS if name.startswith("c")})
    stiff = np.array([[c.c11E, c.c12E, c.c13E], [c.c12E, c.c11E, c.c13E], [c.c13E, c.c13E, c.c33E]])
    s11 = np.linalg.inv(stiff)[0, 0]
    f0 = np.sqrt(1 / (DENSITY * s11)) / (2 * np.pi * RADIUS)
    f = np.linspace(0.999, 1.001, 401) * f0
    for width, off in ((0.4e-3, 5e-4), (0.1e-3, 4e-5)):
        thin = replace(DISK, constants=own, thickness=width)
        G = (1 / ring(thin, hole=RADIUS - width / 2, radius=RADIUS + width / 2).impedance(f)).real
        assert f[G.argmax()] == pytest.approx(f0, rel=off)


@pytest.mark.parametrize("layers", [(DISK, GLUE, MATCHING), SHORT])
def test_a_tiny_hole_changes_nothing_and_a_small_one_as_its_area(layers):
    whole = ring(*layers, hole=0.0).impedance(F)
    assert difference(ring(*layers, hole=1e-9).impedance(F), whole) < 1e-8
    larger, smaller = (difference(ring(*layers, hole=hole).impedance(F), whole) for hole in (1e-5, 1e-6))
    assert smaller == pytest.approx(0.01 * larger, rel=0.02)


_SOME = ["area", "front.z", "disk.thickness", "disk.density", "disk.c11E.re", "disk.c12E.re", "ml1.poisson"]


@pytest.mark.parametrize(("layers", "names"), [((DISK, GLUE, MATCHING), _SOME), (SHORT, ["area", "disk.e33.re"])])
def test_derivatives_are_exact(layers, names):
    """As the area grows the rim moves outwards, and the hole stays."""
    built = replace(ring(*layers), back=2e5, front=1.5e6)
    assert_exact_by_fourth_order(built, F, names, 1.0)


@pytest.mark.parametrize(("layers", "part", "most"), [((DISK,), 0.5, 5e-5), ((DISK, GLUE, MATCHING), 1.0, 2e-3)])
def test_a_reduced_section_serves_and_says_how_well(layers, part, most):
    built = ring(*layers)
    fewer, error = with_reduced_section(built, [(0.2e6, 1.4e6)])
    assert fewer.section.size < part * built.section.size
    assert error < most
    assert difference(fewer.impedance(F), ring(*layers, finer=4).impedance(F)) < 10 * error


def test_holes_that_cannot_be_are_refused():
    with pytest.raises(StackError, match=r"hole has a radius of 0\.0043 m; 0 to below 0\.0042 m is allowed"):
        ring(*SHORT, hole=4.3e-3)
    with pytest.raises(StackError, match=r"hole has a radius of -0\.001 m"):
        ring(DISK, hole=-1e-3)
    assert ring(DISK, GLUE, MATCHING).faces_for(OpenBond) == ()
