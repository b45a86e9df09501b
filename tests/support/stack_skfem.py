"""A glued stack of finite diameter by a general finite-element package, scikit-fem: the reference for `models/stack2d`.

It uses nothing of the project's own discretisation: triangles of order four over the whole section in r and z, finer
towards the rim and the layers' faces, one sparse factorisation for each frequency.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from disk_skfem import VOLT, forms_of
from scipy.sparse.linalg import splu
from skfem import Basis, ElementTriP4, MeshTri

NEAR = (0.3, 0.08)
"""Ends of triangles beside the rim, over the thickness of the ceramic."""
TIP = (-0.3, -0.08, -0.02, 0.0, 0.02, 0.08, 0.3)
"""The same on both sides of the edge of an opening."""


@dataclass(frozen=True)
class FeLayer:
    """A layer from back to front, SI: the ten constants in the usual order for a ceramic, two of Lame for another."""

    thickness: float
    density: float
    constants: tuple[complex, ...]
    cells: int = 1

    @property
    def piezo(self):
        return len(self.constants) == 10

    @property
    def ten(self):
        if self.piezo:
            return np.array(self.constants)
        first, second = self.constants
        return np.array([first + 2 * second, first, first, first + 2 * second, second, 0, 0, 0, 0, 0])

    @classmethod
    def isotropic(cls, thickness, z, c, q, poisson, cells=1):
        c33 = z * c * (1 + 1j / q)
        second = c33 * (1 - 2 * poisson) / (2 - 2 * poisson)
        return cls(thickness, z / c, (c33 - 2 * second, second), cells)


class SkfemStack:
    """A stack of round layers; one of them is the ceramic, with electrodes on both faces.

    `opening`: index of a layer that is missing within a radius, and that radius in m. `ends`: radii in m of layers
    that end before the rim, by index; `electrode`: radius of both electrodes in m; `hole`: radius of a hole through
    all layers in m.
    """

    def __init__(self, radius, layers, per_thickness=2, opening=None, ends=None, electrode=None, hole=0.0):
        self.layers = layers
        (piezo,) = (layer for layer in layers if layer.piezo)
        faces = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
        heights = [
            np.linspace(low, high, one.cells + 1)[:-1] for (low, high), one in zip(pairwise(faces), layers, strict=True)
        ]
        z = np.append(np.concatenate(heights), faces[-1])
        cells = max(2, int(np.ceil((radius - hole) / piezo.thickness * per_thickness)))
        r, cell = np.linspace(hole, radius, cells + 1), piezo.thickness / per_thickness
        beside = [radius - part * cell for part in NEAR] + ([hole + part * cell for part in NEAR] if hole else [])
        r = np.sort(np.append(r, beside))
        ends = ends or {}
        on_faces = {*ends.values(), *([electrode] if electrode else [])}
        if on_faces:  # finer beside every face
            step = np.diff(z)
            finer = [place for part in NEAR for place in (z[:-1] + part * step, z[1:] - part * step)]
            z = np.sort(np.concatenate([z, *finer]))
        for edge in {*on_faces, *([opening[1]] if opening else [])}:
            r = np.sort(np.append(r[np.abs(r - edge) > 0.4 * cell], edge + cell * np.array(TIP)))
        mesh = MeshTri.init_tensor(r, z)
        if opening is not None:
            along, height = mesh.p[:, mesh.t].mean(axis=1)
            layer, edge = opening
            within = (along < edge) & (height > faces[layer]) & (height < faces[layer + 1])
            mesh = mesh.restrict(np.flatnonzero(~within))
        for layer, edge in ends.items():
            along, height = mesh.p[:, mesh.t].mean(axis=1)
            beyond = (along > edge) & (height > faces[layer]) & (height < faces[layer + 1])
            mesh = mesh.restrict(np.flatnonzero(~beyond))
        middle = mesh.p[1, mesh.t].mean(axis=0)
        self.within = [np.flatnonzero((middle > low) & (middle < high)) for low, high in pairwise(faces)]
        self.mesh, self.element = mesh, ElementTriP4()
        basis = Basis(mesh, self.element, intorder=9)
        self.x, self.n = basis.doflocs, basis.N
        k = layers.index(piezo)
        tiny = 1e-9 * faces[-1]
        r, height = self.x
        active = (height > faces[k] + tiny) & (height < faces[k + 1] - tiny)
        if electrode is not None:
            at_face = (height > faces[k] - tiny) & (height < faces[k + 1] + tiny)
            active |= at_face & (r > electrode * (1 + 1e-9))
        every = np.arange(self.n)
        self.free = np.concatenate([every[r > 1e-9 * radius], self.n + every, 2 * self.n + every[active]])
        driven = np.abs(height - faces[k + 1]) < tiny
        self.driven = 2 * self.n + every[driven & ~active]

    @cached_property
    def forms(self):
        """Matrices of the weak form by layer and constant, 2 pi left out, and the mass of each layer."""
        bases = (Basis(self.mesh, self.element, elements=within, intorder=9) for within in self.within)
        return [forms_of(basis) for basis in bases]

    @cached_property
    def whole(self):
        """The stiffness with its constants, and the mass with its densities."""
        units = np.array([1.0] * 5 + [VOLT] * 3 + [VOLT**2] * 2)
        pairs = list(zip(self.layers, self.forms, strict=True))
        still = sum(
            w * form for layer, forms in pairs for w, form in zip(layer.ten * units, forms[:-1], strict=True) if w
        )
        return still.tocsr(), sum(layer.density * forms[-1] for layer, forms in pairs).tocsr()

    def capacitance(self, frequency):
        """Return Y/(jw) in F, shape (N,), at frequencies in Hz."""
        still, mass = self.whole
        made = []
        for f in frequency:
            A = (still - (2 * np.pi * f) ** 2 * mass).tocsr()
            made.append(self.driven_by_a_volt(A))
        return np.array(made)

    def driven_by_a_volt(self, A):
        """Return Y/(jw) in F with the matrix of one frequency."""
        x = np.zeros(A.shape[0], complex)
        x[self.driven] = 1 / VOLT
        right = -(A @ x)[self.free]
        x[self.free] = splu(A[self.free][:, self.free].tocsc()).solve(right)
        return -2 * np.pi * (x @ (A @ x))

    def impedance(self, frequency):
        """Return Z in ohm, shape (N,)."""
        return 1 / (2j * np.pi * frequency * self.capacitance(frequency))
