"""Tied constants of build.toml: `{ same_as = "glue1" }` takes the value from the layer it names."""

from collections.abc import Mapping
from dataclasses import replace

from ....models.build import LayerSpec, Quantity
from .build_table import BuildError


def resolved(layers: tuple[LayerSpec, ...], source: str) -> tuple[LayerSpec, ...]:
    """Return the layers with the value of each tied constant filled in. Raises BuildError."""
    known = {f"{layer.name}.{name}": quantity for layer in layers for name, quantity in layer.values.items()}
    return tuple(
        replace(layer, values={name: _value(layer, name, known, source) for name in layer.values}) for layer in layers
    )


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
