"""What lies on the faces of a disk and under them: a coat, and ceramic without polarisation.

A dead layer is a thin layer of the ceramic's mass, isotropic with the Poisson's ratio of its grains in all directions,
and a capacitance in series with the live ceramic at every point: of one volt, J = s q is across it, with the charge q
that the electrode would have without it, and H grows by s q^2/2 over the face. The charge is known from the weak form
(`Matrices.charges`), over functions that vary along the electrode with wavenumbers k. What J itself adds to the charge
is that of the live ceramic at rest, of thickness 2b: per area
    even in z  N = eps33S/b X coth X,    odd  N' = eps33S/b X tanh X,    X = k b sqrt(eps11S/eps33S),
so that s = d/(eps + N D/2 + N' (d - D/2)) for a depth d, D of both faces together.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..base.face_loads import Coat, DeadLayer
from ..constants.unpoled import unpoled_ratio
from .coat import FORMS, FaceWeights, ThinLayer
from .full import Shape
from .matrices import CONSTANTS

_EPS33S = CONSTANTS.index("eps33S")
_THINNING = 0.5
# Strain across dead ceramic for one along it: that of a Poisson's ratio of a third. It only counts in second order.
_FLAT = 1e-4
# Of the wavenumber times the radius: where less, coth X is 1/X.
_STEP = 1e-4
# Relative step of derivatives of the weights, rational functions; their error is its square.


@dataclass(frozen=True, eq=False)
class FaceMotion:
    """Motion of front and back for one volt."""

    forms: Complexes
    """`face_forms`, shape (2, N, 11)."""
    charges: Complexes
    """Squared charge on each function along the electrode, shape (2, N, K)."""
    waves: Reals
    """Of these functions, shape (K,)."""


@dataclass(frozen=True)
class Faces:
    """Loads of both faces."""

    coat: Coat | None = None
    dead: DeadLayer | None = None

    def __bool__(self) -> bool:
        return self.coat is not None or self.dead is not None

    @property
    def alike(self) -> bool:
        """Whether both faces have the same loads."""
        return (self.coat is None or self.coat.back == 1) and (self.dead is None or self.dead.back == self.dead.front)

    def with_load(self, load: Coat | DeadLayer) -> Self:
        """Return the faces with this load beside one of the other kind."""
        return replace(self, coat=load) if isinstance(load, Coat) else replace(self, dead=load)

    def live(self, shape: Shape) -> Shape:
        """Return the sizes of the live ceramic of a disk."""
        if self.dead is None:
            return shape
        return replace(shape, thickness=shape.thickness - self.dead.front - self.dead.back)

    def weights(self, shape: Shape, constants: Complexes, waves: Reals) -> tuple[FaceWeights, FaceWeights]:
        """Return what is on and under the front and the back; constants at each frequency, shape (N, 10).

        `waves`: of functions along the electrode (`ReducedDisk.waves`), shape (K,).
        """
        series = self._series(shape, constants, waves)
        front, back = (
            FaceWeights(
                sum((one.inertia(shape.radius) for one in layers), np.zeros(FORMS)),
                sum((one.stiffness(shape.radius) for one in layers), np.zeros((len(constants), FORMS), np.complex128)),
                own,
            )
            for layers, own in zip(self._layers(shape, constants), series, strict=True)
        )
        return front, back

    def _layers(self, shape: Shape, constants: Complexes) -> list[list[ThinLayer]]:
        """Return the thin layers of front and back."""
        made: list[list[ThinLayer]] = [[], []]
        if self.coat is not None:
            for layers, share in zip(made, (1.0, self.coat.back), strict=True):
                layers.append(ThinLayer.of(self.coat, share, len(constants)))
        if self.dead is not None:
            c33E, e33, eps33S = (constants[:, CONSTANTS.index(name)] for name in ("c33E", "e33", "eps33S"))
            c11 = self.dead.stiffness * (c33E + e33**2 / eps33S)
            ratio = unpoled_ratio(constants)
            along, across = c11 * (1 - ratio**2), c11 * ratio * (1 - ratio)
            for layers, depth in zip(made, (self.dead.front, self.dead.back), strict=True):
                layers.append(ThinLayer(shape.density * depth, depth, depth * along, depth * across, _THINNING))
        return made

    def _series(self, shape: Shape, constants: Complexes, waves: Reals) -> list[Complexes]:
        """Return s over the squared radius of front and back, 1/F, shape (N, K); K is 0 without a dead layer."""
        if self.dead is None:
            return [np.zeros((len(constants), 0), np.complex128)] * 2
        even, odd = _stiffening(constants, self.live(shape), waves)
        mean = (self.dead.front + self.dead.back) / 2
        eps = self.dead.permittivity * constants[:, [_EPS33S]] + even * mean
        return [
            depth / (shape.radius**2 * (eps + odd * (depth - mean) if depth != mean else eps))
            for depth in (self.dead.front, self.dead.back)
        ]

    def neglected(self, shape: Shape, constants: Complexes, frequency: Frequencies) -> Reals:
        """Return what thin layers neglect, as a relative error of the disk's stiffness, shape (N,).

        A layer h thick is impedance tan(k h)/(k h) = 1 + (k h)^2/3 times its mass, with k of shear waves in it.
        """
        made = np.zeros(frequency.size)
        for layers in self._layers(shape, constants):
            for one in (one for one in layers if one.thickness > 0):
                # of an isotropic solid: K11 - K12 is twice the shear modulus times h
                speed = np.sqrt(np.abs(one.along - one.across) / 2 / one.mass)
                share = one.mass / (shape.density * shape.thickness)
                made += share * (2 * np.pi * frequency * one.thickness / speed) ** 2 / 3
        return made

    def form(self, shape: Shape, constants: Complexes, frequency: Frequencies, motion: FaceMotion) -> Complexes:
        """Return twice what they add to H of half the disk for one volt, J, shape (N,); constants at each frequency."""
        return self._of_layers(shape, constants, frequency, motion) + self._of_charges(shape, constants, motion)

    def _of_layers(self, shape: Shape, constants: Complexes, frequency: Frequencies, motion: FaceMotion) -> Complexes:
        made, squared = np.zeros(frequency.size, np.complex128), (2 * np.pi * frequency) ** 2
        for layers, forms in zip(self._layers(shape, constants), motion.forms, strict=True):
            for one in layers:
                made += np.einsum("nk,nk->n", one.stiffness(shape.radius), forms) / 2
                made -= squared * (forms @ one.inertia(shape.radius)) / 2
        return made

    def _of_charges(self, shape: Shape, constants: Complexes, motion: FaceMotion) -> Complexes:
        if self.dead is None:
            return np.zeros(len(constants), np.complex128)
        series = self._series(shape, constants, motion.waves)
        both = (np.einsum("nk,nk->n", own, squares) for own, squares in zip(series, motion.charges, strict=True))
        return np.asarray(sum(both) / 2, np.complex128)

    def form_slopes(
        self, shape: Shape, constants: Complexes, frequency: Frequencies, motion: FaceMotion
    ) -> tuple[Complexes, Complexes]:
        """Return the derivatives of `form` by each constant, shape (N, 10), and by the logarithm of each size.

        The latter of shape (N, 3): of radius, thickness and density. The motion is held: H is stationary in it.
        """

        def slope(of: Callable[[float], Complexes]) -> Complexes:
            return (of(1 + _STEP) - of(1 - _STEP)) / (2 * _STEP)

        def scaled(k: int, factor: float) -> Complexes:
            return constants * np.where(np.arange(len(CONSTANTS)) == k, factor, 1.0)

        by_constant = np.zeros(constants.shape, np.complex128)
        if self.dead is not None:
            for k, name in enumerate(CONSTANTS):
                own = slope(lambda s, k=k: self._of_layers(shape, scaled(k, s), frequency, motion))
                if name.startswith("eps"):
                    own = own + slope(lambda s, k=k: self._of_charges(shape, scaled(k, s), motion))
                by_constant[:, k] = own / constants[:, k]
        by_size = [
            slope(lambda s, name=name: self.form(shape.scaled(name, s), constants, frequency, motion))
            for name in ("radius", "thickness", "density")
        ]
        return by_constant, np.array(by_size).T


def _stiffening(constants: Complexes, live: Shape, waves: Reals) -> tuple[Complexes, Complexes]:
    """Return N and N' at each frequency of each function along the electrode, F/m2, shapes (N, K).

    Permittivities hardly change with frequency: tanh X is taken to second order about their mean.
    """
    half, eps11, eps33 = live.thickness / 2, constants[:, [_EPS33S - 1]], constants[:, [_EPS33S]]
    apart = np.sqrt(eps11 / eps33)
    mean = np.mean(apart)
    kb = np.maximum(np.sqrt(waves), _FLAT) * half / live.radius
    X, amid = kb * apart, np.tanh(kb * mean)
    flat, away = kb * (1 - amid**2), apart - mean
    bent = amid + away * (flat - away * (flat * amid * kb))
    return eps33 / half * X / bent, eps33 / half * X * bent


BARE = Faces()
"""Nothing but electrodes without mass."""
