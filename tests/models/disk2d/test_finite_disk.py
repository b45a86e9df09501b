"""Radial modes of a disk of finite thickness compared with a direct solution in both dimensions.

Ritz's method for the free, electroded disk of class 6mm: displacements and potential as Legendre polynomials of r^2
and z, the energies integrated by Gauss's rule. It shares no equation with the radial model.
"""

import numpy as np
import pytest
from complex_ceramic import MATERIAL
from numpy.polynomial import legendre

from pzctl.models.constants.piezo_constants import Radial
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk.round_disk import BothModes, RadialDisk
from pzctl.models.stack import VACUUM, Piezo, Stack

RADIUS, DENSITY = 5e-3, 7700.0
AREA = np.pi * RADIUS**2
VALUES = MATERIAL.values
TENSOR = Tensor6mm(*(VALUES[name].value for name in Tensor6mm.__dataclass_fields__))


def polynomials(count, at):
    slopes = np.stack([legendre.legval(at, legendre.legder(row)) for row in np.eye(count + 1)], 1)
    return legendre.legvander(at, count), slopes


def ritz(thickness, frequency, nr=14, nz=5):
    """Y in siemens of the whole disk; `nr`, `nz`: degrees in r^2 and z."""
    a, b = RADIUS, thickness / 2
    node, weight = legendre.leggauss(nr + 6)
    x, z_weight = (node + 1) / 2, legendre.leggauss(nz + 4)
    z = z_weight[0]
    w = np.outer(weight / 2 * x, z_weight[1]).ravel() * 2 * np.pi * a**2 * b
    P, dP = polynomials(nr, 2 * x**2 - 1)
    dP = dP * (4 * x)[:, None]
    Q, dQ = polynomials(nz, z)
    even, odd = slice(0, None, 2), slice(1, None, 2)
    xc = x[:, None]

    def grid(R, Z):
        return np.einsum("ri,zj->rzij", R, Z).reshape(len(w), -1)

    def both(u, v):
        return np.hstack([u, v])

    U, W = grid(xc * P, Q[:, even]), grid(P, Q[:, odd])
    none_u, none_w = np.zeros_like(U), np.zeros_like(W)
    strains = (
        both(grid(P + xc * dP, Q[:, even]) / a, none_w),
        both(grid(P, Q[:, even]) / a, none_w),
        both(none_u, grid(P, dQ[:, odd]) / b),
        both(grid(xc * P, dQ[:, even]) / b, grid(dP, Q[:, odd]) / a),
    )
    lid = (1 - z**2)[:, None]  # the inner potential, which vanishes on the electrodes
    fields = (
        grid(dP, lid * Q[:, odd]) / a,
        grid(P, lid * dQ[:, odd] - 2 * z[:, None] * Q[:, odd]) / b,
    )
    voigt = [0, 1, 2, 4]
    c, e, eps = TENSOR.cE[np.ix_(voigt, voigt)], TENSOR.e[np.ix_([0, 2], voigt)], np.diag(TENSOR.epsS)[[0, 2]]
    pairs = [(i, j) for i in range(4) for j in range(4)]
    K = sum(c[i, j] * (strains[i].T * w) @ strains[j] for i, j in pairs)
    M = DENSITY * sum((u.T * w) @ u for u in (both(U, none_w), both(none_u, W)))
    coupling = sum(e[k, i] * (strains[i].T * w) @ fields[k] for k in range(2) for i in range(4))
    inner = -sum(eps[k] * (fields[k].T * w) @ fields[k] for k in range(2))
    volt = np.full(len(w), 1 / thickness)  # field at one volt
    force = sum(e[1, i] * (strains[i].T * w) @ volt for i in range(4))
    charge = -eps[1] * (fields[1].T * w) @ volt
    K = K - coupling @ np.linalg.solve(inner, coupling.T)
    driven = force - coupling @ np.linalg.solve(inner, charge)
    still = -eps[1] * (volt * w) @ volt - charge @ np.linalg.solve(inner, charge)
    omega = 2 * np.pi * np.asarray(frequency)
    return np.array([-1j * s * (still - driven @ np.linalg.solve(K - s**2 * M, driven)) for s in omega])


def models(thickness):
    """The radial disk and the disk with both modes: thin, and with the inertia of thickening."""
    radial = TENSOR.radial
    thin = RadialDisk.of("disk", radial, AREA, thickness, DENSITY)
    plate = TENSOR.thickness
    layer = Piezo("disk", thickness, DENSITY, plate.c33D, plate.h33, plate.eps33S)
    both = BothModes.of(Stack((layer,), VACUUM, VACUUM, AREA), "disk", radial)
    massive = {"disk.alpha": (TENSOR.c13E / TENSOR.c33E).real, "disk.d33f": plate.d33.real}
    return {"thin": thin, "radial": thin.replace(massive), "both thin": both, "both": both.replace(massive)}


def misfits(thickness, frequency, nr=14, nz=5):
    Y = ritz(thickness, frequency, nr, nz)
    return {
        name: float(np.sqrt(np.mean(np.abs(np.log(model.impedance(frequency) * Y)) ** 2)))
        for name, model in models(thickness).items()
    }


# The first three radial modes; the remaining error falls with the fourth power of thickness over diameter.
@pytest.mark.parametrize(("ratio", "most"), [(20, 0.006), (40, 0.0006)])
def test_the_inertia_of_thickening_explains_finite_thickness(ratio, most):
    misfit = misfits(2 * RADIUS / ratio, np.linspace(1e5, 8e5, 71))
    assert misfit["radial"] < most
    assert misfit["both"] < most
    assert misfit["thin"] > 20 * misfit["radial"]


def test_above_the_thickness_mode_the_disk_is_a_plate():
    fp = TENSOR.thickness.speed(DENSITY).real / (2 * 0.5e-3)
    assert misfits(0.5e-3, np.linspace(1.3 * fp, 1.8 * fp, 4), nr=48, nz=7)["both"] < 0.004


def test_far_below_resonance_the_whole_disk_has_the_free_permittivity():
    Y = ritz(0.25e-3, [1e3])
    assert Y[0] / (2j * np.pi * 1e3) == pytest.approx(TENSOR.radial.eps33T * AREA / 0.25e-3, rel=1e-4)


def test_resonances_fall_by_the_second_order_formula():
    lossless = Radial(*(value.real for value in vars(TENSOR.radial).values()))
    thin = RadialDisk.of("disk", lossless, AREA, 0.1e-3, DENSITY)
    thick = thin.replace({"disk.alpha": 0.7})
    sigma, share = lossless.sigma_p, 0.49 * (0.1e-3 / 10e-3) ** 2

    def resonance(disk, near):
        f = near * (1 + np.linspace(-2e-3, 2e-3, 40001))
        return f[np.argmax(np.abs(1 / disk.impedance(f)))]

    for eta in (2.0876, 5.4012, 8.5788):
        near = eta / (2 * np.pi * RADIUS) * np.sqrt(lossless.c11p / DENSITY)
        fall = share * (eta**2 / 6 + (1 - sigma) / 3 * eta**2 / (eta**2 - 1 + sigma**2))
        there = resonance(thin, near)
        assert resonance(thick, there) / there - 1 == pytest.approx(-fall, rel=5e-3)
