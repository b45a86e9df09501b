"""A layer that an effect adds to a stack: at an interface or on a face."""

from dataclasses import replace

from ...stack import Layer, Piezo, Stack
from ...stack.row import Joins
from .effect import FACES, interface_at, is_bare_front


def with_layer_between(stack: Stack, where: str, layer: Layer | Joins) -> Stack:
    """Return the stack with a layer at an interface, directly behind the one in front of it."""
    _, before = interface_at(where)
    return _with_layer(stack, [one.name for one in stack.layers].index(before), layer)


def with_layer_on_piezo(stack: Stack, where: str, layer: Layer | Joins) -> Stack:
    """Return the stack with a layer at a face or interface; at an interface it is on the piezoelectric layer.

    An interface that is not glued yet is the front.
    """
    return _with_layer(stack, _position(stack, where), layer)


def _position(stack: Stack, where: str) -> int:
    if where in FACES:
        return 0 if where == FACES[0] else len(stack.layers)
    if is_bare_front(stack, where):
        return len(stack.layers)
    names = [layer.name for layer in stack.layers]
    behind, before = (names.index(name) for name in interface_at(where))
    return before if isinstance(stack.layers[before], Piezo) else behind + 1


def _with_layer(stack: Stack, k: int, layer: Layer | Joins) -> Stack:
    return replace(stack, layers=(*stack.layers[:k], layer, *stack.layers[k:]))
