"""A disk of finite diameter: both dimensions, by Ritz's method on polynomials, and all its modes up to some frequency.

All faces are free of stress; electrodes cover both flat faces. By symmetry u_r is even and u_z odd over the thickness;
the potential is linear in z plus odd functions that vanish at the electrodes.
W. Ritz, J. reine angew. Math. 135 (1909) 1; H. F. Tiersten, Linear Piezoelectric Plate Vibrations (1969), ch. 5-6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eig, eigh
from scipy.special import eval_jacobi

from .device_under_test import DENSITY, DeviceUnderTest
from .waves import Complexes, Reals

_EPS0 = 8.8541878128e-12
_THROUGH = 5
"""Polynomials of each parity through the thickness; enough to twice the first resonance."""
_RADIAL_PER_ASPECT = 3.5
"""Polynomials in r^2 along the radius, for each thickness in the diameter."""


@dataclass(frozen=True, eq=False)
class _Line:
    """Functions, their derivatives, and quadrature points and weights of one dimension."""

    values: Reals
    slopes: Reals


def finite_disk_admittance(f: Reals, device: DeviceUnderTest) -> Complexes:
    """Return the admittance of the bare disk in S, shape (N,); good up to 1.7 times its first thickness resonance."""
    K, M, drive, static = _matrices(device)
    top = (2 * np.pi * 1.6 * float(np.max(f))) ** 2
    modes = np.asarray(eigh(K.real, M, subset_by_value=(-np.inf, top))[1], np.float64)
    rest = np.linalg.solve(K.real, drive.real)
    basis = np.column_stack([modes, rest - modes @ (modes.T @ (M @ rest))])
    basis /= np.sqrt(np.sum(basis * (M @ basis), axis=0))
    squares, vectors = eig(basis.T @ K @ basis, basis.T @ M @ basis)
    mass = basis.T @ M @ basis
    weights = (vectors.T @ (basis.T @ drive)) ** 2 / np.sum(vectors * (mass @ vectors), axis=0)
    omega = 2 * np.pi * f
    motional = (weights / (squares - omega[:, None] ** 2)).sum(axis=1)
    return np.asarray(1j * omega * (static + motional), np.complex128)


def _matrices(device: DeviceUnderTest) -> tuple[Complexes, Reals, Complexes, complex]:
    """Return stiffness (inner potential eliminated), mass, the voltage's force, and the clamped capacitance."""
    a, t = device.diameter / 2, device.disk.thickness
    c11, c12, c13, c33, c44, e31, e33, e15, eps11, eps33 = _tensor(device)
    count = int(_RADIAL_PER_ASPECT * device.diameter / t) + 8
    r, w = _quadrature(count, a)
    across, along, potential = _radial(count, r, a)
    even, odd, bubble, v = _through(t)

    def R(x: Reals, y: Reals) -> Reals:
        return 2 * np.pi * (x.T * w) @ y

    def Z(x: Reals, y: Reals) -> Reals:
        return (x.T * v) @ y

    hoop = across.values / r[:, None]
    div = across.slopes + hoop
    rr = c11 * np.kron(R(across.slopes, across.slopes) + R(hoop, hoop), Z(even.values, even.values))
    rr = rr + c12 * np.kron(R(across.slopes, hoop) + R(hoop, across.slopes), Z(even.values, even.values))
    rr = rr + c44 * np.kron(R(across.values, across.values), Z(even.slopes, even.slopes))
    zz = c33 * np.kron(R(along.values, along.values), Z(odd.slopes, odd.slopes))
    zz = zz + c44 * np.kron(R(along.slopes, along.slopes), Z(odd.values, odd.values))
    rz = c13 * np.kron(R(div, along.values), Z(even.values, odd.slopes))
    rz = rz + c44 * np.kron(R(across.values, along.slopes), Z(even.slopes, odd.values))
    rp = e31 * np.kron(R(div, potential.values), Z(even.values, bubble.slopes))
    rp = rp + e15 * np.kron(R(across.values, potential.slopes), Z(even.slopes, bubble.values))
    zp = e33 * np.kron(R(along.values, potential.values), Z(odd.slopes, bubble.slopes))
    zp = zp + e15 * np.kron(R(along.slopes, potential.slopes), Z(odd.values, bubble.values))
    pp = eps11 * np.kron(R(potential.slopes, potential.slopes), Z(bubble.values, bubble.values))
    pp = pp + eps33 * np.kron(R(potential.values, potential.values), Z(bubble.slopes, bubble.slopes))
    up = np.vstack([rp, zp])
    K = np.block([[rr, rz], [rz.T, zz]]) + up @ np.linalg.solve(pp, up.T)
    one, flat = np.ones((r.size, 1)), np.ones((v.size, 1)) / t
    pull_r = e31 * np.kron(R(div, one), Z(even.values, flat))
    pull_z = e33 * np.kron(R(along.values, one), Z(odd.slopes, flat))
    mass_r = DENSITY * np.kron(R(across.values, across.values), Z(even.values, even.values))
    mass_z = DENSITY * np.kron(R(along.values, along.values), Z(odd.values, odd.values))
    M = np.block([[mass_r, np.zeros((len(mass_r), len(mass_z)))], [np.zeros((len(mass_z), len(mass_r))), mass_z]])
    return K, M, np.vstack([pull_r, pull_z])[:, 0], complex(eps33 * device.area / t)


def _tensor(device: DeviceUnderTest) -> tuple[complex, ...]:
    """Return c11E c12E c13E c33E c44E e31 e33 e15 eps11S eps33S."""
    disk = device.disk
    c11, c12, c13, c44, e31, e15, eps11 = device.lateral
    loss = 1 + 1j * disk.c33D.imag / disk.c33D.real
    lossy = 1 + 1j * disk.eps33S.imag / disk.eps33S.real
    c33E = disk.c33D - disk.h33**2 * disk.eps33S
    return (
        *(c11 * loss, c12 * loss, c13 * loss, c33E, c44 * loss),
        *(e31, disk.h33 * disk.eps33S, e15, eps11 * _EPS0 * lossy, disk.eps33S),
    )


def _quadrature(count: int, a: float) -> tuple[Reals, Reals]:
    x, w = legendre.leggauss(2 * count + 6)
    r = a * (x + 1) / 2
    return r, w * a / 2 * r


def _radial(count: int, r: Reals, a: float) -> tuple[_Line, _Line, _Line]:
    """Return u_r (odd in r, zero on the axis), u_z and the potential (even in r) along the radius."""
    y, n = 2 * (r / a) ** 2 - 1, np.arange(count)
    dy = 4 * r[:, None] / a**2
    p0 = np.asarray(eval_jacobi(n, 0, 0, y[:, None]), np.float64)
    d0 = np.asarray((n + 1) / 2 * eval_jacobi(n - 1, 1, 1, y[:, None]), np.float64) * (n > 0)
    p1 = np.asarray(eval_jacobi(n, 0, 1, y[:, None]), np.float64)
    d1 = np.asarray((n + 2) / 2 * eval_jacobi(n - 1, 1, 2, y[:, None]), np.float64) * (n > 0)
    scale = np.sqrt(2 * n + 1.0)
    even = _Line(p0 * scale, d0 * dy * scale)
    odd = _Line(p1 * scale * r[:, None] / a, (p1 / a + d1 * dy * r[:, None] / a) * scale)
    return odd, even, even


def _through(t: float) -> tuple[_Line, _Line, _Line, Reals]:
    """Return even and odd functions through the thickness, odd ones that vanish at the faces, and weights."""
    x, w = legendre.leggauss(3 * _THROUGH)
    unit = np.eye(2 * _THROUGH + 2)
    values = np.asarray(legendre.legval(x, unit.T), np.float64).T
    slopes = np.stack([np.asarray(legendre.legval(x, legendre.legder(row)), np.float64) for row in unit], axis=1)
    slopes = slopes * 2 / t
    even, odd = np.arange(0, 2 * _THROUGH, 2), np.arange(1, 2 * _THROUGH, 2)
    bubble = _Line(values[:, odd + 2] - values[:, odd], slopes[:, odd + 2] - slopes[:, odd])
    return _Line(values[:, even], slopes[:, even]), _Line(values[:, odd], slopes[:, odd]), bubble, w * t / 2
