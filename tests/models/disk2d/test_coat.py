"""Electrodes as coats of the faces of a disk: mass and stiffness compared with independent results."""

from dataclasses import replace

import numpy as np
import pytest
from built_disk import BuiltDisk, Ring, RingMass
from complex_ceramic import TENSOR
from exact_derivatives import assert_exact
from scipy.optimize import brentq

from pzctl.models.base.face_loads import Coat, Dot
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.disk2d.odd_training import trained_odd
from pzctl.models.disk2d.reduced import DiskError
from pzctl.models.disk2d.training import trained
from pzctl.models.effects import Device, find_effect
from pzctl.models.effects.base.scale import equivalent_plate
from pzctl.models.stack import CausalConstantQ

DENSITY, THICKNESS, RATIO = 7700.0, 2e-3, 8.0
LAW = CausalConstantQ(1e6)
LOSSLESS = Tensor6mm(*(getattr(TENSOR, name).real + 0j for name in CONSTANTS))


@pytest.fixture(scope="module")
def reduced():
    return trained(RATIO)


def disk(reduced, tensor=TENSOR):
    return Disk2D("disk", tensor, np.pi * (RATIO * THICKNESS / 2) ** 2, THICKNESS, DENSITY, reduced, LAW)


def test_a_coat_without_stiffness_is_a_mass_on_both_faces(reduced):
    bare, f = disk(reduced), np.linspace(0.2e6, 1.2e6, 4)
    mass = 0.02 * DENSITY * THICKNESS
    rings = tuple(RingMass(Ring(side, 0.0, 1.0), mass * bare.area) for side in ("back", "front"))
    heavy = BuiltDisk(TENSOR, RATIO / 2 * THICKNESS, THICKNESS, DENSITY, masses=rings, law=LAW).impedance(f)
    coated = bare.with_load("face:front", Coat(mass, speed=0.0)).impedance(f)
    np.testing.assert_allclose(coated / heavy, 1, atol=2e-3)
    assert np.abs(bare.impedance(f) / heavy - 1).max() > 0.1


def test_a_coat_stretches_a_radial_mode_as_it_does_a_thin_disk(reduced):
    # with the ceramic's own Poisson's ratio it adds to c11p t and to density t, and nothing else
    thin = LOSSLESS.radial
    mass = 0.01 * DENSITY * THICKNESS
    coat = Coat(mass, speed=6000.0, q=np.inf, poisson=thin.sigma_p.real)
    bare = disk(reduced, LOSSLESS)

    def resonance(of, near):
        return brentq(lambda f: of.impedance(np.array([f]))[0].imag, 0.97 * near, 1.02 * near, xtol=1e-3)

    guess = 2.05 / (2 * np.pi * RATIO / 2 * THICKNESS) * np.sqrt(thin.c11p.real / DENSITY)
    guess = min(np.linspace(0.85, 1.05, 81) * guess, key=lambda f: abs(bare.impedance(np.array([f]))[0]))
    without = resonance(bare, guess)
    stiffer = 1 + 2 * coat.tension[0].real / (thin.c11p.real * THICKNESS)
    heavier = 1 + 2 * mass / (DENSITY * THICKNESS)
    expected = np.sqrt(stiffer / heavier)
    assert abs(expected - 1) > 0.01
    found = resonance(bare.with_load("face:front", coat), without * expected) / without
    assert found - 1 == pytest.approx(expected - 1, rel=0.08)  # a disk so thick is no membrane


def test_derivatives_with_electrodes_are_exact():
    f, ratio = np.linspace(0.3e6, 1.3e6, 8), 3.0
    area, odd = np.pi * (ratio * THICKNESS / 2) ** 2, trained_odd(ratio)
    bare = Disk2D("disk", TENSOR, area, THICKNESS, DENSITY, trained(ratio), LAW, odd=lambda: odd)
    effect, plate = find_effect("electrode-mass"), equivalent_plate("disk", 1e-9, 1e6)
    own = [f"electrode-mass@face:front.{name}" for name in ("mass", "speed", "other")]
    absent = Device(bare, nominal=plate).with_effect(effect, "face:front")
    by_mass, by_speed, _ = absent.jacobian(f, own)[1]
    little = absent.replace({own[0]: 1e-6})
    np.testing.assert_allclose(np.log(little.impedance(f) / bare.impedance(f)) / 1e-6, by_mass, rtol=1e-3)
    assert not by_speed.any()
    device = absent.replace(dict(zip(own, (0.1, 2500.0, 0.6), strict=True)))
    assert_exact(device, f, [*bare.parameters(), *own], 3e-3)


def test_a_disk_has_dots_or_a_coat_and_effects_of_the_other_kind_are_not_looked_for(reduced):
    plate, dot = equivalent_plate("disk", 1e-9, 1e6), Dot(0.01, 1.0, 2e7, 2800.0)
    plain = disk(reduced)
    for_dots = replace(plain, loadable=lambda: None)
    mass, solder = find_effect("electrode-mass"), find_effect("local-mass")
    assert [one.looked_for_in(plain, plate) for one in (mass, solder)] == [("face:front",), ()]
    assert [one.looked_for_in(for_dots, plate) for one in (mass, solder)] == [(), ("face:front",)]
    with pytest.raises(DiskError, match="no dot can lie on 'face:front'"):
        plain.with_load("face:front", dot)
    with pytest.raises(DiskError, match="no coat can lie on 'face:front'"):
        for_dots.with_load("face:front", Coat(0.1, 3000.0))
