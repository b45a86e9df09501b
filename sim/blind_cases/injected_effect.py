"""A piece of physics planted in a specimen: what it is called, where it sits, and how large it is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from .device_under_test import DeviceUnderTest
from .node_circuit import Path
from .scenario import NOTHING, Hidden

Needs = Literal["nothing", "up and down", "levels", "the disk alone", "a backing", "a bond", "two bonds"]


@dataclass(frozen=True)
class InjectedEffect:
    """One effect. `put(hidden, scale)` hides it at `scale` times its base size; at 0 it is not there."""

    effect: str
    where: tuple[str, ...]
    """All places that count as right, because this recording cannot know better."""
    steps: tuple[str, ...]
    """The steps whose recordings have it, in gluing order."""
    put: Callable[[Hidden, float], Hidden]
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    """Base sizes in SI units, for the truth file."""
    least: float = 1e-4
    most: float = 1e3
    """Range of scales that are physical."""
    scale: float = 1.0
    needs: Needs = "nothing"
    accept: tuple[str, ...] = ()
    """Other names that are right as well."""

    def at(self, scale: float) -> "InjectedEffect":
        """Return the plant at another size, kept within what is physical."""
        return replace(self, scale=min(max(scale, self.least), self.most))


@dataclass(frozen=True)
class Scenario:
    """A specimen with plants."""

    specimen: DeviceUnderTest
    plants: tuple[InjectedEffect, ...] = ()

    def hidden(self, step: str) -> Hidden:
        """Return everything hidden while `step` is measured."""
        hidden = NOTHING
        for plant in self.plants:
            hidden = plant.put(hidden, plant.scale if step in plant.steps else 0.0)
        return hidden

    @property
    def untold(self) -> tuple[str, ...]:
        """Names of the layers that the build file does not have."""
        found = (self.hidden(step).untold for step in self.specimen.steps)
        return tuple({one[0] for one in found if one is not None})

    def without(self, index: int) -> "Scenario":
        """Return the same with one plant gone."""
        plants = tuple(replace(p, scale=0.0) if k == index else p for k, p in enumerate(self.plants))
        return replace(self, plants=plants)


def path_plant(effect: str, steps: tuple[str, ...], most: float, **sizes: Any) -> InjectedEffect:
    """Return a plant on the way to the device; the sizes are those of `Path`."""

    def put(hidden: Hidden, scale: float) -> Hidden:
        path: Path = replace(hidden.path, **{name: scale * size for name, size in sizes.items()})
        return replace(hidden, path=path)

    return InjectedEffect(effect, ("terminals",), steps, put, sizes, most=most)


def slot_plant(
    effect: str,
    where: tuple[str, ...],
    steps: tuple[str, ...],
    slot: Callable[[float], dict[str, Any]],
    sizes: dict[str, float],
    **more: Any,
) -> InjectedEffect:
    """Return a plant that fills fields of `Hidden`; at scale 0 they are left as they are."""

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, **slot(scale)) if scale else hidden

    return InjectedEffect(effect, where, steps, put, sizes, **more)
