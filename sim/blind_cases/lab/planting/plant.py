"""A world and its plants: effects that are to be found, and imperfections that every real device has."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from ..devices.flaws import NOTHING, FixtureResidue, Flaws
from ..devices.specimen import Ceramic, LabDevice

Needs = Literal["nothing", "up and down", "levels", "a plain disk", "a backing", "a bond"]


@dataclass(frozen=True)
class LabWorld:
    """A specimen, all its flaws while one step is measured, and the fixture."""

    specimen: LabDevice
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
    """All places accepted as correct, because this recording cannot distinguish them."""
    steps: tuple[str, ...]
    """The steps whose recordings contain it, in gluing order."""
    put: Callable[[LabWorld, float], LabWorld]
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    """Drawn sizes that are proportional to the scale, SI, for the truth file."""
    shape: Mapping[str, float | str] = field(default_factory=dict[str, float | str])
    """Values that do not depend on the scale, for the truth file."""
    least: float = 0.05
    most: float = 20.0
    """Range of scales that are physical."""
    scale: float = 1.0
    needs: Needs = "nothing"
    minor: bool = False
    """Whether it is an imperfection, which may but need not be named."""
    usual: float = 1.0
    """Size of such an imperfection in devices of this kind, relative to the drawn one."""
    accept: tuple[str, ...] = ()
    """Other names that are accepted as correct."""

    def at(self, scale: float) -> "Plant":
        """Return the plant with another scale, limited to the physical range."""
        return replace(self, scale=min(max(scale, self.least), self.most))


@dataclass(frozen=True)
class LabScenario:
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

    def scaled(self, index: int, scale: float) -> "LabScenario":
        """Return the same with one plant at another scale; 0 removes it."""
        plants = tuple(replace(p, scale=scale) if k == index else p for k, p in enumerate(self.plants))
        return replace(self, plants=plants)

    @property
    def untold(self) -> tuple[str, ...]:
        """Names of the layers that the build file omits."""
        found = {self.world(step).flaws.untold for step in self.bare.specimen.steps}
        return tuple(sorted(one[0] for one in found if one is not None))
