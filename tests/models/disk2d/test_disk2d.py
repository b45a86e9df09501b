"""The disk in r and z compared with independent results: plate, thin disk, rod, statics, a strong-form solution."""

from dataclasses import replace

import numpy as np
import pytest
from built_disk import BuiltDisk
from complex_ceramic import MATERIAL, TENSOR
from disk_skfem import SkfemDisk
from exact_derivatives import assert_exact
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import j0, j1

from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.basis import krylov, split
from pzctl.models.disk2d.capacitance import solved
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.error_estimate import estimate
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.line_elements import LineElements
from pzctl.models.disk2d.matrices import CONSTANTS, assemble
from pzctl.models.disk2d.reduced import ReducedDisk
from pzctl.models.disk2d.training import DiskError, ensured, sampled, trained
from pzctl.models.effects import Device, find_effect
from pzctl.models.effects.base import scale
from pzctl.models.effects.base.modified_laws import LossExponent
from pzctl.models.materials import find
from pzctl.models.stack import VACUUM, CausalConstantQ, Piezo, Stack

C = np.array([getattr(TENSOR, name) for name in CONSTANTS])
DENSITY = 7700.0
CAUSAL = CausalConstantQ(1e6)


@pytest.fixture(scope="module")
def five():
    return FullDisk.of(5), trained(5)


def disk(reduced, ratio=5.0, thickness=2e-3, tensor=TENSOR, law=CAUSAL):
    area = np.pi * (ratio * thickness / 2) ** 2
    return Disk2D("disk", tensor, area, thickness, DENSITY, reduced, law)


def test_without_in_plane_motion_the_disk_is_a_one_dimensional_plate():
    line = LineElements(np.linspace(0, 1, 3), 4)
    clamped = FullDisk(assemble(line, LineElements(np.array([0.0, 0.5, 1.0]), 10), move_in_plane=False))
    plate = TENSOR.thickness
    t, f = 2e-3, np.linspace(0.1e6, 3.5e6, 9)
    stack = Stack((Piezo("p", t, DENSITY, plate.c33D, plate.h33, plate.eps33S),), VACUUM, VACUUM, np.pi * 1e-4)
    Y = 2j * np.pi * f * clamped.capacitance(Shape(1e-2, t, DENSITY), C, f)
    np.testing.assert_allclose(Y * stack.impedance(f), 1, atol=1e-6)


def test_far_below_resonance_the_capacitance_has_the_free_permittivity():
    shape = Shape(1e-2, 2e-3, DENSITY)
    found = FullDisk.of(10).capacitance(shape, C, np.array([1.0]))[0]
    assert found == pytest.approx(TENSOR.radial.eps33T * np.pi * 1e-4 / 2e-3, rel=1e-8)


def resonance(full, shape, low, high):
    """Return the series resonance of the lossless disk between two frequencies: where 1/C vanishes."""
    return brentq(lambda f: 1 / full.capacitance(shape, C.real + 0j, np.array([f]))[0].real, low, high, xtol=1e-2)


@pytest.mark.long
def test_the_thin_disk_limit_is_reached_as_thickness_squared():
    lossless = Tensor6mm(*C.real).radial
    sigma, speed = lossless.sigma_p.real, np.sqrt(lossless.c11p.real / DENSITY)
    eta = brentq(lambda x: x * j0(x) / j1(x) - 1 + sigma, 1.8, 2.3)
    thin = eta * speed / (2 * np.pi * 10e-3)
    off = [
        resonance(FullDisk.of(20e-3 / t), Shape(10e-3, t, DENSITY), 0.99 * thin, 1.005 * thin) / thin - 1
        for t in (1e-3, 0.5e-3)
    ]
    assert off[0] / off[1] == pytest.approx(4, rel=0.02)
    alpha = (TENSOR.c13E / TENSOR.c33E).real  # second order: the mass of motion through the thickness
    expected = -((alpha / 40) ** 2) * (eta**2 / 6 + (1 - sigma) / 3 * eta**2 / (eta**2 - 1 + sigma**2))
    assert off[1] == pytest.approx(expected, rel=0.03)


def test_a_slender_rod_has_the_length_mode_of_k33():
    long, t = FullDisk(assemble(LineElements(np.array([0.0, 1.0]), 6), LineElements(np.linspace(0, 1, 3), 8))), 20e-3
    real = Tensor6mm(*C.real)
    s33D, s33E = real.sD[2, 2].real, real.sE[2, 2].real
    k2 = real.d[2, 2].real ** 2 / (s33E * real.epsT[2, 2].real)
    parallel = np.sqrt(1 / (s33D * DENSITY)) / (2 * t)

    def off(radius):
        shape = Shape(radius, t, DENSITY)
        series = resonance(long, shape, 0.68 * parallel, 0.9 * parallel)
        x = brentq(lambda x: k2 * np.tan(x) - x, 0.5, np.pi / 2 - 1e-6)
        return series / (parallel * 2 * x / np.pi) - 1

    # the remaining difference is lateral inertia (Rayleigh) and the field beside the axis, both as radius squared
    assert abs(off(0.25e-3)) < 1e-3
    assert off(0.5e-3) / off(0.25e-3) == pytest.approx(4, rel=0.1)


def chebyshev(n):
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.where((np.arange(n + 1) % n) == 0, 2.0, 1.0) * (-1.0) ** np.arange(n + 1)
    D = np.outer(c, 1 / c) / (x[:, None] - x[None, :] + np.eye(n + 1))
    return D - np.diag(D.sum(axis=1)), x


def strong_form(shape, constants, frequency, nr, nz):
    """Y/(jw) by collocation of the differential equations and boundary conditions on a Chebyshev tensor grid.

    It shares nothing with finite elements: no variational form, no quadrature of energy. Odd nr: no point on the axis,
    the functions' parity in r and z folds the grid to a quarter.
    """
    c11, c12, c13, c33, c44, e31, e33, e15, p11, p33 = constants
    a, b = shape.radius, shape.thickness / 2
    Dr, x = chebyshev(nr)
    Dz, _ = chebyshev(nz)
    hr, hz = (nr + 1) // 2, (nz + 1) // 2
    r = a * x[:hr]

    def folded(D, h, parity):
        return D[:h, :h] + parity * D[:h, h:][:, ::-1]

    R = {s: folded(Dr, hr, s) / a for s in (1, -1)}
    Z = {s: folded(Dz, hz, s) / b for s in (1, -1)}
    Ir, Iz = np.eye(hr), np.eye(hz)
    over = np.diag(1 / r)
    N = hr * hz
    zero = np.zeros((N, N))

    def row(u, w, p):
        return np.hstack([u, w, p])

    def k(A, B):
        return np.kron(A, B)

    # parities in (r, z): u_r (-, +), u_z (+, -), phi (+, -)
    ur, uz, ut = k(R[-1], Iz), k(Ir, Z[1]), k(over, Iz)
    wr, wz, pr, pz = k(R[1], Iz), k(Ir, Z[-1]), k(R[1], Iz), k(Ir, Z[-1])
    Trr = row(c11 * ur + c12 * ut, c13 * wz, e31 * pz)
    Ttt = row(c12 * ur + c11 * ut, c13 * wz, e31 * pz)
    Tzz = row(c13 * (ur + ut), c33 * wz, e33 * pz)
    Trz = row(c44 * uz, c44 * wr, e15 * pr)
    Er = row(e15 * uz, e15 * wr, -p11 * pr)
    Ez = row(e31 * (ur + ut), e33 * wz, -p33 * pz)
    # parities of the fluxes: Trr, Tzz, Ez (+, +); Trz, Er (-, -)
    div_u = k(R[1], Iz) @ Trr + k(Ir, Z[-1]) @ Trz + k(over, Iz) @ (Trr - Ttt)
    div_w = k(R[-1], Iz) @ Trz + k(Ir, Z[1]) @ Tzz + k(over, Iz) @ Trz
    div_p = k(R[-1], Iz) @ Er + k(Ir, Z[1]) @ Ez + k(over, Iz) @ Er
    eye = np.eye(N)
    rim = np.zeros((hr, hz), bool)
    rim[0] = True
    face = np.zeros((hr, hz), bool)
    face[:, 0] = True
    rim, face = rim.ravel(), face.ravel()
    made = []
    for f in frequency:
        s = DENSITY * (2 * np.pi * f) ** 2
        u, w = div_u + s * row(eye, zero, zero), div_w + s * row(zero, eye, zero)
        p, right = div_p.copy(), np.zeros(3 * N, complex)
        u[rim], w[rim], p[rim] = Trr[rim], Trz[rim], Er[rim]
        u[face & ~rim], w[face] = Trz[face & ~rim], Tzz[face]
        p[face] = row(zero, zero, eye)[face]
        right[2 * N + np.flatnonzero(face)] = 0.5
        M = np.vstack([u, w, p])
        scale = np.abs(M).max(axis=1)
        v = np.linalg.solve(M / scale[:, None], right / scale)
        density = (Ez @ v).reshape(hr, hz)[:, 0]
        # charge: an even function of r times r, integrated as a polynomial in x^2
        even = np.polynomial.legendre.Legendre.fit(2 * x[:hr] ** 2 - 1, density.real, hr - 1)
        odd = np.polynomial.legendre.Legendre.fit(2 * x[:hr] ** 2 - 1, density.imag, hr - 1)
        points, weights = np.polynomial.legendre.leggauss(hr + 2)
        made.append(-np.pi * a**2 / 2 * np.sum(weights * (even(points) + 1j * odd(points))))
    return np.array(made)


@pytest.mark.parametrize(("ratio", "name"), [(5, "test ceramic"), (3, "PIC255"), (8, "PZT-5A")])
def test_a_strong_form_solution_agrees(ratio, name):
    constants = np.array([find(name, (MATERIAL,)).values[key].value for key in CONSTANTS])
    shape, f = Shape(ratio * 1e-3, 2e-3, DENSITY), np.array([0.05e6, 0.4e6, 0.9e6])
    other = strong_form(shape, constants, f, 31 if ratio < 8 else 41, 15)
    np.testing.assert_allclose(other / FullDisk.of(ratio).capacitance(shape, constants, f), 1, atol=2e-3)


@pytest.mark.parametrize(("ratio", "name"), [(5, "test ceramic"), (10, "PZT-5A")])
def test_a_general_finite_element_package_agrees(ratio, name):
    constants = np.array([find(name, (MATERIAL,)).values[key].value for key in CONSTANTS])
    shape = Shape(ratio * 1e-3, 2e-3, DENSITY)
    f = np.array([0.05e6, 0.4e6, 0.9e6, 1.05e6, 1.2e6, 1.6e6])
    other, own = SkfemDisk(shape.radius, shape.thickness, 3), FullDisk.of(ratio)
    np.testing.assert_allclose(
        other.capacitance(constants, DENSITY, f) / own.capacitance(shape, constants, f), 1, atol=2e-4
    )
    near = np.sqrt(Tensor6mm(*constants).radial.c11p.real / DENSITY) * 2.07 / (2 * np.pi * shape.radius)
    places = [
        brentq(lambda f, of=of: 1 / of(np.array([f]))[0].real, 0.9 * near, 1.02 * near, xtol=0.02)
        for of in (
            lambda f: other.capacitance(constants.real + 0j, DENSITY, f),
            lambda f: own.capacitance(shape, constants.real + 0j, f),
        )
    ]
    assert places[0] == pytest.approx(places[1], rel=1e-6)


@pytest.mark.long
def test_a_finer_mesh_does_not_change_the_result(five):
    shape, f = Shape(5e-3, 2e-3, DENSITY), np.array([0.3e6, 1.0e6, 1.6e6])
    ratio = FullDisk.of(5, finer=1).capacitance(shape, C, f) / five[0].capacitance(shape, C, f)
    np.testing.assert_allclose(ratio, 1, atol=5e-6)


@given(st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_the_reduced_disk_equals_the_full_one_within_its_box(five, seed):
    full, reduced = five
    rng = np.random.default_rng(seed)
    tan = np.where(np.arange(10) < 5, rng.uniform(0.005, 0.02), np.where(np.arange(10) < 8, 0.0, -0.015))
    c = np.tile(sampled(rng) * (1 + 1j * tan), (101, 1))
    f, shape = np.linspace(0.05e6, 1.6e6, 101), Shape(5e-3, 2e-3, DENSITY)
    some = slice(None, None, 20)
    C2 = solved(reduced, shape, c, f).capacitance
    np.testing.assert_allclose(C2[some] / full.capacitance(shape, c[some], f[some]), 1, atol=1e-4)
    assert np.all(C2.imag < 0)  # passive constants, a passive disk


def test_derivatives_by_every_parameter(five):
    model = disk(five[1])
    f = np.linspace(0.1e6, 1.5e6, 101)
    names = list(model.parameters())
    Z, _ = model.jacobian(f, names)
    np.testing.assert_allclose(Z, model.impedance(f), rtol=1e-12)
    assert_exact(model, f, names, 5e-3)


def test_a_loss_that_depends_on_frequency_acts_on_the_stiffnesses_of_its_layer_alone(five):
    plain, effect = disk(five[1]), find_effect("loss-dispersion")
    nominal = Stack((Piezo("disk", 2e-3, DENSITY, 1.5e11, 2e9, 8e-9, c_law=CAUSAL),), VACUUM, VACUUM, plain.area)
    f = np.linspace(0.3e6, 1.5e6, 7)
    device = Device(plain, nominal=nominal).with_effect(effect, "layer:disk", {"exponent": 0.5})
    bent = replace(plain, elastic=LossExponent(CAUSAL, scale.resonance(nominal), 0.5, 1.0))
    np.testing.assert_allclose(device.impedance(f), bent.impedance(f))
    assert np.abs(device.impedance(f) / plain.impedance(f) - 1).max() > 1e-3
    assert plain.with_law("glue", "elastic", lambda law: law) is plain
    name, value = "disk.c33E.im", plain.parameters()["disk.c33E.im"]
    _, slope = bent.jacobian(f, [name])
    ends = [bent.replace({name: value * side}).impedance(f) for side in (1.001, 0.999)]
    np.testing.assert_allclose(slope[0], np.log(ends[0] / ends[1]) / (0.002 * value), rtol=1e-3)


def test_constants_that_are_not_finite_are_refused(five):
    with pytest.raises(DiskError, match="these constants are not finite: they are those of no disk"):
        disk(five[1]).replace({"disk.c33E.re": np.nan}).impedance(np.linspace(1e5, 1e6, 11))


def test_the_estimate_bounds_the_error_and_guides_enrichment(five):
    full, reduced = five
    far = np.tile(C.real * np.array([1.9, 1.6, 1.7, 0.6, 2.2, 2.5, 0.5, 2, 3, 0.4]) * (1 + 0.01j), (5, 1))
    f, shape = np.array([0.2e6, 0.7e6, 1.1e6, 1.4e6, 1.6e6]), Shape(5.4e-3, 2e-3, DENSITY)
    true = full.capacitance(shape, far, f)

    def error(of):
        weights = shape.weights(far)
        made = []
        for k, frequency in enumerate(f.tolist()):
            x = of.solution(shape, weights[k], frequency)
            form = x @ (full.system(weights[k], -((2 * np.pi * frequency) ** 2) * shape.mass) @ x)
            made.append(abs(-4 * np.pi * form / true[k] - 1))
        return np.array(made)

    before = error(reduced)
    assert before.max() > 1e-4
    assert np.all(estimate(full, reduced, shape, far, f) > before)
    better, said = ensured(full, reduced, shape, far, f)
    assert said < 1e-4
    assert error(better).max() < 1e-4


def test_sizes_scale(five):
    one = disk(five[1])
    f = np.linspace(0.1e6, 1.5e6, 50)
    law = CausalConstantQ(0.5e6)
    two = disk(five[1], thickness=4e-3, law=law)
    np.testing.assert_allclose(two.impedance(f / 2), one.impedance(f), rtol=1e-9)


def test_a_rough_curve_is_accurate_to_about_a_thousandth(five):
    f = np.linspace(0.1e6, 1.5e6, 301)
    exact = disk(five[1])
    rough = replace(exact, rough=True).impedance(f) / exact.impedance(f)
    assert 1e-7 < np.abs(rough - 1).max() < 5e-3


def test_results_do_not_depend_on_the_number_of_frequencies(five):
    model, f = disk(five[1]), np.linspace(0.1e6, 1.5e6, 301)
    many = model.impedance(f)
    for k in ([150], [150, 151], [299, 20, 150]):
        np.testing.assert_allclose(model.impedance(f[k]), many[k], rtol=2e-3)


@pytest.mark.long
def test_the_reduced_disk_equals_the_full_section_with_short_electrodes():
    ratio, electrode, f, some = 2.0, 0.85, np.linspace(0.1e6, 1.5e6, 41), slice(1, None, 12)
    full = FullDisk.of(ratio, electrode=electrode)
    reduced = ReducedDisk.of(
        full, *split(full, [krylov(full, Shape(2e-3, 2e-3, DENSITY), C.real, at) for at in (0.4e6, 1.2e6)])
    )
    model = disk(reduced, ratio)
    built = BuiltDisk(TENSOR, ratio * 1e-3, 2e-3, DENSITY, electrode=electrode, law=CAUSAL)
    Z = model.impedance(f)
    np.testing.assert_allclose(Z[some] / built.impedance(f[some]), 1, atol=5e-4)
    rim = FullDisk.of(ratio).capacitance(model.shape, model.over(f)[some], f[some])
    assert np.abs(2j * np.pi * f[some] * rim * Z[some] - 1).max() > 0.05
    c = model.over(f)[some]
    error = np.abs(1 / (2j * np.pi * f[some] * Z[some]) / full.capacitance(model.shape, c, f[some]) - 1)
    assert error.max() < estimate(full, reduced, model.shape, c, f[some]).max()
    assert error.max() < 1e-4
    assert_exact(model, f, list(model.parameters()), 5e-3)


def test_a_disk_out_of_reach_is_refused():
    with pytest.raises(DiskError, match="diameter/thickness 100"):
        trained(100)


def test_derivatives_by_laws_of_losses_behind_a_lead_are_those_of_the_impedance(five):
    """They follow from the derivatives by constants, without a further solution of the disk."""
    plain = disk(five[1])
    nominal = Stack((Piezo("disk", 2e-3, DENSITY, *_plate()),), VACUUM, VACUUM, plain.area)
    device = Device(plain, nominal=nominal)
    device = device.with_effect(find_effect("loss-dispersion"), "layer:disk", {"exponent": 0.4, "companion": 0.5})
    device = device.with_effect(find_effect("dielectric-dispersion"), "layer:disk", {"slope": 0.01})
    device = device.with_effect(find_effect("lead-inductance"), "terminals", {"inductance": 1e-7})
    f = np.linspace(0.4e6, 1.5e6, 101)
    laws = ["loss-dispersion@layer:disk.exponent", "dielectric-dispersion@layer:disk.slope"]
    _, found = device.jacobian(f, laws)
    for name, own in zip(laws, found, strict=True):
        value, step = device.parameters()[name], 1e-4
        above, below = (device.replace({name: value + sign * step}).impedance(f) for sign in (1, -1))
        np.testing.assert_allclose(own, np.log(above / below) / (2 * step), atol=2e-3 * np.abs(own).max())


def _plate():
    return TENSOR.thickness.c33D, TENSOR.thickness.h33, TENSOR.thickness.eps33S


def test_a_copy_of_a_disk_with_other_values_keeps_its_own_results(five):
    plain, f = disk(five[1]), np.linspace(0.4e6, 1.5e6, 11)
    first = plain.impedance(f)
    softer = plain.replace({"disk.c44E.re": 0.9 * TENSOR.c44E.real})
    fresh = replace(softer, _known=[])
    np.testing.assert_allclose(softer.impedance(f), fresh.impedance(f), rtol=1e-12)
    assert np.abs(softer.impedance(f) / first - 1).max() > 0.01
    np.testing.assert_array_equal(plain.impedance(f), first)
