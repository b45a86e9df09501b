"""One transducer as it is built up: its layers, and its gluing steps in order."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from .sweep_plan import LevelLimits, SweepPlan


@dataclass(frozen=True)
class Quantity:
    """A value in SI units with its standard uncertainty; complex where the constant is."""

    re: float
    im: float = 0.0
    u: float = 0.0
    """Standard uncertainty of the real part (or of a real value); 0 means "taken as exact"."""
    u_im: float = 0.0
    """Standard uncertainty of the imaginary part; 0 means "taken as exact"."""
    source: str = ""
    """Where the value comes from: `build.toml`, or the source the material library names."""
    bounds: tuple[float, float] | None = None
    """What the real part may not leave in a fit; None where physics alone bounds it."""
    same_as: str | None = None
    """Full name (`glue1.z`) of the constant that this one is tied to: the two are one in a fit."""

    @property
    def value(self) -> complex:
        """The value as one complex number."""
        return complex(self.re, self.im)


@dataclass(frozen=True)
class LayerSpec:
    """One layer as it is known before the fit.

    `values` is keyed by the field's names, SI units: `thickness` (m), `density` (kg/m3) and, for a piezo layer,
    `c33D` (Pa), `h33` (V/m), `eps33S` (F/m) and those radial constants that are known (`s11E s12E d31 eps33T` ...);
    for an elastic layer `z` (Rayl), `c` (m/s), `q`.
    """

    name: str
    kind: Literal["piezo", "elastic"]
    values: Mapping[str, Quantity]
    material: str | None = None
    nominal: Mapping[str, Quantity] = field(default_factory=dict[str, Quantity])
    """The data sheet's values of the same names, for comparison; empty where there is no material."""


@dataclass(frozen=True)
class LoadSpec:
    """What the outermost face rests on: a half-space of specific acoustic impedance `z`."""

    name: str
    z: Quantity
    """Rayl (Pa s/m)."""


@dataclass(frozen=True)
class Step:
    """A gluing step: the layers that are there when it is measured, back to front."""

    name: str
    layers: tuple[str, ...]
    reground: Mapping[str, Quantity] = field(default_factory=dict[str, Quantity])
    """Thickness (m) of the layers that were ground since the step before, by layer; it holds from this step on."""


@dataclass(frozen=True)
class Build:
    """One transducer, from `build.toml`."""

    name: str
    area: Quantity
    """m2."""
    layers: tuple[LayerSpec, ...]
    """Back to front."""
    back: LoadSpec
    front: LoadSpec
    steps: tuple[Step, ...]
    """In gluing order."""
    diameter: Quantity | None = None
    """m; None where only the area is known."""
    plan: SweepPlan | None = None
    """How this transducer is to be measured, where the file says so."""
    limits: LevelLimits | None = None
    """What this sample stands, where the file says so; no plan with more is measured."""

    @property
    def data_sheet(self) -> dict[str, Quantity]:
        """What the data sheet says of each constant (`disk.c33D`); the build file, where there is no data sheet."""
        return {
            f"{layer.name}.{name}": quantity
            for layer in self.layers
            for name, quantity in {**layer.values, **layer.nominal}.items()
        }

    def layer(self, name: str) -> LayerSpec:
        """Return the layer called `name`. Raises KeyError."""
        return {layer.name: layer for layer in self.layers}[name]

    def step(self, name: str) -> Step:
        """Return the step called `name`. Raises KeyError."""
        return {step.name: step for step in self.steps}[name]

    def reground(self, name: str) -> dict[str, tuple[str, Quantity]]:
        """Return the layers of step `name` that were ground so far: in which step last, and to what thickness (m).

        Raises KeyError.
        """
        self.step(name)
        found: dict[str, tuple[str, Quantity]] = {}
        for step in self.steps:
            found |= {layer: (step.name, thickness) for layer, thickness in step.reground.items()}
            if step.name == name:
                break
        return found
