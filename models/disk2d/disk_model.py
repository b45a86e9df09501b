"""A round disk with its full 6mm constants, as a `Model` for the fitters."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega, softened
from ..base.face_loads import FACES, Coat, DeadLayer, Dot, Load
from ..base.model import Model
from ..base.names import require
from ..constants.causal import continued
from ..constants.tensor import Tensor6mm
from ..stack.loss_laws import CONSTANT, LawKind, LossLaw, require_positive
from .capacitance import CapacitanceSlopes, SolvedDisk, solved
from .dotted import DottedDisk, FreeDisk, PlacedDot
from .faces import BARE, Faces
from .full import Shape
from .loadable import LoadableDisk
from .matrices import CONSTANTS
from .reduced import DiskError, ReducedDisk

_KEPT = 4
# Results that a disk and its copies keep.


@dataclass(frozen=True)
class Disk2D:
    """A round disk, electrodes over both faces, free but for loads of these. Satisfies `Model`, `HasLaws`, `HasFaces`.

    `reduced` must have been made for a like D/t, for constants like these and up to the highest frequency asked of
    it: `error.estimate` says whether it serves.
    """

    name: str
    constants: Tensor6mm
    """Constants at the law's reference frequency."""
    area: float
    """m2."""
    thickness: float
    """m."""
    density: float
    """kg/m3."""
    reduced: ReducedDisk
    law: LossLaw = CONSTANT
    """Continuation of each constant to other frequencies."""
    elastic: LossLaw | None = None
    """The same for the five stiffnesses, if they have another law."""
    dielectric: LossLaw | None = None
    """The same for both permittivities."""
    damping: float = 0.0
    """The disk is computed at frequencies f (1 - j damping/2): every loss tangent is larger by this much."""
    rough: bool = False
    """Accurate to a thousandth or so, at half the cost: for a search. Faces that are not alike count by their mean."""
    loadable: Callable[[], LoadableDisk] | None = field(default=None, compare=False, repr=False)
    """Gives the reduced disk on whose faces dots can lie, for a like D/t as `reduced`; None: `faces` can be loaded."""
    odd: Callable[[], ReducedDisk] | None = field(default=None, compare=False, repr=False)
    """Gives the reduced disk of antisymmetric motion, for faces that are not alike; None: only their mean counts."""
    dots: tuple[PlacedDot, ...] = ()
    """What lies on parts of the faces."""
    faces: Faces = BARE
    """What covers either electrode, and how much of the ceramic under it is dead."""
    _known: "list[_Known]" = field(default_factory=list["_Known"], compare=False, repr=False)
    """The last results of this disk and of copies with other values: a fit asks for values first, then derivatives."""

    def __post_init__(self) -> None:
        require_positive(self.name, area=self.area, thickness=self.thickness, density=self.density)

    @property
    def shape(self) -> Shape:
        """Sizes and density."""
        return Shape(float(np.sqrt(self.area / np.pi)), self.thickness, self.density)

    def parameters(self) -> dict[str, float]:
        """Return `area`, `name.thickness`, `name.density` and `name.c11E.re`, `name.c11E.im`, ..."""
        made = {"area": self.area, f"{self.name}.thickness": self.thickness, f"{self.name}.density": self.density}
        for constant in CONSTANTS:
            value = complex(getattr(self.constants, constant))
            made |= {f"{self.name}.{constant}.re": value.real, f"{self.name}.{constant}.im": value.imag}
        return made

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the disk with these parameters. Raises KeyError for an unknown name."""
        own = self.parameters()
        require(values, own, "the disk")
        all_of = {**own, **values}
        tensor = Tensor6mm(*(complex(all_of[f"{self.name}.{c}.re"], all_of[f"{self.name}.{c}.im"]) for c in CONSTANTS))
        thickness, density = all_of[f"{self.name}.thickness"], all_of[f"{self.name}.density"]
        return replace(self, constants=tensor, area=all_of["area"], thickness=thickness, density=density)

    def law_of(self, constant: str) -> LossLaw:
        """Return the law of one of CONSTANTS."""
        own = self.elastic if constant.startswith("c") else self.dielectric if constant.startswith("eps") else None
        return own or self.law

    def with_law(self, layer: str, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Self:
        """Return the disk with the law of its stiffnesses or permittivities changed; see `HasLaws`."""
        if layer != self.name:
            return self
        if kind == "elastic":
            return replace(self, elastic=change(self.elastic or self.law))
        return replace(self, dielectric=change(self.dielectric or self.law))

    def faces_for(self, load: type[Load]) -> tuple[str, ...]:
        """Return the front if it can have such a load: the back is like it. Ceramic is dead in the disk itself.

        A disk can have dots, or electrodes and dead layers, not both; these only if they cover the whole faces.
        """
        if load is Dot:
            return FACES[1:] if self.loadable is not None else ()
        if self.loadable is not None or self.reduced.electrode < 1:
            return ()
        return FACES[1:] if load is Coat else (f"layer:{self.name}",)

    def with_load(self, where: str, load: Load) -> Self:
        """Return the disk with a dot on this face, beside what is on the other, or with a load of both faces.

        Raises DiskError; see `HasFaces`.
        """
        if where not in (*FACES, f"layer:{self.name}") or not self.faces_for(type(load)):
            said = " ".join(re.findall("[A-Z][a-z]*", type(load).__name__)).lower()
            raise DiskError(f"disk {self.name!r}: no {said} can lie on {where!r} of this model")
        if isinstance(load, DeadLayer):
            return replace(self, faces=self.faces.with_load(load))
        if isinstance(load, Coat):
            return replace(self, faces=self.faces.with_load(replace(load, damping=self.damping)))
        if not isinstance(load, Dot):
            raise TypeError(f"{type(load).__name__} is no load of a disk")
        others = tuple(one for one in self.dots if one.where != where)
        return replace(self, dots=(*others, PlacedDot(where, replace(load, damping=self.damping))))

    def over(self, frequency: Frequencies) -> Complexes:
        """Return the ten constants at each frequency in Hz, SI units, shape (N, 10)."""
        own = [continued(self.law_of(c), getattr(self.constants, c), frequency)[0] for c in CONSTANTS]
        return np.array(own).T * self._softer

    def formula_errors(self, frequency: Frequencies) -> dict[str, Reals]:
        """Return the relative standard errors of stiffness that stand for what layers on the faces neglect.

        None without layers; see `Approximate`.
        """
        if not self.faces:
            return {}
        error = self.faces.neglected(self.shape, self.over(frequency), frequency)
        return {f"{self.name}.{constant}": error for constant in ("c11E", "c33E")}

    @property
    def _softer(self) -> Complexes:
        """What damping makes of each constant, shape (10,): the form is linear in them and in the squared frequency."""
        stiffness = softened(self.damping)
        powers = [1.0 if c.startswith("c") else 0.0 if c.startswith("eps") else 0.5 for c in CONSTANTS]
        return np.array([stiffness**power for power in powers], np.complex128)

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        return 1 / (j_omega(frequency) * self._solved(frequency).capacitance)

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N). Raises KeyError for an unknown name."""
        require(names, self.parameters(), "the disk")
        made = self._slopes(frequency)
        C = made.capacitance
        rows = {
            "area": made.by_log_radius / (2 * self.area),
            f"{self.name}.thickness": made.by_log_thickness / self.thickness,
            f"{self.name}.density": made.by_log_density / self.density,
        }
        by_constant = made.by_constant * self._softer
        for k, constant in enumerate(CONSTANTS):
            _, chain = continued(self.law_of(constant), getattr(self.constants, constant), frequency)
            rows |= {f"{self.name}.{constant}.{part}": by_constant[:, k] * chain[part] for part in ("re", "im")}
        slope = np.array([-rows[name] / C for name in names], np.complex128)
        return 1 / (j_omega(frequency) * C), slope.reshape(len(names), frequency.size)

    def moved_by_laws(self, frequency: Frequencies, other: Model) -> Complexes:
        """Return ln Z of a disk with slightly different laws less that of this one, to first order, shape (N,)."""
        if not isinstance(other, Disk2D):
            raise TypeError(f"{type(other).__name__} is no disk in two dimensions")
        made = self._slopes(frequency)
        return -np.sum(made.by_constant * (other.over(frequency) - self.over(frequency)), axis=1) / made.capacitance

    def moved_by_loads(self, frequency: Frequencies, other: Model) -> Complexes:
        """Return ln Z of a disk with slightly different loads less that of this one, to first order, shape (N,)."""
        if not isinstance(other, Disk2D):
            raise TypeError(f"{type(other).__name__} is no disk in two dimensions")
        own = self._solved(frequency)
        if isinstance(own.rising, SolvedDisk) and not other.dots:
            return -own.rising.with_faces(other.faces)[own.back] / own.capacitance
        change = own.rising.moved(other.dots) if isinstance(own.rising, DottedDisk) else None
        if change is not None:
            return -change[own.back] / own.capacitance
        # what is not there yet adds little, and no difference of two sums of modes shows that
        return (self.added_by_dots(frequency) - other.added_by_dots(frequency)) / own.capacitance

    def added_by_dots(self, frequency: Frequencies) -> Complexes:
        """Return what dots add to the capacitance, F, shape (N,)."""
        own = self._solved(frequency)
        return own.rising.added[own.back] if isinstance(own.rising, DottedDisk) else np.zeros_like(own.capacitance)

    def _slopes(self, frequency: Frequencies) -> CapacitanceSlopes:
        """Return the capacitance and its derivatives, in the order of `frequency`."""
        return self._solved(frequency).slopes

    def _solved(self, frequency: Frequencies) -> "_Known":
        """Return the disk solved at these frequencies, from what is known if it has been."""
        for known in self._known:
            if known.disk == self and np.array_equal(known.frequency, frequency):
                return known
        order = np.argsort(frequency)
        rising = frequency[order]
        made = _Known(self, frequency.copy(), self._over_rising(rising), np.argsort(order))
        self._known[:] = [made, *self._known[: _KEPT - 1]]
        return made

    def _over_rising(self, frequency: Frequencies) -> "SolvedDisk | DottedDisk":
        if not self.dots or self.loadable is None:
            odd = None if self.rough else self.odd  # antisymmetric motion is of second order in what is on the faces
            return solved(self.reduced, self.shape, self.over(frequency), frequency, self.rough, self.faces, odd)
        for known in self._known:
            own, alike = known.rising, replace(known.disk, dots=self.dots) == self
            if alike and isinstance(own, DottedDisk) and np.array_equal(own.bare.frequency, frequency):
                return own.bare.with_dots(self.dots)
        free = FreeDisk(self.loadable(), self.shape, self.over(frequency), frequency, self.rough)
        return free.with_dots(self.dots)


@dataclass(frozen=True, eq=False)
class _Known:
    """A result of a disk, in the order of the frequencies that it was asked for."""

    disk: Disk2D
    frequency: Frequencies
    rising: SolvedDisk | DottedDisk
    back: NDArray[np.intp]

    @cached_property
    def capacitance(self) -> Complexes:
        """F, shape (N,)."""
        return self.rising.capacitance[self.back]

    @cached_property
    def slopes(self) -> CapacitanceSlopes:
        """The capacitance with its derivatives."""
        rising = self.rising.slopes
        return CapacitanceSlopes(*(getattr(rising, one.name)[self.back] for one in fields(rising)))
