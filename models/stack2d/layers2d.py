"""The layers of a stack in two dimensions: a poled ceramic, and isotropic viscoelastic layers."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from ..constants.causal import continued
from ..constants.tensor import Tensor6mm
from ..disk2d.matrices import CONSTANTS
from ..stack.loss_laws import CONSTANT, LawKind, LossLaw, StackError, require_positive
from .section import LAYER_CONSTANTS

_MARGIN = 4
# Degree of a layer's functions beyond one for each two radians of a shear wave: an error of 1e-6 for a bare disk.
_THIN = 1.0
# Radians below which a layer is thin, and two degrees beyond that serve: it is sheared and compressed as a whole.


def order_of(thickness: float, speed: float, highest: float) -> int:
    """Return the degree for a layer in m whose slowest wave has this speed in m/s, up to a frequency in Hz."""
    phase = 2 * math.pi * highest * thickness / speed
    return math.ceil(phase / 2) + (_MARGIN if phase > _THIN else 2)


def require_part(what: str, part: float) -> None:
    """Raise StackError unless the radius of something is a part of that of the stack."""
    if not 0 < part <= 1:
        raise StackError(f"{what} has {part:g} of the radius of the stack; more than 0 and at most 1 is allowed")


@dataclass(frozen=True)
class Ceramic2D:
    """A poled ceramic with electrodes on both faces."""

    name: str
    constants: Tensor6mm
    """Constants at the law's reference frequency."""
    thickness: float
    """m."""
    density: float
    """kg/m3."""
    law: LossLaw = CONSTANT
    """Continuation of each constant to other frequencies."""
    elastic: LossLaw | None = None
    """The same for the five stiffnesses, if they have another law."""
    dielectric: LossLaw | None = None
    """The same for both permittivities."""
    electrode: float = 1.0
    """Radius of both electrodes over that of the stack, at most 1."""
    reach: ClassVar[float] = 1.0
    """Radius over that of the stack."""

    def __post_init__(self) -> None:
        require_positive(f"layer {self.name!r}", thickness=self.thickness, density=self.density)
        require_part(f"layer {self.name!r}: its electrode", self.electrode)

    def law_of(self, constant: str) -> LossLaw:
        """Return the law of one of CONSTANTS."""
        own = self.elastic if constant.startswith("c") else self.dielectric if constant.startswith("eps") else None
        return own or self.law

    def with_law(self, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Self:
        """Return the layer with the law of its stiffnesses or permittivities changed."""
        if kind == "elastic":
            return replace(self, elastic=change(self.elastic or self.law))
        return replace(self, dielectric=change(self.dielectric or self.law))

    @property
    def shear_speed(self) -> float:
        """Speed of shear waves, m/s."""
        return math.sqrt(abs(self.constants.c44E.real) / self.density)

    def parameters(self) -> dict[str, float]:
        """Return `thickness`, `density` and `c11E.re`, `c11E.im`, ..., SI units."""
        made = {"thickness": self.thickness, "density": self.density}
        for name in CONSTANTS:
            value = complex(getattr(self.constants, name))
            made |= {f"{name}.re": value.real, f"{name}.im": value.imag}
        return made

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the layer with these parameters."""
        own = {**self.parameters(), **values}
        tensor = Tensor6mm(*(complex(own[f"{name}.re"], own[f"{name}.im"]) for name in CONSTANTS))
        return replace(self, constants=tensor, thickness=own["thickness"], density=own["density"])

    def over(self, frequency: Frequencies) -> Complexes:
        """Return the LAYER_CONSTANTS at each frequency in Hz, shape (F, 11), SI."""
        own = [continued(self.law_of(name), complex(getattr(self.constants, name)), frequency)[0] for name in CONSTANTS]
        return np.array([*own, np.full(frequency.size, complex(self.density))]).T

    def chain(self, frequency: Frequencies) -> Mapping[str, Complexes]:
        """Return d LAYER_CONSTANTS / d parameter, each of shape (F, 11), without the thickness."""
        made: dict[str, Complexes] = {}
        for k, name in enumerate(CONSTANTS):
            _, own = continued(self.law_of(name), complex(getattr(self.constants, name)), frequency)
            for part in ("re", "im"):
                made[f"{name}.{part}"] = _column(k, own[part])
        return made | {"density": _column(len(CONSTANTS), np.ones(frequency.size, np.complex128))}


@dataclass(frozen=True)
class Isotropic:
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
    law: LossLaw = CONSTANT
    """Continuation of both moduli to other frequencies."""
    reach: float = 1.0
    """Radius over that of the stack, at most 1."""

    def __post_init__(self) -> None:
        require_part(f"layer {self.name!r}", self.reach)
        require_positive(f"layer {self.name!r}", thickness=self.thickness, z=self.z, c=self.c, q=self.q)
        if not -1 < self.poisson < 0.5:
            raise StackError(f"layer {self.name!r}: Poisson's ratio is {self.poisson:g}; -1 to 0.5 is allowed")

    def with_law(self, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Self:
        """Return the layer with the law of its moduli changed; it has no other."""
        return replace(self, law=change(self.law)) if kind == "elastic" else self

    @property
    def shear_speed(self) -> float:
        """Speed of shear waves, m/s."""
        return self.c * math.sqrt(self._shares[1])

    @property
    def _shares(self) -> tuple[float, float]:
        """c13 and c44 over c33."""
        nu = self.poisson
        return nu / (1 - nu), (1 - 2 * nu) / (2 - 2 * nu)

    def parameters(self) -> dict[str, float]:
        """Return `thickness` (m), `z` (Rayl), `c` (m/s), `q` and `poisson`."""
        return {"thickness": self.thickness, "z": self.z, "c": self.c, "q": self.q, "poisson": self.poisson}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the layer with these parameters."""
        return replace(self, **values)

    def over(self, frequency: Frequencies) -> Complexes:
        """Return the LAYER_CONSTANTS at each frequency in Hz, shape (F, 11), SI."""
        c33, _ = continued(self.law, self._c33, frequency)
        made = c33[:, None] * self._elastic(*self._shares)
        made[:, -1] = self.z / self.c
        return made

    def chain(self, frequency: Frequencies) -> Mapping[str, Complexes]:
        """Return d LAYER_CONSTANTS / d parameter, each of shape (F, 11), without the thickness."""
        c33, by = continued(self.law, self._c33, frequency)
        shares = self._elastic(*self._shares)
        by_size = (by["re"] + by["im"] / self.q)[:, None] * shares
        by_q = (-self.z * self.c / self.q**2 * by["im"])[:, None] * shares
        slope = 1 / (1 - self.poisson) ** 2
        # c13/c33 = nu/(1 - nu), and c44/c33 = (1 - c13/c33)/2
        by_poisson = c33[:, None] * (self._elastic(slope, -slope / 2) - self._elastic(0.0, 0.0))
        z, c = self.c * by_size, self.z * by_size
        z[:, -1], c[:, -1] = 1 / self.c, -self.z / self.c**2
        return {"z": z, "c": c, "q": by_q, "poisson": by_poisson}

    @property
    def _c33(self) -> complex:
        return self.z * self.c * complex(1.0, 1 / self.q)

    @staticmethod
    def _elastic(c13: float, c44: float) -> Reals:
        """Return the constants over c33, shape (11,)."""
        return np.array([1.0, c13, c13, 1.0, c44, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def _column(k: int, values: Complexes) -> Complexes:
    made = np.zeros((values.size, len(LAYER_CONSTANTS)), np.complex128)
    made[:, k] = values
    return made
