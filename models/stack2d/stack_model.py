"""A glued stack of finite diameter, as a `Model` for the fitters."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Self, TypeAlias

import numpy as np

from ..base.arrays import Complexes, Frequencies, Impedances, j_omega
from ..base.face_loads import Load, OpenBond
from ..base.model import Model
from ..base.names import require
from ..stack.loss_laws import LawKind, LossLaw, StackError, require_positive
from .capacitance_slopes import Section, StackCapacitance, StackWaves
from .layer_mesh import LayerMesh
from .layers2d import Ceramic2D, Isotropic, order_of
from .opened import Opening
from .reduction import KEPT, error, reduced
from .section import LAYER_CONSTANTS, CrossSection
from .waves import Sizes
from .zones import ZonedSection

Layer2D: TypeAlias = Ceramic2D | Isotropic
_FINER = 4
# Degrees that a section has more in the estimate of the error of its degrees.
_PLACES, _PLACES_OF_PARTS = 24, 12
# Frequencies whose motion is sampled for a reduced section, and for one of several parts, which takes longer.
_CHORD, _SMALLEST = 1e-3, 0.01
# Step of a derivative by the part of a bond that is open, relative to it, and where it is not open yet.


@dataclass(frozen=True)
class Stack2D:
    """Round layers, free at the rim, in two dimensions. Satisfies `Model`, `HasLaws`, `HasFaces`.

    The loads act on the axial motion of the faces, as in one dimension: a force per area of -z times the velocity.
    """

    layers: tuple[Layer2D, ...]
    """Back to front; one of them is a ceramic."""
    area: float
    """m2, of the ceramic."""
    section: Section
    """Functions of z of these layers, from `full_section` or `with_reduced_section`."""
    back: float = 0.0
    """Specific acoustic impedance behind, Rayl."""
    front: float = 0.0
    """The same in front."""
    opening: Opening | None = None
    """Where a bond is open, if one is."""
    hole: float = 0.0
    """Radius of a hole through the middle of all layers, m; the area is then that of a ring."""
    _known: "list[_Known]" = field(default_factory=list["_Known"], compare=False, repr=False)
    """The last waves of this stack and of copies with other values."""

    def __post_init__(self) -> None:
        require_positive("stack", area=self.area)
        ends = [layer.reach if isinstance(layer, Isotropic) else layer.electrode for layer in self.layers]
        narrowest = min(ends) * self.sizes.radius
        if not 0 <= self.hole < narrowest:
            raise StackError(
                f"stack: its hole has a radius of {self.hole:g} m; 0 to below {narrowest:g} m is allowed, the radius "
                "of its narrowest layer or electrode"
            )
        if min(self.back, self.front) < 0:
            raise StackError(f"stack: loads are {self.back:g} and {self.front:g} Rayl; not less than 0 is allowed")

    @property
    def sizes(self) -> Sizes:
        """Radii and thicknesses."""
        radius = math.sqrt(self.area / math.pi + self.hole**2)
        return Sizes(radius, tuple(layer.thickness for layer in self.layers), self.hole)

    def parameters(self) -> dict[str, float]:
        """Return `area`, `back.z`, `front.z`, and `layer.constant` of every layer, SI units."""
        made = {"area": self.area, "back.z": self.back, "front.z": self.front}
        return made | {f"{one.name}.{key}": value for one in self.layers for key, value in one.parameters().items()}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the stack with these parameters. Raises KeyError for an unknown name."""
        require(values, self.parameters(), "the stack")
        groups: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            owner, _, key = name.partition(".")
            groups.setdefault(owner, {})[key] = value
        return replace(
            self,
            layers=tuple(one.replace(groups[one.name]) if one.name in groups else one for one in self.layers),
            area=values.get("area", self.area),
            back=values.get("back.z", self.back),
            front=values.get("front.z", self.front),
        )

    def over(self, frequency: Frequencies) -> Complexes:
        """Return the LAYER_CONSTANTS of all layers and both loads at each frequency in Hz, shape (F, 11 L + 2), SI."""
        loads = np.broadcast_to(np.array([self.back, self.front], np.complex128), (frequency.size, 2))
        return np.hstack([*(layer.over(frequency) for layer in self.layers), loads])

    def with_law(self, layer: str, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Self:
        """Return the stack with one law of this layer changed; itself if it has no such layer. See `HasLaws`."""
        return replace(self, layers=tuple(o.with_law(kind, change) if o.name == layer else o for o in self.layers))

    def faces_for(self, load: type[Load]) -> tuple[str, ...]:
        """Return the interfaces, at which a bond may be open; nothing else lies on its faces. See `HasFaces`.

        None if the section is reduced, for the motion at an opening needs functions of its own, if it has parts, or
        a hole where the opening would be.
        """
        if load is not OpenBond or self.hole > 0 or isinstance(self.section, ZonedSection):
            return ()
        if not self.section.is_whole:
            return ()
        return tuple(f"interface:{a.name}|{b.name}" for a, b in pairwise(self.layers))

    def with_load(self, where: str, load: Load) -> Self:
        """Return the stack with an open bond at this interface. Raises StackError; see `HasFaces`."""
        if not isinstance(load, OpenBond) or where not in self.faces_for(OpenBond):
            raise StackError(f"stack: a {type(load).__name__} at {where!r} is not in this model; bonds may be open")
        behind = self.faces_for(OpenBond).index(where)
        names = [layer.name for layer in self.layers]
        apart = behind, behind + 1
        if load.instead_of:
            missing = names.index(load.instead_of)
            apart = missing - 1, missing + 1
        return replace(self, opening=Opening(apart, load.fraction))

    def moved_by_laws(self, frequency: Frequencies, other: Model) -> Complexes:
        """Return ln Z of a stack with slightly different laws less that of this one, to first order, shape (F,)."""
        if not isinstance(other, Stack2D):
            raise TypeError(f"{type(other).__name__} is no stack in two dimensions")
        made = self._slopes(frequency)
        return -np.sum(made.by_constant * (other.over(frequency) - self.over(frequency)), axis=1) / made.capacitance

    def moved_by_loads(self, frequency: Frequencies, other: Model) -> Complexes:
        """Return ln Z of a stack with a slightly larger opening less that of this one, to first order, shape (F,).

        The first thousandths of the area change nothing to first order, so that there it is the slope of a chord.
        """
        if not isinstance(other, Stack2D):
            raise TypeError(f"{type(other).__name__} is no stack in two dimensions")
        if other.opening is None:
            return np.zeros(frequency.size, np.complex128)
        size = 0.0 if self.opening is None else self.opening.fraction
        step = _CHORD * max(size, _SMALLEST) if size > 0 else _SMALLEST
        waves = self._waves(frequency, other.opening.apart)
        rate = np.log(waves.capacitance(size) / waves.capacitance(size + step)) / step
        return np.asarray(rate * (other.opening.fraction - size), np.complex128)

    def capacitance(self, frequency: Frequencies) -> Complexes:
        """Return Y/(jw) in F, shape (F,), at frequencies in Hz, shape (F,)."""
        return self._waves(frequency).capacitance(*self._open)

    def _slopes(self, frequency: Frequencies) -> StackCapacitance:
        return self._waves(frequency).slopes(*self._open)

    @property
    def _open(self) -> tuple[float, ...]:
        return () if self.opening is None else (self.opening.fraction,)

    def _waves(self, frequency: Frequencies, apart: tuple[int, int] | None = None) -> StackWaves:
        """Return the waves at these frequencies; of both sides where these layers, or those of the opening, are apart.

        A fit asks for values, then for their derivatives, then for openings of other sizes.
        """
        apart = self.opening.apart if apart is None and self.opening is not None else apart
        values = self.over(frequency)
        for known in self._known:
            if known.serves(self.section, self.sizes, apart, values, frequency):
                return known.waves
        made = StackWaves.of(self.section, self.sizes, values, frequency, apart)
        self._known[:] = [_Known(made, values, frequency.copy())]
        return made

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (F,), at frequencies in Hz, shape (F,)."""
        return 1 / (j_omega(frequency) * self.capacitance(frequency))

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (F,), and d ln Z / d parameter, shape (P, F). Raises KeyError for an unknown name."""
        require(names, self.parameters(), "the stack")
        found = self._slopes(frequency)
        wide = len(LAYER_CONSTANTS)
        rows = {
            "area": found.by_log_radius / (2 * math.pi * self.sizes.radius**2),
            "back.z": found.by_constant[:, -2],
            "front.z": found.by_constant[:, -1],
        }
        for k, layer in enumerate(self.layers):
            own = found.by_constant[:, k * wide : (k + 1) * wide]
            rows[f"{layer.name}.thickness"] = found.by_log_thickness[:, k] / layer.thickness
            for key, chain in layer.chain(frequency).items():
                rows[f"{layer.name}.{key}"] = np.einsum("fc,fc->f", own, chain)
        made = np.array([-rows[name] / found.capacitance for name in names], np.complex128)
        return 1 / (j_omega(frequency) * found.capacitance), made.reshape(len(names), frequency.size)


@dataclass(frozen=True, eq=False)
class _Known:
    """Waves, and what they are of."""

    waves: StackWaves
    values: Complexes
    frequency: Frequencies

    def serves(
        self,
        section: Section,
        sizes: Sizes,
        apart: tuple[int, int] | None,
        values: Complexes,
        frequency: Frequencies,
    ) -> bool:
        """Return whether these are the waves of such a stack."""
        own = self.waves
        alike = own.section is section and own.sizes == sizes and own.apart == apart
        return alike and np.array_equal(self.frequency, frequency) and np.array_equal(self.values, values)


def full_section(layers: Sequence[Layer2D], highest: float, finer: int = 0) -> Section:
    """Return the section of these layers up to a frequency in Hz; `finer`: further degrees of every layer.

    Raises StackError unless exactly one of the layers is a ceramic.
    """
    ceramics = [layer for layer in layers if isinstance(layer, Ceramic2D)]
    if len(ceramics) != 1:
        raise StackError(f"stack: {len(ceramics)} of its layers are piezoelectric; exactly one is allowed")
    (ceramic,) = ceramics
    degrees = [order_of(layer.thickness, layer.shear_speed, highest) + finer for layer in layers]
    reaches, piezo = [layer.reach for layer in layers], layers.index(ceramic)
    if min(*reaches, ceramic.electrode) == 1:
        return CrossSection.of([LayerMesh.of(degree) for degree in degrees], piezo)
    whole = sum(layer.thickness for layer in layers)
    ends = [ceramic.electrode if layer is ceramic else layer.reach for layer in layers]
    # a layer has an edge on its face if it, its electrode or a neighbour ends there
    meshes = [
        LayerMesh.graded(degree, whole / layer.thickness, finer // 2)
        if ends[k] < 1 or len(set(reaches[max(k - 1, 0) : k + 2])) > 1
        else LayerMesh.of(degree)
        for k, (layer, degree) in enumerate(zip(layers, degrees, strict=True))
    ]
    return ZonedSection.of(meshes, piezo, reaches, ceramic.electrode)


def with_reduced_section(
    stack: Stack2D, bands: Sequence[tuple[float, float]], kept: float = KEPT
) -> tuple[Stack2D, float]:
    """Return the stack over the functions of z that it needs in these bands in Hz, and their error.

    The error is that of the capacitance, relative, root mean square, against functions of higher degree that are not
    reduced, between the frequencies of which samples were taken.
    """
    full = full_section(stack.layers, max(high for _, high in bands))
    places = _PLACES_OF_PARTS if isinstance(full, ZonedSection) else _PLACES
    asked = [np.linspace(low, high, 2 * places + 1) for low, high in bands]
    sampled, between = (np.concatenate([own[start::2] for own in asked]) for start in (0, 1))
    made = replace(stack, section=reduced(full, stack.sizes, stack.over(sampled), sampled, kept))
    return made, section_error(made, between)


def section_error(stack: Stack2D, frequency: Frequencies) -> float:
    """Return the relative error of the capacitance, rms over frequencies in Hz, against functions of higher degree."""
    finer = full_section(stack.layers, float(frequency.max()), _FINER)
    return error(stack.section, finer, stack.sizes, stack.over(frequency), frequency)
