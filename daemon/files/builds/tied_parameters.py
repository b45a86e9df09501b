"""Tied constants of build.toml: `{ same_as = "glue1" }` takes the value from the layer it names.

`material = { same_as = "piezo1" }` ties all constants of a ceramic; the layer keeps its own thickness and polarity.
"""

from collections.abc import Mapping
from dataclasses import replace

from ....models.build import LayerSpec, Quantity
from .build_table import BuildError

CERAMIC = ("c33D", "h33", "eps33S", "density")
"""Constants that two layers of one ceramic share."""


def resolved(layers: tuple[LayerSpec, ...], source: str) -> tuple[LayerSpec, ...]:
    """Return the layers with the value of each tied constant filled in. Raises BuildError."""
    known = {f"{layer.name}.{name}": quantity for layer in layers for name, quantity in layer.values.items()}
    by_name = {layer.name: layer for layer in layers}
    return tuple(_resolved(layer, known, by_name, source) for layer in layers)


def _resolved(
    layer: LayerSpec, known: Mapping[str, Quantity], by_name: Mapping[str, LayerSpec], source: str
) -> LayerSpec:
    made = replace(layer, values={name: _value(layer, name, known, source) for name in layer.values})
    leader = ceramic_of(made)
    if leader == layer.name:
        return made
    first = by_name[leader]
    radial = {name: quantity for name, quantity in first.values.items() if name not in (*CERAMIC, "thickness")}
    radial.pop("electrode_diameter", None)
    return replace(made, values=radial | dict(made.values), material=first.material, nominal=first.nominal)


def ceramic_of(layer: LayerSpec) -> str:
    """Return the name of the layer whose ceramic this one has: its own, unless the build ties it."""
    constant = layer.values.get(CERAMIC[0])
    return layer.name if constant is None or constant.same_as is None else constant.same_as.partition(".")[0]


def _value(layer: LayerSpec, name: str, known: Mapping[str, Quantity], source: str) -> Quantity:
    quantity = layer.values[name]
    if quantity.same_as is None:
        return quantity
    where = f"{source}: {name} of layer {layer.name!r}: same_as is {quantity.same_as.removesuffix(f'.{name}')!r}"
    leader = known.get(quantity.same_as)
    if leader is None:
        this, end = f"{layer.name}.{name}", f".{name}"
        others = sorted(full.removesuffix(end) for full in known if full.endswith(end) and full != this)
        raise BuildError(f"{where}; the layers with {name} are {', '.join(others) or 'none'}")
    if leader.same_as is not None:
        raise BuildError(f"{where}, which is itself tied to {leader.same_as}; tie both to one that is not tied")
    return replace(leader, same_as=quantity.same_as)
