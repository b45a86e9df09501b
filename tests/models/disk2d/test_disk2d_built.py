"""The disk with layers, short electrodes and masses, compared with one dimension, conformal mapping, and itself."""

from dataclasses import replace

import numpy as np
import pytest
from built_disk import Bonded, BuiltDisk, RingMass
from complex_ceramic import TENSOR
from cross_section import Ring

from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.stack import VACUUM, CausalConstantQ, Elastic, Mass, Piezo, Stack
from pzctl.models.stack.loss_laws import StackError

DENSITY, T = 7700.0, 2e-3
BARE = BuiltDisk(TENSOR, 1e-3, T, DENSITY)
F = np.array([0.6e6, 1.2e6])
BACKING = Bonded("backing", 0.3e-3, 5e6, 2500.0, 20.0, 0.3)
GLUE = Bonded("glue", 20e-6, 2.8e6, 2442.0, 13.0, 0.38)
MATCHING = Bonded("ml1", 0.55e-3, 10.3e6, 2455.0, 30.0, 0.3)


def plate(layers, mass=0.0, law=None):
    """The same in one dimension, by the stack's transfer matrices."""
    own = TENSOR.thickness
    ceramic = Piezo("p", T, DENSITY, own.c33D, own.h33, own.eps33S)
    made = [Elastic(b.name, b.thickness, b.z, b.c, b.q) for b in layers]
    ends = (Mass("m", mass),) if mass else ()
    return Stack((*made[:1], ceramic, *made[1:], *ends), VACUUM, VACUUM, np.pi * BARE.radius**2)


def test_a_bare_full_section_equals_the_half_section():
    constants = np.array([getattr(TENSOR, name) for name in CONSTANTS])
    half = FullDisk.of(1).capacitance(Shape(1e-3, T, DENSITY), constants, F)
    np.testing.assert_allclose(2j * np.pi * F * half * BARE.impedance(F), 1, atol=1e-9)


def test_without_in_plane_motion_layers_equal_the_stacks():
    clamped = replace(BARE, back=(BACKING,), front=(GLUE, MATCHING), clamped=True)
    f = np.linspace(0.1e6, 1.6e6, 4)
    np.testing.assert_allclose(clamped.impedance(f) / plate((BACKING, GLUE, MATCHING)).impedance(f), 1, atol=1e-6)


def test_without_in_plane_motion_a_face_mass_equals_the_stacks():
    area = np.pi * BARE.radius**2
    mass = RingMass(Ring("front", 0.0, 1.0), 0.3 * area)
    loaded = replace(BARE, masses=(mass,), clamped=True).impedance(F)
    np.testing.assert_allclose(loaded / plate((), 0.3).impedance(F), 1, atol=1e-6)
    assert np.abs(loaded / replace(BARE, clamped=True).impedance(F) - 1).max() > 0.01


def test_a_spot_and_its_ring_equal_a_uniform_mass():
    whole = replace(BARE, masses=(RingMass(Ring("back", 0.0, 1.0), 4e-6),))
    parts = (RingMass(Ring("back", 0.0, 0.5), 1e-6), RingMass(Ring("back", 0.5, 1.0), 3e-6))
    np.testing.assert_allclose(replace(BARE, masses=parts).impedance(F) / whole.impedance(F), 1, atol=1e-4)


def test_a_thin_soft_layer_acts_as_a_mass_in_all_directions():
    film = Bonded("film", 1e-6, 20e3 * 300.0, 300.0, 1e3, 0.3)
    mass = RingMass(Ring("front", 0.0, 1.0), 20e3 * 1e-6 * np.pi * BARE.radius**2)
    with_film, with_mass = (replace(BARE, **kind).impedance(F) for kind in ({"front": (film,)}, {"masses": (mass,)}))
    moved = np.abs(with_mass / BARE.impedance(F) - 1).max()
    assert moved > 1e-3
    assert np.abs(with_film / with_mass - 1).max() < 0.01 * moved


@pytest.mark.long
def test_a_layer_in_two_parts_equals_the_whole():
    parts = (replace(MATCHING, thickness=0.25e-3), replace(MATCHING, thickness=0.3e-3))
    one, two = (replace(BARE, front=layers).impedance(F) for layers in ((MATCHING,), parts))
    np.testing.assert_allclose(one / two, 1, atol=5e-4)
    assert np.abs(one / BARE.impedance(F) - 1).max() > 0.1


def test_electrodes_to_the_rim_are_the_limit_of_short_ones():
    short = replace(BARE, electrode=1 - 1e-6).impedance(F)
    np.testing.assert_allclose(short / BARE.impedance(F), 1, atol=1e-5)


@pytest.mark.long
def test_far_below_resonance_short_electrodes_have_the_fringe_of_conformal_mapping():
    # stiff and without piezoelectricity: a dielectric slab; its field reaches t/pi ln 2 sqrt(eps11/eps33) beyond them
    dead = Tensor6mm(1e11, 3e10, 3e10, 1e11, 3e10, 0.0, 0.0, 0.0, 2e-9, 8e-9)
    disk = BuiltDisk(dead, 3e-3, T, DENSITY, electrode=0.7)
    f = np.array([1e3])
    C = (1 / (2j * np.pi * f * disk.impedance(f)))[0].real
    reach = np.sqrt(C * T / (np.pi * 8e-9)) - 2.1e-3
    assert reach == pytest.approx(T * np.log(2) / np.pi / 2, rel=0.03)


@pytest.mark.long
def test_a_finer_mesh_hardly_changes_the_result():
    built = replace(BARE, front=(MATCHING,))
    np.testing.assert_allclose(replace(built, finer=1).impedance(F) / built.impedance(F), 1, atol=3e-4)


def test_losses_of_layers_are_causal():
    law = CausalConstantQ(0.6e6)
    there = replace(BARE, front=(MATCHING,))
    np.testing.assert_allclose(
        replace(there, law=law).impedance(F[:1]) / there.impedance(F[:1]), 1, atol=1e-12
    )  # at its reference frequency the law is the same
    assert np.abs(replace(there, law=law).impedance(F[1:]) / there.impedance(F[1:]) - 1)[0] > 1e-3


def test_shear_speed_or_poissons_ratio():
    nu = Bonded.of_shear("x", 1e-3, 3e6, 2500.0, 50.0, 1250.0)
    assert nu.poisson == pytest.approx(1 / 3)
    assert nu.lame[1].real == pytest.approx(nu.density * 1250.0**2)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: replace(GLUE, poisson=0.5), "Poisson's ratio is 0.5"),
        (lambda: Bonded.of_shear("x", 1e-3, 3e6, 2500.0, 50.0, 2400.0), "shear speed is 2400"),
        (lambda: replace(BARE, electrode=1.2), "electrode's radius is 1.2"),
        (lambda: replace(BARE, masses=(RingMass(Ring("back", 0.5, 0.2), 1e-6),)), "from 0.5 to 0.2"),
    ],
)
def test_impossible_layers_are_refused(make, says):
    with pytest.raises(StackError, match=says):
        make()
