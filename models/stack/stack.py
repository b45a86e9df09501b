"""The stack: layers between two loads, its impedance and the exact derivatives by every parameter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, Self, TypeAlias, cast

import numpy as np

from ..base.arrays import Complexes, Frequencies, Impedances
from .bolt import NAME, Bolt
from .graded import sections_by_layer
from .layers import Elastic, Piezo
from .loads import AIR, Load
from .loss_laws import StackError, require_positive
from .lumps import Mass, Spring
from .network import Network, Path
from .row import Joins, LayerRow
from .sections import sections_of
from .slopes import Slopes

Layer: TypeAlias = Piezo | Elastic | Spring | Mass
"""Elements that can be placed between the loads."""

_OWN = ("area", "back", "front")


@dataclass(frozen=True)
class Stack:
    """A transducer as a plate: layers back to front, in thickness-extensional motion.

    `(AIR | disk | glue | ml1 | AIR).with_area(2.01e-4)` is an equivalent notation that looks like the sample.
    """

    layers: tuple[Layer, ...]
    """Back to front."""
    back: Load = AIR
    front: Load = AIR
    area: float = 1.0
    """Area of the faces, m2."""
    connection: Literal["series", "parallel"] = "series"
    """Wiring of several piezoelectric layers; `Piezo.polarity` gives their orientation."""
    bolt: Bolt | None = None
    """A bolt that presses layers together."""
    _asked: list[tuple[Frequencies, Network]] = field(
        default_factory=list[tuple[Frequencies, Network]], init=False, repr=False, compare=False
    )
    """One-entry cache of the network: callers evaluate the same stack repeatedly at the same frequencies."""

    def __post_init__(self) -> None:
        require_positive("stack", area=self.area)
        names = [layer.name for layer in self.layers]
        for name in names:
            if names.count(name) > 1:
                raise StackError(f"stack: two layers are called {name!r}; every layer needs a name of its own")
            if name in _OWN or "." in name or (self.bolt is not None and name == NAME):
                raise StackError(f"stack: a layer is called {name!r}; a name has no dot and is none of {_OWN}")
        if not any(isinstance(layer, Piezo) for layer in self.layers):
            raise StackError(f"stack: none of the layers {names} is piezoelectric; at least one must be")

    @classmethod
    def from_row(cls, parts: Sequence[Joins], area: float) -> Self:
        """Return the stack of a row `load | layers | load`. Raises StackError if a load is missing or inside."""
        ends, inner = [parts[0], parts[-1]], parts[1:-1]
        if len(parts) < 3 or not all(isinstance(end, Load) for end in ends):
            raise StackError("stack: a row begins and ends with a load, as in AIR | disk | AIR")
        if any(isinstance(part, Load) for part in inner):
            raise StackError("stack: a load stands between two layers; loads stand at the ends only")
        back, front = cast(list[Load], ends)
        return cls(cast(tuple[Layer, ...], tuple(inner)), back, front, area)

    def parameters(self) -> dict[str, float]:
        """Return every parameter: `layer.constant`, `back.z`, `front.z` (Rayl), `bolt.stiffness` (N/m), `area` (m2)."""
        own = ((owner, part.parameters()) for owner, part in self._parts().items())
        bolt = {} if self.bolt is None else {f"{NAME}.stiffness": self.bolt.stiffness}
        every = {f"{owner}.{key}": value for owner, values in own for key, value in values.items()}
        return every | bolt | {"area": self.area}

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of all parameters."""
        return frozenset(self.parameters())

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the stack with these parameters. Raises KeyError for an unknown name."""
        parts = self._parts()
        groups: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            owner, _, key = name.partition(".")
            if name not in self.names:
                raise self._unknown(name)
            groups.setdefault(owner, {})[key] = value
        area = groups.pop("area", {"": self.area})[""]
        bolt, screwed = self.bolt, groups.pop(NAME, {}) if self.bolt is not None else {}
        if bolt is not None and screwed:
            bolt = bolt.with_stiffness(screwed["stiffness"])
        for owner, changes in groups.items():
            parts[owner] = parts[owner].replace(changes)
        layers = tuple(cast(Layer, parts[layer.name]) for layer in self.layers)
        back, front = cast(Load, parts["back"]), cast(Load, parts["front"])
        replaced = type(self)(layers, back, front, area, self.connection, bolt)
        vars(replaced)["names"] = self.names  # they stay the same
        return replaced

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        return self._network(frequency).Z / self.area

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N), in the order of `names`.

        Raises KeyError for an unknown name.
        """
        network = self._network(frequency)
        slopes = Slopes(network, self.layers, {"back": self.back, "front": self.front}, frequency, self.bolt)
        rows = np.empty((len(names), frequency.size), np.complex128)
        for row, name in zip(rows, names, strict=True):
            if name == "area":
                np.multiply(network.Z + network.path_weight, -1 / self.area, out=row)
                continue
            try:
                slopes.write(name, row)
            except KeyError:
                raise self._unknown(name) from None
        rows *= 1.0 / network.Z
        return network.Z / self.area, rows

    def _network(self, frequency: Frequencies) -> Network:
        if self._asked and self._asked[0][0] is frequency:
            return self._asked[0][1]
        loads = self.back.impedance(frequency), self.front.impedance(frequency)
        sections, parallel = sections_of(self.layers, frequency), self.connection == "parallel"
        network = Network(sections, *loads, parallel=parallel, path=self.path(frequency))
        if not frequency.flags.writeable:
            self._asked[:] = [(frequency, network)]
        return network

    def path(self, frequency: Frequencies) -> Path | None:
        """Return the bolt at these frequencies (Hz), or None if there is none that acts."""
        ends = None if self.bolt is None else self.bolt.ends(sections_by_layer(self.layers))
        if self.bolt is None or ends is None:
            return None
        return Path(*ends, self.bolt.compliance(frequency, self.area))

    def _parts(self) -> dict[str, Layer | Load]:
        """Return layers and loads by the prefix of their parameters."""
        return {layer.name: layer for layer in self.layers} | {"back": self.back, "front": self.front}

    def _unknown(self, name: str) -> KeyError:
        return KeyError(f"the stack has no parameter {name!r}; it has {', '.join(self.parameters())}")


LayerRow.stack_of = Stack.from_row
