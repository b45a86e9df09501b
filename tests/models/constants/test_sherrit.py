import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0, j1

from pzctl.models.constants import sherrit
from pzctl.models.constants.piezo_constants import Thickness
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL
from pzctl.models.stack import VACUUM, Piezo, Stack

AREA, DENSITY = np.pi * 5e-3**2, 7800.0


@pytest.mark.parametrize("sigma", np.linspace(0.2, 0.5, 13))
def test_the_polynomials_follow_the_roots(sigma):
    eta1, eta2 = (brentq(lambda eta: eta * j0(eta) - (1 - sigma) * j1(eta), *bracket) for bracket in ((1, 3), (4.5, 6)))
    constants = sherrit.radial_constants(eta1, eta2, 1.1 * eta1, 1e-8, 1 / (2 * np.pi), 1.0)
    assert constants.sigma_p.real == pytest.approx(sigma, abs=1.2e-4)
    assert constants.c11p.real == pytest.approx(1, abs=1.5e-4)


def test_radial_constants_are_recovered_from_their_spectrum():
    disk = RadialDisk.of("disk", SHERRIT_RADIAL, AREA, 0.5e-3, DENSITY)
    first, second = np.arange(130e3, 300e3, 2.0), np.arange(430e3, 580e3, 2.0)
    Z = disk.impedance(first)
    low = np.array([1e3])
    found = sherrit.radial_constants(
        sherrit.resonance_frequencies(first, Z).complex,
        sherrit.resonance_frequencies(second, disk.impedance(second)).complex,
        sherrit.antiresonance_frequencies(first, Z).complex,
        0.5e-3 / (2j * np.pi * low[0] * AREA * disk.impedance(low)[0]),
        5e-3,
        DENSITY,
    )
    for name in ("s11E", "s12E", "d31", "eps33T", "c11p", "kp", "kp_IEEE", "eps33p"):
        there, truth = getattr(found, name), getattr(SHERRIT_RADIAL, name)
        assert there.real == pytest.approx(truth.real, rel=1e-3), name
        assert there.imag == pytest.approx(truth.imag, rel=5e-3), name
    assert found.sigma_p.imag == pytest.approx(SHERRIT_RADIAL.sigma_p.imag, rel=0.02)


# Accuracy of the closed form itself grows with Q as the reference states.
@pytest.mark.parametrize(("Q", "of_c", "of_kt2"), [(80, 2e-4, 2e-3), (20, 3e-3, 2.5e-2)])
def test_thickness_constants_are_recovered_from_their_spectrum(Q, of_c, of_kt2):
    truth = Thickness(1.5e11 * (1 + 1j / Q), 1.98e9, 8.1e-9 * (1 - 0.012j))
    layer = Piezo("disk", 0.5e-3, DENSITY, truth.c33D, truth.h33, truth.eps33S)
    plate = Stack((layer,), VACUUM, VACUUM, AREA)
    f = np.arange(3e6, 6e6, 100.0)
    Z = plate.impedance(f)
    fs, fp = sherrit.resonance_frequencies(f, Z), sherrit.antiresonance_frequencies(f, Z)
    assert fs.plus < fs.top < fs.minus  # for exp(+jwt) the maximum of B/w is the lower one
    assert fp.plus < fp.top < fp.minus
    above = np.array([12e6])
    found = sherrit.thickness_constants(
        fs.complex, fp.complex, 0.5e-3, DENSITY, (12e6, plate.impedance(above)[0]), AREA
    )
    assert found.c33D.real == pytest.approx(truth.c33D.real, rel=of_c)
    assert found.Qm == pytest.approx(Q, rel=0.01)
    assert (found.kt**2).real == pytest.approx((truth.kt**2).real, rel=of_kt2)
    assert found.eps33S.real == pytest.approx(truth.eps33S.real, rel=of_kt2)
    # the thesis's (2.18), without fs/fp
    assert ((found.kt**2) * fp.complex / fs.complex).real > 1.09 * (truth.kt**2).real
