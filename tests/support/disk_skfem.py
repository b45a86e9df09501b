"""A free disk by a general finite-element package, scikit-fem: the reference for `models/disk2d`.

It uses nothing of the project's own discretisation: triangles of order four, integrals over the
section by quadrature in r and z, metres and volts scaled once, one sparse factorisation for each frequency.
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP4, MeshTri

INTEGRANDS = (
    lambda u, v, w: u.grad[0] * v.grad[0] * w.x[0] + u * v / w.x[0],  # radial and hoop strain of u_r
    lambda u, v, w: u.grad[0] * v + u * v.grad[0],  # product of both
    lambda u, v, w: u.grad[0] * v.grad[0] * w.x[0],  # slopes along r
    lambda u, v, w: u.grad[1] * v.grad[1] * w.x[0],  # slopes along z
    lambda u, v, w: u.grad[1] * (v.grad[0] * w.x[0] + v),  # slope along z of a field, divergence in the plane of u_r
    lambda u, v, w: u.grad[0] * v.grad[1] * w.x[0],  # slope along r of a field, along z of u_r
    lambda u, v, w: u * v * w.x[0],  # mass
)
VOLT = 1e9  # potential in GV, stiffness and piezoelectric constants then have the same size


def forms_of(basis):
    """Return the matrices of the weak form, 2 pi left out: entries by constant, and the mass; fields u_r, u_z, phi."""
    rr, cross, dr, dz, sz, zr, m = (BilinearForm(of).assemble(basis) for of in INTEGRANDS)

    zero = sp.csr_matrix(m.shape)

    def blocks(entries):
        whole = [[zero] * 3 for _ in range(3)]
        for (i, k), block in entries.items():
            whole[i][k] = block
            if i != k:
                whole[k][i] = block.T
        return sp.csr_matrix(sp.bmat(whole))

    return (
        blocks({(0, 0): rr}),
        blocks({(0, 0): cross}),
        blocks({(0, 1): sz}),
        blocks({(1, 1): dz}),
        blocks({(0, 0): dz, (0, 1): zr, (1, 1): dr}),
        blocks({(0, 2): sz}),
        blocks({(1, 2): dz}),
        blocks({(0, 2): zr, (1, 2): dr}),
        blocks({(2, 2): -dr}),
        blocks({(2, 2): -dz}),
        blocks({(0, 0): m, (1, 1): m}),
    )


class SkfemDisk:
    """Quarter section 0 < r < radius, 0 < z < thickness/2, electrode on top, half a volt on it.

    `per_half`: triangles' edge through half the thickness.
    """

    def __init__(self, radius, thickness, per_half=2):
        b = thickness / 2
        along_r = np.linspace(0, radius, int(np.ceil(radius / b * per_half)) + 1)
        mesh = MeshTri.init_tensor(along_r, np.linspace(0, b, per_half + 1))
        self.basis = Basis(mesh, ElementTriP4(), intorder=9)
        self.radius, self.thickness = radius, thickness
        x = self.basis.doflocs
        n, tiny = self.basis.N, 1e-9 * radius
        axis, middle, top = x[0] < tiny, x[1] < tiny, x[1] > b - tiny
        every = np.arange(n)
        self.free = np.concatenate([every[~axis], n + every[~middle], 2 * n + every[~middle & ~top]])
        self.driven = 2 * n + every[top]

    @cached_property
    def forms(self):
        """Matrices of the weak form, 2 pi left out: three fields u_r, u_z, phi, entries by constant, and the mass."""
        return forms_of(self.basis)

    def capacitance(self, constants, density, frequency):
        """Return Y/(jw) in F, shape (N,); constants in SI in the usual order, shape (10,) or (N, 10)."""
        units = np.array([1.0] * 5 + [VOLT] * 3 + [VOLT**2] * 2)
        made = []
        for f, c in zip(frequency, np.broadcast_to(constants, (len(frequency), 10)), strict=True):
            weights = [*(c * units), -density * (2 * np.pi * f) ** 2]
            A = sum(w * form for w, form in zip(weights, self.forms, strict=True)).tocsr()
            x = np.zeros(A.shape[0], complex)
            x[self.driven] = 0.5 / VOLT
            right = -(A @ x)[self.free]
            x[self.free] = splu(A[self.free][:, self.free].tocsc()).solve(right)
            made.append(-4 * np.pi * (x @ (A @ x)))
        return np.array(made)
