"""Derivatives d Z / d parameter from the field in the stack: one multiplication per parameter."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..base.arrays import Complexes, Frequencies
from .bolt import NAME, Bolt
from .graded import GradedPiezo, sections_by_layer
from .layers import Elastic, Gradient, Piezo
from .loads import Load
from .loss_laws import ComplexLike
from .lumps import Mass, Spring
from .network import Network


class Slopes:
    """The derivatives of one stack at one set of frequencies; those of a layer are computed on first use."""

    def __init__(
        self,
        network: Network,
        layers: Sequence[Piezo | Elastic | Spring | Mass],
        loads: Mapping[str, Load],
        frequency: Frequencies,
        bolt: Bolt | None = None,
    ) -> None:
        self._bolt = bolt
        self._network = network
        self._frequency = frequency
        self._field = network.field()
        self._layers = {layer.name: layer for layer in layers}
        self._sections = sections_by_layer(layers)
        self._loads = loads
        self._known: dict[str, tuple[Mapping[str, ComplexLike], Mapping[str, Gradient]]] = {}

    def write(self, name: str, row: Complexes) -> None:
        """Write d Z / d `name`, ohm m2 per unit of the parameter, into `row`, shape (N,). Raises KeyError."""
        _, weight, size = self.factors(name)
        np.multiply(weight, size, out=row)

    def factors(self, name: str) -> tuple[tuple[str, str], ComplexLike, ComplexLike]:
        """Return d Z / d `name` as a product: by a quantity of a section, and of that by the parameter.

        The first result says which quantity of which section: its derivative is the same for several parameters.
        Raises KeyError.
        """
        owner, _, key = name.partition(".")
        if self._bolt is not None and name == f"{NAME}.stiffness":
            return (NAME, key), self._network.path_weight, 1 / self._bolt.stiffness
        if owner not in self._known:
            self._known[owner] = self._load(owner) if owner in self._loads else self._layer(owner)
        weights, gradients = self._known[owner]
        quantity, size = gradients[key]
        return (owner, quantity), weights[quantity], size

    def _layer(self, owner: str) -> tuple[Mapping[str, ComplexLike], Mapping[str, Gradient]]:
        layer = self._layers[owner]
        weights = [self._network.weights(k, self._field) for k in self._sections[owner]]
        whole = layer.weights(weights) if isinstance(layer, GradedPiezo) else weights[0]
        return whole, layer.gradients(self._frequency)

    def _load(self, side: str) -> tuple[Mapping[str, ComplexLike], Mapping[str, Gradient]]:
        v = self._field[0 if side == "back" else -1][0]
        sizes = self._loads[side].gradients(self._frequency)
        return {"z": v * v}, {key: ("z", size) for key, size in sizes.items()}
