"""Constants held as exact: their tolerances, and the sensitivity of the recordings to them."""

from collections.abc import Mapping

import numpy as np

from ...models.base.arrays import Reals
from .objective import Objective
from .parameters.coordinates import Coordinates

_TOLERANCE = {
    "z": 0.1,
    "c": 0.1,
    "q": 0.5,
    "thickness": 0.1,
    "density": 0.01,
    "area": 0.005,
    "c33D": 0.03,
    "h33": 0.03,
    "eps33S": 0.05,
    "s11E": 0.03,
    "s12E": 0.03,
    "d31": 0.03,
    "eps33T": 0.05,
}
_THICKNESS = 1e-6
_LOSS = 0.3
"""Relative standard tolerances of values taken as exact: a glue of unknown batch, a data sheet, a calliper. That of a
thickness is at most a micrometer."""


def kind_of(name: str) -> str:
    """Return the last part of a full name: `thickness` of `ml1.thickness@polished`."""
    return name.rpartition(".")[2].partition("@")[0]


def held_constants(coordinates: Coordinates, values: Mapping[str, float]) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return the held coordinates, and the tolerance of each in SI units (of a loss: relative).

    Held parameters of an effect are not among them: a build that states one without uncertainty means it.
    """
    held = tuple(name for name in coordinates.names if name not in coordinates.free and not _of_effect(name))
    tolerances: dict[str, float] = {}
    for name in held:
        value = abs(values.get(name, values.get(f"{name}.re", 1.0)))
        kind = kind_of(name.removesuffix(".loss"))
        relative = _LOSS if name.endswith(".loss") else _TOLERANCE.get(kind, 1.0)
        size = relative if name.endswith(".loss") else relative * value
        tolerances[name] = min(size, _THICKNESS) if kind == "thickness" else size
    return held, tolerances


def _of_effect(name: str) -> bool:
    """Return whether a name is that of an effect's parameter: `lead-inductance@terminals.inductance`."""
    return "@" in name.partition(".")[0]


def slopes_by_held(objective: Objective, held: tuple[str, ...], values: Mapping[str, float]) -> Reals:
    """Return d residual / d held value, shape (R, held); for a loss, d residual / d coordinate."""
    if not held:
        return np.zeros((2 * objective.points, 0))
    coordinates = Coordinates(objective.coordinates.blocks, dict(values), held)
    freed = Objective(objective.recordings, coordinates, ())
    rows = freed.jacobian(coordinates.x)[: 2 * objective.points]
    _, chain = coordinates.forward(coordinates.x)
    place = {name: k for k, name in enumerate(coordinates.parameters)}
    scale = [
        chain[place.get(name, place.get(f"{name}.re", -1)), k] if not name.endswith(".loss") else 1.0
        for k, name in enumerate(coordinates.free)
    ]
    return rows / np.where(np.array(scale) == 0, np.inf, scale)
