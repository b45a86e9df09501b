"""A transducer as it is built up: its layers, and its gluing steps in order."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from .base.names import numbered
from .specification import Specification
from .sweep_plan import LevelLimits, SweepPlan

NEEDED = {"piezo": ("thickness", "density", "c33D", "h33", "eps33S"), "elastic": ("thickness", "z", "c", "q")}
"""Constants that a model needs of each kind of layer."""


@dataclass(frozen=True)
class Quantity:
    """A value in SI units with its standard uncertainty; complex if the constant is."""

    re: float
    im: float = 0.0
    u: float = 0.0
    """Standard uncertainty of the real part (or of a real value); 0 means "taken as exact"."""
    u_im: float = 0.0
    """Standard uncertainty of the imaginary part; 0 means "taken as exact"."""
    source: str = ""
    """Source of the value: `build.toml`, or the source named by the material library."""
    bounds: tuple[float, float] | None = None
    """Limits of the real part in a fit; None if only physics limits it."""
    same_as: str | None = None
    """Full name (`glue1.z`) of the constant that this one is tied to: a fit treats them as one."""

    @property
    def value(self) -> complex:
        """The value as one complex number."""
        return complex(self.re, self.im)


@dataclass(frozen=True)
class LayerSpec:
    """One layer as known before the fit.

    `values` is keyed by the field's names, SI units: `thickness` (m), `density` (kg/m3) and, for a piezo layer,
    `c33D` (Pa), `h33` (V/m), `eps33S` (F/m) and those radial constants that are known (`s11E s12E d31 eps33T` ...);
    for an elastic layer `z` (Rayl), `c` (m/s), `q`.
    """

    name: str
    kind: Literal["piezo", "elastic"]
    values: Mapping[str, Quantity]
    material: str | None = None
    nominal: Mapping[str, Quantity] = field(default_factory=dict[str, Quantity])
    """The data sheet's values of the same names, for comparison; empty if there is no material."""
    polarity: int = 1
    """Of a piezo layer: +1, or -1 if it is poled against the direction back to front."""


@dataclass(frozen=True)
class LoadSpec:
    """Load of an outermost face: a half-space of specific acoustic impedance `z`."""

    name: str
    z: Quantity
    """Rayl (Pa s/m)."""


@dataclass(frozen=True)
class BoltSpec:
    """A bolt that presses layers together: a spring parallel to all that lies between two layers."""

    behind: str
    """The layer that holds its back end."""
    before: str
    """The layer that holds its front end."""
    stiffness: Quantity
    """N/m."""

    def acts_in(self, layers: tuple[str, ...]) -> bool:
        """Return whether both of its layers are among these."""
        return self.behind in layers and self.before in layers


@dataclass(frozen=True)
class Step:
    """A gluing step: the layers present when it is measured, back to front."""

    name: str
    layers: tuple[str, ...]
    reground: Mapping[str, Quantity] = field(default_factory=dict[str, Quantity])
    """Thickness (m) of the layers that were ground since the previous step, by layer; valid from this step on."""
    mass: Quantity | None = None
    """Mass (kg) of all layers of this step, as weighed: a datum of their densities."""


@dataclass(frozen=True)
class EffectSpec:
    """An effect that the sample is known to have; it is part of the model of its steps."""

    effect: str
    """Name in the catalogue; `learned` for a law found by `pzctl diagnose --learn`."""
    where: str
    """Place: `terminals`, `layer:NAME`, `interface:A|B`, `face:back` ..."""
    values: Mapping[str, Quantity]
    """Value of each of its parameters, SI units; one with an uncertainty is fitted."""
    steps: tuple[str, ...] = ()
    """Steps that have it; empty: all that have its place."""
    quantity: str = ""
    """What a learned law corrects: `permittivity`, `series` ..."""
    law: str = ""
    """Name of a learned law."""
    reference: float = 0.0
    """Frequency at which a learned law has its size, Hz; 0: the resonance of the sample's active layer."""


@dataclass(frozen=True)
class Build:
    """One transducer, from `build.toml`."""

    name: str
    area: Quantity
    """Area of the faces, m2."""
    layers: tuple[LayerSpec, ...]
    """Back to front."""
    back: LoadSpec
    front: LoadSpec
    steps: tuple[Step, ...]
    """In gluing order."""
    diameter: Quantity | None = None
    """Diameter, m; None if only the area is known."""
    hole_diameter: Quantity | None = None
    """Diameter of a round hole through the middle of all layers, m; the area is then that of a ring."""
    plan: SweepPlan | None = None
    """Measuring plan, if the file contains one."""
    limits: LevelLimits | None = None
    """Limits of this sample, if the file states them; no plan that exceeds them is measured."""
    specification: Specification | None = None
    """Limits of the constants, if the file states them; each fit is compared with them."""
    metadata: Mapping[str, str | float] = field(default_factory=dict[str, str | float])
    """What was noted at the measurement: `operator`, `temperature_C`, `batch`, `barcode`, and any other key."""
    effects: tuple[EffectSpec, ...] = ()
    """Effects that the sample is known to have."""
    connection: Literal["series", "parallel"] = "series"
    """Wiring of the piezo layers; without meaning if there is only one."""
    bolt: BoltSpec | None = None
    """Its bolt, if it has one; it acts in the steps that have both of its layers."""

    @property
    def data_sheet(self) -> dict[str, Quantity]:
        """Data-sheet value of each constant (`disk.c33D`); that of the build file if there is no data sheet.

        Also the value of each effect's parameters (`lead-inductance@terminals.inductance`).
        """
        constants = {
            f"{layer.name}.{name}": quantity
            for layer in self.layers
            for name, quantity in {**layer.values, **layer.nominal}.items()
        }
        bolt = {} if self.bolt is None else {"bolt.stiffness": self.bolt.stiffness}
        return (
            constants
            | bolt
            | {
                f"{known}@{one.where}.{name}": quantity
                for known, one in zip(self.effect_keys, self.effects, strict=True)
                for name, quantity in one.values.items()
            }
        )

    @property
    def effect_keys(self) -> tuple[str, ...]:
        """Names of its effects in the names of parameters: the second law learned at a place is `learned-2`."""
        places = [(one.effect, one.where) for one in self.effects]
        return tuple(numbered(one[0], places[: k + 1].count(one)) for k, one in enumerate(places))

    def noted(
        self, step: str, metadata: Mapping[str, str | float] | None = None, mass: Quantity | None = None
    ) -> "Build":
        """Return the build with further metadata, and with the mass (kg) of a step. Raises KeyError."""
        self.step(step)
        steps = self.steps
        if mass is not None:
            steps = tuple(replace(one, mass=mass) if one.name == step else one for one in steps)
        return replace(self, steps=steps, metadata={**self.metadata, **(metadata or {})})

    @property
    def piezos(self) -> tuple[LayerSpec, ...]:
        """The piezo layers, back to front."""
        return tuple(layer for layer in self.layers if layer.kind == "piezo")

    def poling(self, layer: LayerSpec) -> str:
        """Return the arrow of a layer's poling, front to the right; empty if there is only one piezo layer."""
        if layer.kind != "piezo" or len(self.piezos) < 2:
            return ""
        return "\N{RIGHTWARDS ARROW}" if layer.polarity > 0 else "\N{LEFTWARDS ARROW}"

    def layer(self, name: str) -> LayerSpec:
        """Return the layer named `name`. Raises KeyError."""
        return {layer.name: layer for layer in self.layers}[name]

    def step(self, name: str) -> Step:
        """Return the step named `name`. Raises KeyError."""
        return {step.name: step for step in self.steps}[name]

    def reground(self, name: str) -> dict[str, tuple[str, Quantity]]:
        """Return the layers ground until step `name`: before which step last, and the thickness (m), by layer.

        Raises KeyError for an unknown step.
        """
        self.step(name)
        found: dict[str, tuple[str, Quantity]] = {}
        for step in self.steps:
            found |= {layer: (step.name, thickness) for layer, thickness in step.reground.items()}
            if step.name == name:
                break
        return found
