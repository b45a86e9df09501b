"""A world and what is planted in it: effects that are to be found, and imperfections that every real device has."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from ..devices.flaws import NOTHING, FixtureResidue, Flaws
from ..devices.specimen import Ceramic, Specimen

Needs = Literal["nothing", "up and down", "levels", "a plain disk", "a backing", "a bond"]


@dataclass(frozen=True)
class LabWorld:
    """A specimen, all its flaws while one step is measured, and the fixture."""

    specimen: Specimen
    flaws: Flaws = NOTHING
    fixture: FixtureResidue = field(default_factory=FixtureResidue)

    def with_flaws(self, **changes: Any) -> "LabWorld":
        """Return the same with other flaws."""
        return replace(self, flaws=replace(self.flaws, **changes))

    def wired(self, **changes: Any) -> "LabWorld":
        """Return the same with other wiring."""
        return replace(self, flaws=self.flaws.wired(**changes))

    def with_ceramic(self, **changes: Any) -> "LabWorld":
        """Return the same with another ceramic."""
        ceramic: Ceramic = replace(self.specimen.ceramic, **changes)
        return replace(self, specimen=replace(self.specimen, ceramic=ceramic))


@dataclass(frozen=True)
class Plant:
    """One effect. `put(world, scale)` adds it at `scale` times its drawn size; at 0 nothing is added."""

    effect: str
    where: tuple[str, ...]
    """All places that count as right, because this recording cannot know better."""
    steps: tuple[str, ...]
    """The steps whose recordings have it, in gluing order."""
    put: Callable[[LabWorld, float], LabWorld]
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    """Drawn sizes that grow with the scale, SI, for the truth."""
    shape: Mapping[str, float | str] = field(default_factory=dict[str, float | str])
    """What the scale leaves as it is, for the truth."""
    least: float = 0.05
    most: float = 20.0
    """Range of scales that are physical."""
    scale: float = 1.0
    needs: Needs = "nothing"
    minor: bool = False
    """An imperfection: it may be named, and need not be."""
    accept: tuple[str, ...] = ()
    """Other names that are right as well."""

    def at(self, scale: float) -> "Plant":
        """Return the plant at another size, kept within what is physical."""
        return replace(self, scale=min(max(scale, self.least), self.most))


@dataclass(frozen=True)
class Hideout:
    """A bare world with plants."""

    bare: LabWorld
    plants: tuple[Plant, ...] = ()

    def world(self, step: str) -> LabWorld:
        """Return everything as it is while `step` is measured."""
        world = self.bare
        for plant in self.plants:
            if plant.scale and step in plant.steps:
                world = plant.put(world, plant.scale)
        return world

    def scaled(self, index: int, scale: float) -> "Hideout":
        """Return the same with one plant at another scale; 0: it is not there."""
        plants = tuple(replace(p, scale=scale) if k == index else p for k, p in enumerate(self.plants))
        return replace(self, plants=plants)

    @property
    def untold(self) -> tuple[str, ...]:
        """Names of the layers that the build file does not have."""
        found = {self.world(step).flaws.untold for step in self.bare.specimen.steps}
        return tuple(sorted(one[0] for one in found if one is not None))
