"""The radial mode compared with a direct solution of its differential equation, published numbers and its limits."""

import mpmath
import numpy as np
import pytest
from complex_ceramic import MATERIAL, TENSOR
from disk_skfem import SkfemDisk
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import chebyshev
from passive_coordinates import radial_from_coordinates
from scipy.optimize import brentq

from pzctl.models.constants.piezo_constants import Radial
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk.bessel import RadialResonance
from pzctl.models.disk.radial import RadialError
from pzctl.models.disk.round_disk import BothModes, RadialDisk
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.materials import SHERRIT_RADIAL, find
from pzctl.models.stack import VACUUM, CausalConstantQ, Piezo, Stack

AREA, THICKNESS, DENSITY = np.pi * 5e-3**2, 0.5e-3, 7800.0
DISK = RadialDisk.of("disk", SHERRIT_RADIAL, AREA, THICKNESS, DENSITY)


def collocated(constants, frequency, count=48):
    """Y of the thin disk by collocation of r^2 u'' + r u' - u + (w^2 rho/c11p) r^2 u = 0, stress-free at the rim."""
    a = np.sqrt(AREA / np.pi)
    r = (1 + np.cos(np.pi * np.arange(count) / (count - 1))) / 2  # Chebyshev points of (0, 1), rim first
    V = chebyshev.chebvander(2 * r - 1, count - 1)
    identity = np.eye(count)
    D = np.stack([chebyshev.chebval(2 * r - 1, chebyshev.chebder(c)) for c in identity], 1) * 2
    DD = np.stack([chebyshev.chebval(2 * r - 1, chebyshev.chebder(c, 2)) for c in identity], 1) * 4
    Y = []
    for f in frequency:
        w = 2 * np.pi * f
        A = (r**2)[:, None] * DD + r[:, None] * D - V + (w**2 * DENSITY * a**2 / constants.c11p * r**2)[:, None] * V
        A[0] = constants.c11p / a * (D[0] + constants.sigma_p * V[0])
        A[-1] = V[-1]
        b = np.zeros(count, complex)
        b[0] = constants.e31p / THICKNESS
        rim = V[0] @ np.linalg.solve(A, b)
        Y.append(1j * w * (constants.eps33p * AREA / THICKNESS + constants.e31p * 2 * np.pi * a * rim))
    return np.array(Y)


def test_the_closed_form_solves_the_differential_equation():
    f = np.linspace(20e3, 1.5e6, 60)
    assert 1 / DISK.impedance(f) == pytest.approx(collocated(SHERRIT_RADIAL, f), rel=1e-9)


@given(seed=st.integers(0, 10**6))
def test_passive_constants_give_a_passive_disk(seed):
    x = np.random.default_rng(seed).uniform(-1, 1, 8)
    x[4:7] -= 2  # loss tangents of tenths, not of one
    scale = np.array([1e-11, 1e-11, np.sqrt(1e-11 * 1e-8), 1e-8])
    constants = Radial(*(radial_from_coordinates(x)[0] * scale))
    disk = RadialDisk.of("disk", constants, AREA, THICKNESS, DENSITY)
    assert (1 / disk.impedance(np.geomspace(1e3, 1e7, 300))).real.min() >= 0


def test_far_below_resonance_it_is_the_free_capacitance():
    C = 1 / (2j * np.pi * 40 * DISK.impedance(np.array([40.0]))[0])
    assert pytest.approx(SHERRIT_RADIAL.eps33T * AREA / THICKNESS, rel=1e-6) == C


# Roots of J(eta) = 1 - sigma. Without Poisson's ratio they are the zeros of J1' (Abramowitz & Stegun, table 9.5);
# those of 0.3 are in the textbooks with three decimals.
@pytest.mark.parametrize(
    ("sigma", "roots", "digit"), [(0.30, (2.049, 5.389, 8.572), 5e-4), (0.0, (1.84118, 5.33144, 8.53632), 5e-6)]
)
def test_resonances_are_the_tabulated_roots(sigma, roots, digit):
    c11p = 1e11
    lossless = Radial.from_planar(c11p, sigma, 0.5, 1e-8)
    disk = RadialDisk.of("disk", lossless, AREA, THICKNESS, DENSITY)
    a = np.sqrt(AREA / np.pi)
    for root in roots:
        # |Y| changes sign through infinity within half a unit of the table's last digit
        f = np.array([root - digit, root + digit]) * np.sqrt(c11p / DENSITY) / (2 * np.pi * a)
        Y = 1 / disk.impedance(f)
        assert Y[0].imag > 0 > Y[1].imag


def test_the_bessel_quotient_is_accurate_from_40_hz_to_heavy_loss():
    sigma = 0.31 + 0.02j
    for eta in (1e-4, 0.5 + 0.01j, 3.8317059702, 40 - 0.3j, 300 - 900j):
        found = RadialResonance.at(np.array([eta + 0j]), np.array([sigma]))
        with mpmath.workdps(50):
            e, s = mpmath.mpmathify(complex(eta)), mpmath.mpmathify(sigma)
            J0, J1 = mpmath.besselj(0, e), mpmath.besselj(1, e)
            exact = complex(J1 / (e * J0 - (1 - s) * J1))
            slope = complex((e**2 * (J0**2 + J1**2) - 2 * e * J0 * J1) / (e * J0 - (1 - s) * J1) ** 2)
        assert found.F[0] == pytest.approx(exact, rel=1e-11)
        # at small eta the slope is eta^2/2 left of terms of size 1
        assert found.by_log_eta[0] == pytest.approx(slope, rel=1e-9, abs=1e-12 * abs(exact))


def test_finite_thickness_shifts_modes_as_in_plate_theory_and_finite_elements():
    v = find("PZT-5A").values
    constants = Radial(*(v[key].value.real for key in ("s11E", "s12E", "d31", "eps33T")))
    thin = RadialDisk.of("disk", constants, AREA, THICKNESS, DENSITY)
    alpha = v["c13E"].re / v["c33E"].re
    thick = thin.replace({"disk.alpha": alpha, "disk.d33f": v["e33"].re / v["c33E"].re})
    unit = alpha**2 * (THICKNESS / 10e-3) ** 2

    def resonance(disk, low, high):
        f = np.linspace(low, high, 200001)
        B = (1 / disk.impedance(f)).imag
        return f[np.argmax(np.abs(B))]

    def antiresonance(disk, low, high):
        return brentq(lambda f: (1 / disk.impedance(np.array([f])))[0].imag, low, high)

    for low, high, eta in ((1.8e5, 2.2e5, 2.08), (5.0e5, 5.8e5, 5.40)):
        moved = resonance(thick, low, high) / resonance(thin, low, high) - 1
        assert moved == pytest.approx(-unit * (eta**2 / 6 + 0.25), rel=0.04)
    moved = antiresonance(thick, 2.25e5, 3e5) / antiresonance(thin, 2.25e5, 3e5) - 1
    assert moved == pytest.approx(-0.64 * unit, abs=0.06 * unit)  # finite elements: 0.61 to 0.67


def test_its_formula_is_as_accurate_as_it_says():
    ten = np.array([complex(getattr(TENSOR, name)).real + 0j for name in CONSTANTS])
    c13, c33, e33, density, thickness = *ten[[2, 3, 6]].real, 7700.0, 10e-3 / 25
    thin = RadialDisk.of("disk", Tensor6mm(*ten).radial, AREA, thickness, density)
    model = thin.replace({"disk.alpha": c13 / c33, "disk.d33f": e33 / c33})
    solved = SkfemDisk(5e-3, thickness, 1)
    f = np.linspace(4e5, 9e5, 2001)
    B = (1 / model.impedance(f)).imag
    falls = np.flatnonzero((B[:-1] < 0) & (B[1:] > 0))
    assert falls.size == 2  # the second and third antiresonance
    for k in falls.tolist():
        own = brentq(lambda f: (1 / model.impedance(np.array([f])))[0].imag, f[k], f[k + 1])
        true = brentq(lambda f: solved.capacitance(ten, density, [f])[0].real, 0.99 * own, 1.003 * own, xtol=0.1)
        assert -1.2 < 2 * np.log(true / own) / model.formula_errors(np.array([own]))["disk.s11E"][0] < -0.6


@given(seed=st.integers(0, 10**6), f=st.floats(1e5, 1e7))
def test_the_inertia_of_thickening_does_not_generate_energy(seed, f):
    x = np.random.default_rng(seed).uniform(-1, 1, 8)
    x[4:7] -= 2
    scale = np.array([1e-11, 1e-11, np.sqrt(1e-11 * 1e-8), 1e-8])
    constants = Radial(*(radial_from_coordinates(x)[0] * scale))
    thick = RadialDisk.of("disk", constants, AREA, THICKNESS, DENSITY)
    thick = thick.replace({"disk.alpha": 0.75, "disk.d33f": 1.4e-10})
    assert (1 / thick.impedance(np.array([f]))).real[0] >= 0


def both():
    v = MATERIAL.values
    plate = Piezo("disk", THICKNESS, 7700, v["c33D"].value, v["h33"].value, v["eps33S"].value)
    radial = Radial(*(v[key].value for key in ("s11E", "s12E", "d31", "eps33T")))
    return BothModes.of(Stack((plate,), VACUUM, VACUUM, AREA), "disk", radial), radial


def test_both_modes_share_one_set_of_capacitances():
    disk, radial = both()
    assert disk.radial.eps33T == pytest.approx(radial.eps33T, rel=1e-9)
    C = 1 / (2j * np.pi * 40 * disk.impedance(np.array([40.0]))[0])
    assert pytest.approx(radial.eps33T * AREA / THICKNESS, rel=1e-5) == C


def test_both_modes_together_are_passive():
    disk, _ = both()
    disk = disk.replace({"disk.alpha": 0.66, "disk.d33f": 1.4e-10})
    assert (1 / disk.impedance(np.geomspace(1e3, 3e7, 20001))).real.min() > 0


def test_both_modes_reproduce_each_mode_in_its_band():
    disk, radial = both()
    thin = RadialDisk.of("disk", radial, AREA, THICKNESS, 7700)
    low, high = np.linspace(1e5, 3e5, 401), np.array([20e6, 30e6])
    # the thickness mode contributes (f/fp)^2: 7e-4 of the capacitance at 300 kHz
    assert np.abs(np.log(disk.impedance(low) / thin.impedance(low))).max() < 0.02
    assert np.abs(disk.impedance(high) / disk.stack.impedance(high) - 1).max() < 0.05


def test_causal_laws_keep_the_value_at_the_reference_frequency():
    law = CausalConstantQ(2e5)
    causal = RadialDisk.of("disk", SHERRIT_RADIAL, AREA, THICKNESS, DENSITY)
    causal = RadialDisk(type(causal.arm)(**{**vars(causal.arm), "laws": {"s12E": law, "d31": law}}), causal.eps33T)
    at, off = np.array([2e5]), np.array([2e6])
    assert causal.impedance(at) == pytest.approx(DISK.impedance(at), rel=1e-12)
    # the magnitude of a compliance falls with frequency, whatever its sign: (2/pi) 0.02496 per e-fold
    s12, _ = causal.arm.constants(off)["s12E"]
    assert s12[0] == pytest.approx(SHERRIT_RADIAL.s12E * 10 ** (-2 / np.pi * np.arctan(0.02496)), rel=1e-9)


def test_a_disk_that_cannot_exist_is_refused():
    with pytest.raises(RadialError, match="thickness is -1; a positive number"):
        RadialDisk.of("disk", SHERRIT_RADIAL, AREA, -1.0, DENSITY)
    with pytest.raises(RadialError, match="s11E must be positive and larger"):
        RadialDisk.of("disk", Radial(1e-12, -2e-12, -1e-10, 1e-8), AREA, THICKNESS, DENSITY)


def test_a_real_disk_is_described_to_one_percent(recordings):
    # 35 mm x 2 mm; constants of a thin-disk fit, no fit here
    tables = [np.loadtxt(recordings / "disk-35x2" / f"radial-mode-{k}.csv", delimiter=",", skiprows=1) for k in (1, 2)]
    f, size, degrees = np.concatenate(tables).T
    v = find("Li 2021 disk").values
    constants = Radial(*(v[key].value for key in ("s11E", "s12E", "d31", "eps33T")))
    disk = RadialDisk.of("disk", constants, np.pi * 17.5e-3**2, 2e-3, v["density"].re)
    error = np.log(disk.impedance(f) / (size * np.exp(1j * np.deg2rad(degrees))))
    assert np.sqrt(np.mean(np.abs(error) ** 2)) < 0.03
