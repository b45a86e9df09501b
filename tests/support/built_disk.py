"""A disk as built: with bonded layers, electrodes that end before the rim, a ring or spot of mass on a face."""

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import chain
from math import ceil
from typing import Self

import numpy as np
from cross_section import LAYER_POWERS, CrossSection, Ring, SectionMatrices, assemble_section

from pzctl.models.base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from pzctl.models.constants.causal import continued
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.line_elements import LineElements, Numbers
from pzctl.models.disk2d.matrices import CONSTANTS, OF_TERM, POWERS
from pzctl.models.stack.loss_laws import CONSTANT, LossLaw, StackError, require_positive

_ORDER_R, _ORDER_Z = 7, 8


@dataclass(frozen=True)
class Bonded:
    """An isotropic viscoelastic layer: matching layer, glue, electrode."""

    name: str
    thickness: float
    """m."""
    z: float
    """Specific acoustic impedance rho c of longitudinal waves, Rayl."""
    c: float
    """Speed of longitudinal waves, m/s."""
    q: float
    """Quality factor of both moduli: c33 = z c (1 + j/q)."""
    poisson: float
    """Poisson's ratio, -1 to 0.5, both excluded."""

    def __post_init__(self) -> None:
        require_positive(f"layer {self.name!r}", thickness=self.thickness, z=self.z, c=self.c, q=self.q)
        if not -1 < self.poisson < 0.5:
            raise StackError(f"layer {self.name!r}: Poisson's ratio is {self.poisson:g}; -1 to 0.5 is allowed")

    @classmethod
    def of_shear(cls, name: str, thickness: float, z: float, c: float, q: float, c_shear: float) -> Self:
        """Return the layer whose shear waves have the speed `c_shear` in m/s. Raises StackError if it is impossible."""
        ratio = (c_shear / c) ** 2
        if not 0 < ratio < 0.75:
            raise StackError(f"layer {name!r}: shear speed is {c_shear:g} m/s; below 0.866 times {c:g} m/s is allowed")
        return cls(name, thickness, z, c, q, (1 - 2 * ratio) / (2 - 2 * ratio))

    @property
    def density(self) -> float:
        """kg/m3."""
        return self.z / self.c

    @property
    def lame(self) -> tuple[complex, complex]:
        """Lame's constants lambda and mu at the reference of the loss law, Pa."""
        c33, nu = self.z * self.c * complex(1.0, 1 / self.q), self.poisson
        return c33 * nu / (1 - nu), c33 * (1 - 2 * nu) / (2 - 2 * nu)


@dataclass(frozen=True)
class RingMass:
    """A ring, or a spot (`ring.inner` zero), of mass on a face."""

    ring: Ring
    mass: float
    """Total mass, kg."""


@dataclass(frozen=True)
class BuiltShape(Shape):
    """Sizes of a disk and of its layers."""

    layers: tuple[float, ...] = ()
    """Thickness of each layer from back to front, m."""

    @property
    def of_term(self) -> Numbers:
        """Index of each term's constant, shape (13 + 6 L,): ten of the ceramic, then two of each layer."""
        count = len(CONSTANTS)
        own = (np.repeat([count + 2 * k, count + 2 * k + 1], 3) for k in range(len(self.layers)))
        return np.concatenate([OF_TERM, *own])

    @property
    def lengths(self) -> Reals:
        """a^k b^(1 - k) of each term in m, shape (13 + 6 L,); b is the layer's thickness, half the ceramic's."""
        own = (self.radius**LAYER_POWERS * thickness ** (1.0 - LAYER_POWERS) for thickness in self.layers)
        return np.concatenate([self.radius**POWERS * (self.thickness / 2) ** (1.0 - POWERS), *own])


@dataclass(frozen=True)
class BuiltDisk:
    """A round ceramic disk with everything bonded to it, solved on its whole mesh at every frequency."""

    constants: Tensor6mm
    """Constants at the law's reference frequency."""
    radius: float
    """m."""
    thickness: float
    """m."""
    density: float
    """kg/m3."""
    back: tuple[Bonded, ...] = ()
    """Layers behind the ceramic, from the outermost inwards."""
    front: tuple[Bonded, ...] = ()
    """Layers in front of the ceramic, from the ceramic outwards."""
    electrode: float = 1.0
    """Radius of both electrodes over that of the disk."""
    masses: tuple[RingMass, ...] = ()
    law: LossLaw = CONSTANT
    """Continuation of each constant to other frequencies."""
    finer: int = 0
    """Additional orders and elements per half thickness."""
    clamped: bool = False
    """Whether the disk moves in the plane; if not, it is the one-dimensional plate."""

    def __post_init__(self) -> None:
        require_positive("disk", radius=self.radius, thickness=self.thickness, density=self.density)
        if not 0 < self.electrode <= 1:
            raise StackError(f"disk: the electrode's radius is {self.electrode:g} of the disk's; 0 to 1 is allowed")
        for each in self.masses:
            if not (0 <= each.ring.inner < each.ring.outer <= 1 and each.mass >= 0):
                raise StackError(
                    f"disk: mass of {each.mass:g} kg from {each.ring.inner:g} to {each.ring.outer:g} of the radius; "
                    "not less than 0 kg and rising radii from 0 to 1 are allowed"
                )

    @property
    def layers(self) -> tuple[Bonded, ...]:
        """All bonded layers from back to front."""
        return (*self.back, *self.front)

    @property
    def shape(self) -> BuiltShape:
        """Sizes and density."""
        return BuiltShape(self.radius, self.thickness, self.density, tuple(layer.thickness for layer in self.layers))

    @cached_property
    def full(self) -> FullDisk:
        """The mesh with its matrices."""
        rings = tuple(each.ring for each in self.masses)
        section = CrossSection(len(self.back), len(self.front), self.electrode, rings)
        elements = max(1, ceil(2 * self.radius / self.thickness)) * (1 + self.finer)
        made = _assembled(section, elements, self.finer, not self.clamped)
        ceramic = self.density * self.thickness / 2
        shares = [layer.density * layer.thickness / ceramic for layer in self.layers]
        for each in self.masses:
            area = np.pi * self.radius**2 * (each.ring.outer**2 - each.ring.inner**2)
            shares.append(each.mass / area / ceramic)
        return FullDisk(made.loaded(np.array(shares)))

    def over(self, frequency: Frequencies) -> Complexes:
        """Return the ceramic's ten constants and two of each layer at each frequency, SI units, shape (N, 10 + 2 L)."""
        own = [complex(getattr(self.constants, name)) for name in CONSTANTS]
        every = chain(own, *(layer.lame for layer in self.layers))
        return np.array([continued(self.law, value, frequency)[0] for value in every]).T

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        C = self.full.capacitance(self.shape, self.over(frequency), frequency)
        return 1 / (j_omega(frequency) * C)


@cache
def _assembled(section: CrossSection, elements: int, finer: int, move_in_plane: bool) -> SectionMatrices:
    """Return the matrices of a mesh, which is the same for all constants and thicknesses."""
    along_r = LineElements(section.breaks(elements), _ORDER_R + finer)
    return assemble_section(section, along_r, _ORDER_Z + finer, move_in_plane=move_in_plane)
