"""The stack: layers between two loads, its impedance and the exact derivatives by every parameter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self, cast

import numpy as np

from ..arrays import Complexes, Frequencies, Impedances
from .active import ActiveLine
from .laws import ComplexLike, StackError
from .layers import Elastic, Layer, Piezo, require_positive
from .line import Line, one_minus_exp
from .loads import AIR, Load
from .network import Network, Section, is_active
from .row import Joins

_OWN = ("area", "back", "front")


@dataclass(frozen=True)
class Stack:
    """A transducer as a plate: layers back to front, in thickness-extensional motion.

    `(AIR | disk | glue | ml1 | AIR).with_area(2.01e-4)` is the same thing, written the way it looks.
    """

    layers: tuple[Layer, ...]
    """Back to front."""
    back: Load = AIR
    front: Load = AIR
    area: float = 1.0
    """m2."""
    connection: Literal["series", "parallel"] = "series"
    """How several piezoelectric layers are wired; `Piezo.polarity` says which way round."""

    def __post_init__(self) -> None:
        require_positive("stack", area=self.area)
        names = [layer.name for layer in self.layers]
        for name in names:
            if names.count(name) > 1:
                raise StackError(f"stack: two layers are called {name!r}; every layer needs a name of its own")
            if name in _OWN or "." in name:
                raise StackError(f"stack: a layer is called {name!r}; a name has no dot and is none of {_OWN}")
        if not any(isinstance(layer, Piezo) for layer in self.layers):
            raise StackError(f"stack: none of the layers {names} is piezoelectric; at least one must be")

    @classmethod
    def from_row(cls, parts: Sequence[Joins], area: float) -> Self:
        """Return the stack of a row `load | layers | load`. Raises StackError where a load is missing or inside."""
        ends = [parts[0], parts[-1]]
        inner = parts[1:-1]
        if len(parts) < 3 or not all(isinstance(end, Load) for end in ends):
            raise StackError("stack: a row begins and ends with a load, as in AIR | disk | AIR")
        if any(isinstance(part, Load) for part in inner):
            raise StackError("stack: a load stands between two layers; loads stand at the ends only")
        back, front = cast(list[Load], ends)
        return cls(cast(tuple[Layer, ...], tuple(inner)), back, front, area)

    def parameters(self) -> dict[str, float]:
        """Return every parameter: `layer.constant`, `area` (m2), `back.z`, `front.z` (Rayl)."""
        result = {f"{layer.name}.{key}": value for layer in self.layers for key, value in layer.parameters().items()}
        result["area"] = self.area
        for side, load in (("back", self.back), ("front", self.front)):
            result |= {f"{side}.{key}": value for key, value in load.parameters().items()}
        return result

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the stack with these parameters. Raises KeyError for a name it does not have."""
        self._require(values)
        groups: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            owner, _, key = name.partition(".")
            groups.setdefault(owner, {})[key] = value
        return replace(
            self,
            layers=tuple(layer.replace(groups.get(layer.name, {})) for layer in self.layers),
            back=self.back.replace(groups.get("back", {})),
            front=self.front.replace(groups.get("front", {})),
            area=values.get("area", self.area),
        )

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        return self._network(frequency).Z / self.area

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N), in the order of `names`.

        Raises KeyError for a name the stack does not have.
        """
        self._require(names)
        network = self._network(frequency)
        slopes = self._slopes(network, frequency, {name.partition(".")[0] for name in names})
        rows = np.empty((len(names), frequency.size), np.complex128)
        for row, name in zip(rows, names, strict=True):
            row[:] = -1 / self.area if name == "area" else slopes[name] / network.Z
        return network.Z / self.area, rows

    def _require(self, names: Sequence[str] | Mapping[str, float]) -> None:
        known = self.parameters()
        for name in names:
            if name not in known:
                raise KeyError(f"the stack has no parameter {name!r}; it has {', '.join(known)}")

    def _network(self, frequency: Frequencies) -> Network:
        sections = self._sections(frequency)
        loads = self.back.impedance(frequency), self.front.impedance(frequency)
        return Network(sections, *loads, parallel=self.connection == "parallel")

    def _sections(self, frequency: Frequencies) -> list[Section]:
        omega = 2 * np.pi * frequency
        return [_section(layer, frequency, omega) for layer in self.layers]

    def _slopes(self, network: Network, frequency: Frequencies, owners: set[str]) -> dict[str, ComplexLike]:
        """Return d Z / d parameter in ohm m2 for every parameter of these layers and loads."""
        field = network.field()
        slopes: dict[str, ComplexLike] = {}
        for k, layer in enumerate(self.layers):
            if layer.name not in owners:
                continue
            section = network.sections[k]
            faces = field.v[k], field.F[k], field.v[k + 1], field.F[k + 1]
            if is_active(section):
                weights = section.weights_driven(network.currents[k], *faces)
            else:
                weights = section.weights(*faces)
            for key, gradient in layer.gradients(frequency).items():
                slopes[f"{layer.name}.{key}"] = sum(weights[what] * size for what, size in gradient.items())
        for side, load, v in (("back", self.back, field.v[0]), ("front", self.front, field.v[-1])):
            for key, size in load.gradients(frequency).items():
                slopes[f"{side}.{key}"] = v * v * size
        return slopes


def _section(layer: Layer, frequency: Frequencies, omega: Frequencies) -> Section:
    """Return the layer at all frequencies."""
    if not isinstance(layer, Elastic | Piezo):
        raise TypeError(f"{type(layer).__name__} is no layer")
    Zc, delay = layer.wave(frequency)
    jw = np.multiply(1j, omega, dtype=np.complex128)
    theta = jw * delay
    D = one_minus_exp(theta.real, theta.imag)
    B = D * (2.0 - D)
    A = 2.0 - B
    if isinstance(layer, Elastic):
        return Line(Zc, theta, D, B, A)
    H = layer.field_per_strain(frequency) / jw
    W = layer.clamped_elastance(frequency) / jw
    return ActiveLine(Zc, theta, D, B, A, H, W)
