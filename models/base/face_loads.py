"""What may lie on or between the faces of a device's parts: an effect says it, and a model says what it does."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

from .arrays import Complexes, Frequencies, softened
from .model import Model

FACES = ("face:back", "face:front")
"""The two faces of a device."""


@dataclass(frozen=True)
class Dot:
    """A round piece of an isotropic solid on the middle of a face: solder, resin, a drop of glue."""

    fraction: float
    """Part of the face that it covers, 0 to 1."""
    mass: float
    """Mass per area of its base, kg/m2."""
    impedance: float
    """Specific acoustic impedance of longitudinal waves, Rayl."""
    speed: float
    """Speed of longitudinal waves, m/s."""
    dome: float = 0.0
    """Half range of its height over the mean: 0 for a cylinder, 1 for a paraboloid."""
    q: float = 1e3
    """Quality factor of both moduli."""
    poisson: float = 0.36
    """Poisson's ratio."""
    damping: float = 0.0
    """See `softened`."""

    @property
    def density(self) -> float:
        """kg/m3."""
        return self.impedance / self.speed

    @property
    def height(self) -> float:
        """Mean height, m."""
        return self.mass / self.density

    @property
    def lame(self) -> tuple[float, float]:
        """Lame's constants lambda and mu, Pa."""
        c33 = self.impedance * self.speed
        shear = c33 * (1 - 2 * self.poisson) / (2 - 2 * self.poisson)
        return c33 - 2 * shear, shear

    def radius(self, area: float) -> float:
        """Return the radius of its base in m on a face of this area in m2."""
        return math.sqrt(self.fraction * area / math.pi)


@dataclass(frozen=True)
class Coat:
    """A thin layer of an isotropic solid over each of both faces: a printed electrode, ink, wax.

    Much thinner than any wave in it: it is stretched and bent with the face, as a thin plate is.
    """

    mass: float
    """Mass per area of the front, kg/m2."""
    speed: float
    """Speed of longitudinal waves, m/s."""
    q: float = 20.0
    """Quality factor of both moduli."""
    poisson: float = 0.37
    """Poisson's ratio."""
    density: float = math.inf
    """kg/m3; infinite for a layer without thickness."""
    back: float = 1.0
    """Mass on the back face over that on the front."""
    damping: float = 0.0
    """See `softened`."""

    @property
    def thickness(self) -> float:
        """M."""
        return self.mass / self.density

    @property
    def tension(self) -> tuple[complex, complex]:
        """Stiffness over its thickness to strains along and across, N/m: c11 and c12 without stress on its face."""
        c33 = self.mass * self.speed**2 * (1 + 1j / self.q) * softened(self.damping)
        ratio = self.poisson / (1 - self.poisson)
        return c33 * (1 - ratio**2), c33 * ratio * (1 - ratio)


@dataclass(frozen=True)
class DeadLayer:
    """Ceramic without polarisation under the faces."""

    front: float
    """Depth under the front, m."""
    back: float = 0.0
    """Depth under the back, m."""
    stiffness: float = 1.0
    """c11 over c33D of the live ceramic."""
    permittivity: float = 1.0
    """Over eps33S of the live ceramic."""


@dataclass(frozen=True)
class OpenBond:
    """Part of a bond between two layers that transmits no stress, round and in the middle."""

    fraction: float
    """Part of the area, 0 to 1."""
    instead_of: str = ""
    """The layer of glue that is missing there, if one is: a pocket of air takes its place."""


Load: TypeAlias = Dot | Coat | DeadLayer | OpenBond
"""What may lie on a face, under it, or where two faces should touch."""


@runtime_checkable
class HasFaces(Protocol):
    """A model that is no stack, with faces on which something may lie."""

    def faces_for(self, load: type[Load]) -> Sequence[str]:
        """Return the places that differ from each other: `face:front`, `interface:A|B`, in the ceramic `layer:NAME`.

        None if the model cannot have such a load.
        """
        ...

    def with_load(self, where: str, load: Load) -> Model:
        """Return the model with a load at one of these places."""
        ...

    def moved_by_loads(self, frequency: Frequencies, other: Model) -> Complexes:
        """Return ln Z of a model with slightly different loads of its faces less that of this one, first order, (N,).

        The other may also have a small load that this one has not.
        """
        ...
