"""An effect that is injected into a device: its name, its place and its size."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from .device_under_test import DeviceUnderTest
from .node_circuit import Path
from .scenario import NOTHING, Hidden

Needs = Literal["nothing", "up and down", "levels", "the disk alone", "a backing", "a bond", "two bonds"]


@dataclass(frozen=True)
class InjectedEffect:
    """One effect. `apply(hidden, scale)` adds it with `scale` times its base size; at 0 it is absent."""

    name: str
    where: tuple[str, ...]
    """All places accepted as correct, because this recording cannot distinguish them."""
    steps: tuple[str, ...]
    """The steps whose recordings contain it, in gluing order."""
    apply: Callable[[Hidden, float], Hidden]
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    """Base sizes in SI units, for the truth file."""
    min_scale: float = 1e-4
    max_scale: float = 1e3
    """Range of scales that are physical."""
    scale: float = 1.0
    needs: Needs = "nothing"
    accept: tuple[str, ...] = ()
    """Other names that are accepted as correct."""

    def at(self, scale: float) -> "InjectedEffect":
        """Return the effect with another scale, limited to the physical range."""
        return replace(self, scale=min(max(scale, self.min_scale), self.max_scale))


@dataclass(frozen=True)
class Scenario:
    """A device and the effects in it."""

    device: DeviceUnderTest
    effects: tuple[InjectedEffect, ...] = ()

    def hidden(self, step: str) -> Hidden:
        """Return all hidden sizes while `step` is measured."""
        hidden = NOTHING
        for effect in self.effects:
            hidden = effect.apply(hidden, effect.scale if step in effect.steps else 0.0)
        return hidden

    @property
    def omitted(self) -> tuple[str, ...]:
        """Names of the layers that the build file omits."""
        omitted = (self.hidden(step).omitted for step in self.device.steps)
        return tuple({layer[0] for layer in omitted if layer is not None})

    def without(self, index: int) -> "Scenario":
        """Return the same scenario with one effect removed."""
        effects = tuple(replace(p, scale=0.0) if k == index else p for k, p in enumerate(self.effects))
        return replace(self, effects=effects)


def path_effect(name: str, steps: tuple[str, ...], max_scale: float, **sizes: Any) -> InjectedEffect:
    """Return an effect in the leads; the sizes are those of `Path`."""

    def apply(hidden: Hidden, scale: float) -> Hidden:
        path: Path = replace(hidden.path, **{key: scale * size for key, size in sizes.items()})
        return replace(hidden, path=path)

    return InjectedEffect(name, ("terminals",), steps, apply, sizes, max_scale=max_scale)


def field_effect(
    name: str,
    where: tuple[str, ...],
    steps: tuple[str, ...],
    fields: Callable[[float], dict[str, Any]],
    sizes: dict[str, float],
    **more: Any,
) -> InjectedEffect:
    """Return an effect that sets the fields of `Hidden` that `fields` returns for a scale; at scale 0 it sets none."""

    def apply(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, **fields(scale)) if scale else hidden

    return InjectedEffect(name, where, steps, apply, sizes, **more)
