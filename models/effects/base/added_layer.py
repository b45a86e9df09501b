"""A layer that an effect adds to a stack: at an interface or on a face."""

from dataclasses import replace

from ...base.face_loads import FACES
from ...stack import Layer, Piezo, Stack
from ...stack.row import Joins
from .effect import interface_at


def with_layer_between(stack: Stack, where: str, layer: Layer | Joins) -> Stack:
    """Return the stack with a layer at an interface, directly behind the one in front of it."""
    _, before = interface_at(where)
    return _with_layer(stack, [one.name for one in stack.layers].index(before), layer)


def with_layer_on_piezo(stack: Stack, where: str, layer: Layer | Joins) -> Stack:
    """Return the stack with a layer at a face or interface; at an interface it is on the piezoelectric layer.

    An interface that is not glued yet is the front.
    """
    return _with_layer(stack, _position(stack, where), layer)


def with_layer_opposite(stack: Stack, where: str, layer: Layer | Joins) -> Stack:
    """Return the stack with a layer on the other face of the ceramic at `where`, outside of what is dead of it."""
    at = _position(stack, where)
    live = [k for k, one in enumerate(stack.layers) if isinstance(one, Piezo) and not _is_dead(one)]
    k = min(live, key=lambda k: abs(k + 0.5 - at))
    return _with_layer(stack, _outside(stack, k, 1 if k >= at else -1), layer)


def is_face_of_one_ceramic(stack: Stack, where: str) -> bool:
    """Return whether a face or interface is that of one ceramic, and not where two meet or none is."""
    at = _position(stack, where)
    return [isinstance(one, Piezo) for one in stack.layers[max(0, at - 1) : at + 1]].count(True) == 1


def _is_dead(layer: Layer | Joins) -> bool:
    return isinstance(layer, Piezo) and layer.h33 == 0


def _outside(stack: Stack, k: int, way: int) -> int:
    """Return the position on a face of layer `k`, in front of it (`way` 1) or behind (-1), outside of what is dead."""
    while 0 <= k + way < len(stack.layers) and _is_dead(stack.layers[k + way]):
        k += way
    return k + 1 if way > 0 else k


def _position(stack: Stack, where: str) -> int:
    if where in FACES:
        return 0 if where == FACES[0] else len(stack.layers)
    names = [layer.name for layer in stack.layers]
    behind, before = interface_at(where)
    if before in names and isinstance(stack.layers[names.index(before)], Piezo):
        return _outside(stack, names.index(before), -1)
    return _outside(stack, names.index(behind), 1)


def _with_layer(stack: Stack, k: int, layer: Layer | Joins) -> Stack:
    return replace(stack, layers=(*stack.layers[:k], layer, *stack.layers[k:]))
